"""What would be flown in each case, where that is not the same in all; of many cases in groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from relnav_sim.report.decision_table import MOST_CASES, NO_DIFFERENCE_THAT_MATTERS
from relnav_sim.report.reservations import at_row
from relnav_sim.report.sentences import Clause, Sentence, joined
from relnav_sim.results.case_names import case_in_tables, case_in_words
from relnav_sim.statistics.decision import CaseEvidence, Choice, Decision
from relnav_sim.wording import counted, listed, significant

_NAMED = 3
"""Cases of a group that are named."""


def case_by_case(decision: Decision, labels: Mapping[int, str]) -> Iterator[Sentence]:
    """Yield what would be flown in each case; nothing of one case, or where it is the same in all.

    Args:
        decision: The decision.
        labels: The labels of its cases, by their numbers.
    """
    if len(decision.cases) < 2 or len({_flown(decision, choice) for _, choice in decision.cases}) == 1:
        return
    if len(decision.cases) > MOST_CASES:
        groups = joined(_groups(decision, labels), "; ")
        yield (Clause(f"Case by case, of {counted(len(decision.cases), 'case')}: "), *groups, Clause("."))
        return
    words = [
        [Clause(f"{case_in_words(case.index, labels[case.index])} "), *_in_one_case(case, choice)]
        for case, choice in decision.cases
    ]
    yield (Clause("Case by case: "), *joined(words, "; "), Clause("."))


def _flown(decision: Decision, choice: Choice) -> str | None:
    """Return the filter to fly in a case: that of all cases where nothing that matters is better."""
    overall = decision.overall.chosen
    return overall if overall in (choice.chosen, *choice.with_effect("equivalent")) else choice.chosen


def _groups(decision: Decision, labels: Mapping[int, str]) -> Iterator[list[Clause]]:
    """Yield each filter with the number of cases that it is the choice of and the names of the first."""
    groups: dict[str | None, list[CaseEvidence]] = {}
    for case, choice in decision.cases:
        groups.setdefault(_flown(decision, choice), []).append(case)
    for name, cases in sorted(groups.items(), key=lambda each: -len(each[1])):
        what = Clause("no acceptable filter") if name is None else at_row(cases[0], name, name)
        named = [case_in_tables(case.index, labels[case.index]) for case in cases[:_NAMED]]
        more = f" and {len(cases) - _NAMED} more" if len(cases) > _NAMED else ""
        yield [what, Clause(f" in {len(cases)} ({'; '.join(named)}{more})")]


def _in_one_case(case: CaseEvidence, choice: Choice) -> list[Clause]:
    if choice.chosen is None:
        return [Clause("no acceptable filter")]
    names = listed([choice.chosen, *choice.with_effect("equivalent")])
    undecided = choice.with_effect("undecided")
    item = case.of(choice.chosen)
    size = f" {significant(item.position.estimate)} m" if item is not None else ""
    words = choice.chosen if names == choice.chosen else f"{NO_DIFFERENCE_THAT_MATTERS} between {names},"
    said = [at_row(case, choice.chosen, f"{words}{size}")]
    return [*said, Clause(f" (undecided against {listed(undecided)})")] if undecided else said
