"""What a decision is told with: what it does not rest on, and what would make the errors smaller."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from relnav_sim.report.consistency import PARTS
from relnav_sim.report.decision_table import decision_anchor, errors_over_sigma, largest_error
from relnav_sim.report.error_budget import budget_title
from relnav_sim.report.requirements import value_in_words
from relnav_sim.report.sentences import Clause, Sentence, joined
from relnav_sim.report.tables import Table
from relnav_sim.results.case_names import case_in_tables
from relnav_sim.statistics.decision import OVERCONFIDENT, CaseEvidence, Decision
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.regret import Regret
from relnav_sim.statistics.requirements import Judgement
from relnav_sim.wording import between, listed, significant

_STRESSES_NAMED = 6
_OTHER_CAUSE = ("not observable", "failed", "diverged", "overconfident")
"""Reasons to refuse a filter that speak of its model, not of the size of its errors."""


@dataclass(frozen=True)
class Background:
    """What a decision is told with.

    Attributes:
        labels: The labels of the decision's cases, by their numbers from 0.
        over: The span of the figures, in words.
        judged: The requirements, in the order of their table.
        under_stress: The requirements of the filter chosen under each stress, by its name and case in words.
        regrets: The regret of each case, by its number from 0.
        budget: The table of an error budget, the filter it is of in its title; None without one.
        budget_case: The number of its case.
        waiting: Filters without any run yet.
        shared_field: Whether filters know all of the truth's gravity field.
        replayed: Whether the measurements are recorded ones.
    """

    labels: Mapping[int, str]
    over: str
    judged: tuple[Judgement, ...] = ()
    under_stress: Mapping[str, tuple[Judgement, ...]] = field(default_factory=dict)
    regrets: Mapping[int, Regret] = field(default_factory=dict)
    budget: Table | None = None
    budget_case: int = 0
    waiting: tuple[str, ...] = ()
    shared_field: bool = False
    replayed: bool = False

    def named(self, index: int) -> str:
        """Return a case as a sentence names it in brackets: its number and label."""
        return f"case {case_in_tables(index, self.labels[index])}"


def what_would_help(decision: Decision, known: Background) -> Iterator[Sentence]:
    """Yield which source of error would be worth most to halve, from the table of the error budget.

    The budget follows from the sensors and the filter's own model: of a filter whose errors have another cause it would
    name the wrong source.
    """
    budget = known.budget
    if budget is None:
        return
    choice = next((choice for case, choice in decision.cases if case.index == known.budget_case), decision.overall)
    name = next((name for name in choice.refusals if budget.title == budget_title(name)), "")
    if any(refusal.reason in _OTHER_CAUSE for refusal in choice.refusals.get(name, ())):
        said = f"What would help most is not told: {name} is refused for another reason than the size of its errors."
        yield (Clause(said),)
        return
    gains = [(gain, row.label) for row in budget.rows if (gain := _gain(row.cells[-2].text)) > 0]
    if not gains:
        return
    gain, source = max(gains)
    words = Clause(f"{source}, {significant(gain, 2)} % less position error if halved", budget.name)
    where = f", {known.named(known.budget_case)}" if len(known.labels) > 1 else ""
    yield (Clause("What would help most: "), words, Clause(f" ({budget.title[0].lower()}{budget.title[1:]}{where})."))


def _gain(text: str) -> float:
    return float(text.removesuffix(" %")) if text.endswith(" %") else 0.0


def requirements_under_stress(name: str, known: Background) -> Iterator[Sentence]:
    """Yield which requirements, that the decision judges without stress, the chosen filter misses under one."""
    found = [(where, item) for where, judged in known.under_stress.items() for item in judged]
    if not found:
        return
    parts = []
    for verdict, words in (("fail", "misses"), ("undecided", "is undecided for")):
        said = [_under(where, item) for where, item in found if item.verdict == verdict]
        left = len(said) - _STRESSES_NAMED
        more = f" and {left} more" if left > 0 else ""
        parts += [f"{words} {'; '.join(said[:_STRESSES_NAMED])}{more}"] if said else []
    under = ", and ".join(parts) or "meets all that are asked of it"
    yield (Clause(f"Requirements are judged without stress. Under stress {name} {under}."),)


def _under(where: str, item: Judgement) -> str:
    value = value_in_words(item)
    return f"{item.name} ({where}{f': {value}' if value else ''})"


def not_shown(decision: Decision, known: Background) -> Iterator[Sentence]:
    """Yield what the decision does not rest on."""
    parts: list[list[Clause]] = []
    if known.waiting:
        parts.append([Clause(f"{listed(known.waiting)} (no run yet)")])
    if not known.regrets and not known.replayed:
        parts.append([Clause("flight under truths that filters are not told of (no stressed case was flown)")])
    if known.shared_field:
        parts.append([Clause("consistency in flight (truth and filters share the gravity field, see the summary)")])
    if known.budget is None:
        parts.append([Clause("which source of error dominates (no error budget)")])
    if not known.judged and not known.replayed:
        parts.append([Clause("whether the errors are small enough (the campaign has no requirements)")])
    parts += _may_be_overconfident(decision)
    if parts:
        yield (Clause("Not shown: "), *joined(parts, "; "), Clause("."))


def _may_be_overconfident(decision: Decision) -> list[list[Clause]]:
    name = decision.overall.chosen
    if name is None:
        return []
    case, part, ratio = max(
        (
            (case, part, item.error_over_sigma(part))
            for case, _ in decision.cases
            if (item := case.of(name))
            for part in PARTS
        ),
        key=lambda each: or_zero(each[2], "high"),
    )
    if math.isfinite(ratio.estimate) and ratio.high <= OVERCONFIDENT:
        return []
    size = f"{significant(ratio.estimate)}{between(ratio.low, ratio.high)}" if math.isfinite(ratio.estimate) else "none"
    words = at_row(case, name, f"{PARTS[part]}error / formal sigma {size}")
    return [[Clause(f"that {name} is not overconfident ("), words, Clause(f", limit {OVERCONFIDENT:g})")]]


def overconfident(decision: Decision, name: str, known: Background) -> Iterator[Sentence]:
    """Yield that the chosen filter is overconfident, though not so far that it is refused."""
    found = [(case, item) for case, _ in decision.cases if (item := case.of(name)) and item.overconfident]
    if not found:
        return
    case, worst = max(found, key=lambda each: or_zero(largest_error(each[1])))
    where = in_which(decision, [each for each, _ in found], case, known)
    yield (Clause(f"{name} is overconfident: "), at_row(case, name, f"{errors_over_sigma(worst)}{where}"), Clause("."))


def in_which(decision: Decision, found: Sequence[CaseEvidence], worst: CaseEvidence, known: Background) -> str:
    """Return in which of several cases a filter is refused for a reason; nothing where it is in all."""
    if len(found) in (0, len(decision.cases)):
        return ""
    if len(found) == 1:
        return f", {known.named(worst.index)}"
    return f", in {len(found)} of {len(decision.cases)} cases"


def or_zero(one: Interval, end: str = "estimate") -> float:
    """Return an end or the estimate of an interval, 0 where it is not known."""
    value = float(getattr(one, end))
    return value if math.isfinite(value) else 0.0


def at_row(case: CaseEvidence, name: str, words: str) -> Clause:
    """Return a clause that links to the row of a filter in a case."""
    place = [item.name for item in case.candidates].index(name)
    return Clause(words, "decision", decision_anchor(case.index, place))
