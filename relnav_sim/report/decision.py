"""The decision in words: which filter to fly, how sure that is, and what is not shown; each number a link."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from relnav_sim.report.decision_table import (
    MOST_CASES,
    NO_DIFFERENCE_THAT_MATTERS,
    decision_table,
    refusal_in_words,
)
from relnav_sim.report.page import DecisionSection
from relnav_sim.report.regret import regret_anchor
from relnav_sim.report.requirements import margin_in_words, requirement_anchor
from relnav_sim.report.reservations import Background, at_row, not_shown, or_zero, what_would_help
from relnav_sim.report.sentences import Clause, Sentence, joined, plain
from relnav_sim.report.tables import Table
from relnav_sim.statistics.decision import CaseEvidence, Choice, Decision
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.regret import Regret
from relnav_sim.statistics.requirements import Judgement, overall
from relnav_sim.wording import between, counted, listed, significant

_MANY_RUNS = 100_000
_MANY_FILTERS = 6


def decision_section(decision: Decision, known: Background) -> DecisionSection:
    """Return the decision as a section of the page, its lead first."""
    choice = decision.overall
    others: list[Sentence] = []
    if choice.chosen is not None:
        others += [*_others(decision), *_regret(choice.chosen, known.regrets), *_lost(choice.chosen, known.regrets)]
    others += [
        *_refused(decision, known.judged),
        *_case_by_case(decision, known.labels),
        *what_would_help(known.budget),
    ]
    others += not_shown(decision, known)
    lead, enough = _lead(decision, known.judged), not (_one_run(decision) or _too_few(decision))
    table = decision_table(decision, known.labels, known.over, enough)
    shown = table if len(decision.cases) <= MOST_CASES else _cited_rows(table, (lead, *others))
    return DecisionSection(lead, tuple(others), table, shown)


def _cited_rows(table: Table, sentences: Sequence[Sentence]) -> Table:
    """Return the rows of a table that sentences link to, to keep a page of many cases small."""
    cited = {clause.row for sentence in sentences for clause in sentence}
    rows = [replace(row, label=row.record, opens_block=False) for row in table.rows if row.anchor in cited]
    return replace(
        table,
        caption=f"{table.caption} Only rows that sentences above cite; all: tables/decision.csv.",
        rows=tuple(rows),
    )


def _lead(decision: Decision, judged: Sequence[Judgement]) -> Sentence:
    choice = decision.overall
    if choice.chosen is None:
        return _none_acceptable(decision, judged)
    if needed := _too_few(decision):
        return (Clause(f"No decision yet: {needed}"),)
    name = choice.chosen
    if _one_run(decision):
        return (Clause(f"No decision yet: one run decides nothing. {name}: "), *_achieves(decision, name), Clause("."))
    alike, undecided = choice.with_effect("equivalent"), choice.with_effect("undecided")
    said = [Clause(f"Fly {name}")]
    if alike:
        every = len(alike) == len(choice.effects) and not choice.refusals and not choice.set_aside
        rest = "any of them" if every else f"{listed([name, *alike]).replace(' and ', ' or ')}"
        margin = f"within ±{decision.margin_percent:g} %"
        said = [
            Clause(f"{NO_DIFFERENCE_THAT_MATTERS.capitalize()} between {listed([name, *alike])} ("),
            _to_row(decision, alike[0], margin),
            Clause(f"): fly {rest}. {name}"),
        ]
    if undecided:
        said += [Clause(f" (undecided against {listed(undecided)}, see below)")]
    return (*said, Clause(": "), *_achieves(decision, name), *_requirements(name, judged), Clause("."))


def _achieves(decision: Decision, name: str) -> Iterator[Clause]:
    """Yield the position and velocity RMS of a filter; over several cases the least and the largest."""
    found = [(case, item) for case, _ in decision.cases if (item := case.of(name))]
    if len(found) == 1:
        (case, item), *_ = found
        size = f"{significant(item.position.estimate)} m{between(item.position.low, item.position.high)}"
        yield at_row(case, name, f"position RMS {size}")
        yield Clause(f", velocity RMS {significant(item.velocity.estimate)} m/s")
        return
    sizes = sorted(((item.position.estimate, case) for case, item in found), key=lambda each: each[0])
    (least, where_least), (most, where_most) = sizes[0], sizes[-1]
    yield Clause("position RMS ")
    yield at_row(where_least, name, f"{significant(least)} m")
    yield Clause(" to ")
    yield at_row(where_most, name, f"{significant(most)} m")
    yield Clause(f" over {counted(len(found), 'case')}")
    index, above = decision.worst[name]
    if above >= decision.margin_percent:
        case = next(case for case, _ in decision.cases if case.index == index)
        yield Clause(", at most ")
        yield at_row(case, name, f"{significant(above)} % above the best of a case (case {index})")


def _requirements(name: str, judged: Sequence[Judgement]) -> Iterator[Clause]:
    """Yield a clause for each requirement: met with its smallest margin, or undecided at how many runs."""
    for wanted in dict.fromkeys(item.name for item in judged):
        mine = [(place, item) for place, item in enumerate(judged) if item.name == wanted and item.filter == name]
        if not mine:
            continue
        verdict = overall([item.verdict for _, item in mine])
        place, item = next((place, item) for place, item in mine if item.verdict == verdict)
        if verdict == "undecided":
            runs = counted(item.finding.figure.runs, "run") if item.finding else item.basis
            words = f"requirement {wanted} undecided at {runs}"
        else:
            margins = [words for _, each in mine if (words := margin_in_words(each))]
            only = len(mine) == 1 and margins
            words = (
                f"requirement {wanted} met{f' ({margins[0]})' if only else ' in every case' if len(mine) > 1 else ''}"
            )
        yield Clause("; ")
        yield Clause(words, "requirements", requirement_anchor(place))


def _others(decision: Decision) -> Iterator[Sentence]:
    """Yield the runner-up with what it loses, the others, and what is undecided."""
    choice = decision.overall
    worse = choice.with_effect("worse")
    if worse:
        loses = [[Clause(f"{name} loses "), _loss(decision, name)] for name in worse[:_MANY_FILTERS]]
        loses[0][0] = Clause(f"Runner-up {worse[0]} loses ")
        left = len(worse) - _MANY_FILTERS
        end = f"; {counted(left, 'more filter')} lose more." if left > 0 else "."
        yield (*joined(loses, ", "), Clause(end))
    if undecided := choice.with_effect("undecided", "better"):
        parts = [[Clause(f"{name} "), _loss(decision, name)] for name in undecided]
        runs = max(
            (found.percent.runs for name in undecided if (found := _worst_difference(decision, name))), default=0
        )
        needed = [_needed(decision, name) for name in undecided]
        more = max((one for one in needed if one is not None), default=0)
        end = f"; about {float(f'{more:.2g}'):.0f} runs would decide" if runs < more < _MANY_RUNS else ""
        yield (Clause(f"Undecided at {counted(runs, 'run')}: "), *joined(parts, ", "), Clause(f"{end}."))
    if choice.set_aside:
        yield (
            Clause(f"Not compared: {listed(choice.set_aside)}, for which a "),
            Clause("requirement is undecided", "requirements"),
            Clause(" that others meet."),
        )


def _loss(decision: Decision, name: str) -> Clause:
    """Return the difference of a filter from the chosen one, over several cases where it is largest."""
    case, found = _worst_place(decision, name)
    if found is None:
        return Clause("has no run in common with it")
    one = found.shown(decision.margin_percent)
    if one.estimate >= 300:
        words = f"(position RMS {significant(1 + one.estimate / 100)} times as large)"
    else:
        words = f"{significant(one.estimate)} %{between(one.low, one.high)}"
    where = f" (case {case.index})" if len(decision.cases) > 1 else ""
    return at_row(case, name, f"{words}{where}")


def _needed(decision: Decision, name: str) -> int | None:
    found = _worst_difference(decision, name)
    return None if found is None else found.runs_to_decide(decision.margin_percent)


def _worst_difference(decision: Decision, name: str) -> Difference | None:
    return _worst_place(decision, name)[1]


def _worst_place(decision: Decision, name: str) -> tuple[CaseEvidence, Difference | None]:
    """Return the case in which a filter lies farthest above the chosen one, and by how much."""
    best = decision.overall.chosen or ""
    found = [(case, case.difference(name, best)) for case, _ in decision.cases]
    known = [(case, one) for case, one in found if one is not None and math.isfinite(one.percent.estimate)]
    return max(known, key=lambda each: each[1].percent.estimate) if known else found[0]


def _regret(name: str, regrets: Mapping[int, Regret]) -> Iterator[Sentence]:
    """Yield the worst regret of the chosen filter under the stresses, and the minimax filter where it is another."""
    worst: list[tuple[float, int, Regret]] = []
    for index, found in regrets.items():
        if name in found.filters:
            worst.append((found.worst[found.filters.index(name)].estimate, index, found))
    known = [each for each in worst if not math.isnan(each[0])]
    if not known:
        return
    size, index, found = max(known, key=lambda each: each[0])
    row = found.filters.index(name)
    own, table = found.worst[row], f"case_{index:03d}_regret"
    under = found.worst_case(name)
    if math.isinf(size):
        words = Clause(f"infinite (it fails under {under})", table, regret_anchor(index, row))
    else:
        percent = f"{significant(100 * size, 2)} %{between(100 * own.low, 100 * own.high)}"
        words = Clause(f"{percent} ({under})", table, regret_anchor(index, row))
    said = [Clause(f"Worst regret of {name} under stress: "), words]
    minimax = found.minimax
    if minimax is not None and minimax != name:
        other = found.worst[found.filters.index(minimax)]
        decided = "" if name not in found.undecided else ", no significant difference"
        anchor = regret_anchor(index, found.filters.index(minimax))
        said += [Clause("; least for "), Clause(f"{minimax}, {significant(100 * other.estimate, 2)} %", table, anchor)]
        said += [Clause(decided)]
    yield (*said, Clause("."))


def _lost(name: str, regrets: Mapping[int, Regret]) -> Iterator[Sentence]:
    """Yield the stresses under which runs of the chosen filter fail or diverge: a small regret does not show them."""
    parts: list[list[Clause]] = []
    for index, found in regrets.items():
        if name not in found.filters:
            continue
        row = found.filters.index(name)
        for place, under in list(enumerate(found.cases))[1:]:
            counts = (("failed", found.failed[row, place]), ("diverged", found.diverged[row, place]))
            lost = " and ".join(f"{how} in {count}" for how, count in counts if count)
            if lost:
                words = f"{lost} of {counted(len(found.runs), 'run')}"
                parts.append([Clause(words, f"case_{index:03d}_stressed_rms")])
                parts[-1].append(Clause(f" ({under}{f', case {index}' if len(regrets) > 1 else ''})"))
    left = len(parts) - _MANY_FILTERS
    if parts:
        more = f" and under {left} more" if left > 0 else ""
        yield (Clause(f"Under stress {name} "), *joined(parts[:_MANY_FILTERS], ", "), Clause(f"{more}."))


def _refused(decision: Decision, judged: Sequence[Judgement]) -> Iterator[Sentence]:
    """Yield why filters are not recommended, the most accurate first."""
    refusals = decision.overall.refusals
    if not refusals or decision.overall.chosen is None:
        return
    first = decision.overall.most_accurate
    names = sorted(refusals, key=lambda name: name != first)
    note = f"; {first} has the smallest position RMS" if first in refusals else ""
    yield (Clause("Not recommended: "), *_grouped(decision, names, judged), Clause(f"{note}."))


def _grouped(decision: Decision, names: Sequence[str], judged: Sequence[Judgement]) -> list[Clause]:
    """Return filters with why they are refused, those that share their reasons together."""
    groups: dict[str, tuple[list[str], list[Clause]]] = {}
    for name in names:
        reasons = _reasons(decision, name, judged)
        groups.setdefault(plain(reasons), ([], reasons))[0].append(name)
    parts = [[Clause(f"{listed(alike)} ("), *reasons, Clause(")")] for alike, reasons in groups.values()]
    left = len(parts) - _MANY_FILTERS
    return [*joined(parts[:_MANY_FILTERS], ", "), *([Clause(f" and {left} more")] if left > 0 else [])]


def _reasons(decision: Decision, name: str, judged: Sequence[Judgement]) -> list[Clause]:
    """Return the reasons against a filter, each a link to the row that shows it."""
    cases = [(case, item) for case, choice in decision.cases if (item := case.of(name))]
    if not cases:
        return [Clause("no run yet")]
    runs = sum(item.runs for _, item in cases)
    worst_case, worst = max(cases, key=lambda each: or_zero(each[1].error_over_sigma))
    parts = []
    refusals = decision.overall.refusals[name]
    lost = any(refusal.reason == "diverged" for refusal in refusals)
    for refusal in refusals:
        if lost and refusal.reason == "overconfident":
            continue  # the same finding: it diverged by its own covariance
        where = next((case for case, choice in decision.cases if _has(choice, name, refusal.reason)), worst_case)
        words = refusal_in_words(refusal, runs, worst.error_over_sigma)
        if refusal.reason == "requirement":
            missed = [(item.name, item.filter, item.verdict) == (refusal.what, name, "fail") for item in judged]
            parts.append([Clause(words, "requirements", requirement_anchor(missed.index(True)))])
            continue
        parts.append([at_row(worst_case if refusal.reason == "overconfident" else where, name, words)])
    return joined(parts, "; ")


def _has(choice: Choice, name: str, reason: str) -> bool:
    return any(refusal.reason == reason for refusal in choice.refusals.get(name, ()))


def _none_acceptable(decision: Decision, judged: Sequence[Judgement]) -> Sentence:
    cases = " for all cases" if len(decision.cases) > 1 else ""
    reasons = _grouped(decision, list(decision.overall.refusals), judged)
    return (Clause(f"No filter can be recommended{cases}: "), *reasons, Clause("."))


def _case_by_case(decision: Decision, labels: Sequence[str]) -> Iterator[Sentence]:
    """Yield what would be flown in each case, where that is not the same in all; of many cases the counts."""
    if len(decision.cases) < 2:
        return
    overall = decision.overall.chosen
    other = [choice.chosen for _, choice in decision.cases if overall not in _as_good(choice)]
    if not other and len({choice.chosen for _, choice in decision.cases}) == 1:
        return
    count = len(decision.cases)
    if count > MOST_CASES:
        parts = [f"{name or 'none'} in {other.count(name)}" for name in dict.fromkeys(other)]
        if overall is not None:
            same = f"{overall} is the choice, or differs from it by nothing that matters, in {count - len(other)}"
            parts.insert(0, same)
        yield (Clause(f"Case by case: {'; '.join(parts)} of {count} cases."),)
        return
    words = [
        [Clause(f"case {case.index} ({label}) "), *_in_one_case(case, choice)]
        for (case, choice), label in zip(decision.cases, labels, strict=True)
    ]
    yield (Clause("Case by case: "), *joined(words, "; "), Clause("."))


def _as_good(choice: Choice) -> tuple[str | None, ...]:
    return choice.chosen, *choice.with_effect("equivalent")


def _in_one_case(case: CaseEvidence, choice: Choice) -> list[Clause]:
    if choice.chosen is None:
        return [Clause("none")]
    names = listed([choice.chosen, *choice.with_effect("equivalent")])
    undecided = choice.with_effect("undecided")
    item = case.of(choice.chosen)
    size = f" {significant(item.position.estimate)} m" if item is not None else ""
    words = choice.chosen if names == choice.chosen else f"{NO_DIFFERENCE_THAT_MATTERS} between {names},"
    said = [at_row(case, choice.chosen, f"{words}{size}")]
    return [*said, Clause(f" (undecided against {listed(undecided)})")] if undecided else said


def _one_run(decision: Decision) -> bool:
    """Return whether the chosen filter has a single run, and none to compare it with."""
    choice = decision.overall
    found = [item for case, _ in decision.cases if (item := case.of(choice.chosen or ""))]
    return bool(found) and not choice.effects and all(item.runs < 2 for item in found)


def _too_few(decision: Decision) -> str:
    """Return that the runs are too few for any interval of a difference; nothing where they are not."""
    effects, best = decision.overall.effects, decision.overall.chosen
    found = [case.difference(name, best or "") for case, _ in decision.cases for name in effects]
    if not found or any(one is not None and math.isfinite(one.percent.low) for one in found):
        return ""
    runs = max((one.percent.runs for one in found if one is not None), default=0)
    sizes = [
        f"{item.name} {significant(item.position.estimate)} m"
        for item in decision.cases[0][0].candidates
        if item.name in (best, *effects)
    ]
    first = f"position RMS of case {decision.cases[0][0].index}" if len(decision.cases) > 1 else "position RMS"
    runs_said = counted(runs, "run")
    return (
        f"{runs_said} in common can't decide between {counted(len(effects) + 1, 'filter')} ({first}: {listed(sizes)})."
    )


def _to_row(decision: Decision, name: str, words: str) -> Clause:
    return at_row(_worst_place(decision, name)[0], name, words)
