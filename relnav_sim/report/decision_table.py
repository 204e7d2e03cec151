"""What the decision goes by: a row for each filter of each case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from relnav_sim.report.consistency import PARTS
from relnav_sim.report.metrics import numbers
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.results.case_names import case_in_tables
from relnav_sim.statistics.decision import OVERCONFIDENT, Candidate, CaseEvidence, Choice, Decision, Refusal
from relnav_sim.statistics.equivalence import Effect
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval
from relnav_sim.wording import counted, listed, significant

MOST_CASES = 6
"""Of more cases the table is in the files only."""

NO_DIFFERENCE_THAT_MATTERS = "no difference that matters"
_EFFECTS: Mapping[Effect, str] = {
    "equivalent": NO_DIFFERENCE_THAT_MATTERS,
    "undecided": "undecided",
    "worse": "worse",
    "better": "better",
}


def decision_table(decision: Decision, labels: Mapping[int, str], over: str, enough: bool = True) -> Table:
    """Return the table of a decision.

    Args:
        decision: The decision.
        labels: The labels of the cases that it is about, by their numbers.
        over: The span of the figures, in words.
        enough: Whether the runs are enough for a decision; else no filter is called chosen.
    """
    rows = []
    many = len(decision.cases) > 1
    for case, choice in decision.cases:
        against = _reference(decision, case, choice)
        heading = case_in_tables(case.index, labels[case.index])
        for place, row in enumerate(_case_rows(case, choice, against, decision.margin_percent, enough)):
            cells = (Words(row.label), *row.cells) if many else row.cells
            name = (heading if not place else f"{case.index}") if many else row.label
            rows.append(
                replace(
                    row,
                    label=name,
                    cells=cells,
                    key=str(case.index),
                    opens_block=many and not place,
                    record=heading if many else "",
                    anchor=decision_anchor(case.index, place),
                )
            )
    columns = [
        Column("position RMS [m]"),
        Column("above the chosen [%]"),
        *(Column(f"{of}error / formal sigma") for of in PARTS.values()),
        Column("what follows", numeric=False),
    ]
    return Table(
        name="decision",
        title="What the decision goes by",
        caption=f"Over {over}. Above the chosen: difference in position RMS from the filter chosen (for all cases "
        "together, where one is), on the same runs; the verdicts of a case hold at 95 % for all its pairs together, "
        "and zero lies in the interval exactly where the test is undecided. "
        f"{NO_DIFFERENCE_THAT_MATTERS.capitalize()}: even the interval that holds for all pairs together, as wide or "
        f"wider, lies within ±{decision.margin_percent:g} % (statistics.matters_percent). Error / formal sigma: root "
        f"of the ANEES, 1 for a consistent filter; no filter is recommended whose whole state is above "
        f"{OVERCONFIDENT:g}, or whose position or velocity is and surely is above 1.",
        corner="case" if many else "filter",
        columns=(*([Column("filter", numeric=False)] if many else []), *columns),
        rows=tuple(rows),
        stacks=True,
    )


def decision_anchor(index: int, place: int) -> str:
    """Return the id of a row of `decision_table`: of a case, its number from 0, and of a filter's place in it."""
    return f"decision-{index}-{place}"


def refusal_in_words(refusal: Refusal, runs: int, worst: Candidate) -> str:
    """Return why a filter is not recommended.

    Args:
        refusal: The reason.
        runs: Number of the filter's runs.
        worst: The filter in the case in which its errors are largest in units of its formal sigma.
    """
    match refusal.reason:
        case "not observable":
            return "its sensors cannot observe the state"
        case "known later":
            return f"its estimates are known only later ({refusal.what})"
        case "no run":
            return "has no completed run in some case"
        case "failed" | "diverged":
            return f"{refusal.reason} in {refusal.count} of {counted(runs, 'run')}"
        case "requirement":
            return f"misses requirement {refusal.what}"
        case "overconfident":
            return f"overconfident: {errors_over_sigma(worst)} (limit {OVERCONFIDENT:g})"


def not_asked_in_words(names: Sequence[str]) -> str:
    """Return that a filter was not asked to meet some requirements."""
    return f"requirement{'s' if len(names) > 1 else ''} {listed(names)} not asked of it"


def errors_over_sigma(item: Candidate) -> str:
    """Return how large a filter's errors are in units of its formal sigma, and those of which part of the state."""
    return f"{PARTS[item.most_overconfident]}errors {significant(largest_error(item).estimate)} times the formal sigma"


def largest_error(item: Candidate) -> Interval:
    """Return a filter's errors in units of its formal sigma, of the part of the state that speaks most against it."""
    return item.error_over_sigma(item.most_overconfident)


def _reference(decision: Decision, case: CaseEvidence, choice: Choice) -> str | None:
    overall = decision.overall.chosen
    return overall if overall is not None and case.of(overall) else choice.chosen


def _case_rows(case: CaseEvidence, choice: Choice, against: str | None, margin: float, enough: bool) -> list[Row]:
    """Return a row for each filter; numbers of one column share their decimals."""
    found = [case.difference(item.name, against) if against else None for item in case.candidates]
    sizes = numbers([item.position for item in case.candidates])
    above = numbers([NO_INTERVAL if one is None else one.percent for one in found])
    ratios = zip(*(numbers([item.error_over_sigma(part) for item in case.candidates]) for part in PARTS), strict=True)
    rows = []
    for item, size, percent, of_parts, one in zip(case.candidates, sizes, above, ratios, found, strict=True):
        effect = None if one is None else one.effect(margin)
        follows = _follows(item, choice, against, effect)
        second: Cell = percent
        if item.name == against:
            second = Words("chosen", 0.0, mark="best") if enough else Words("reference", 0.0)
            follows = follows if enough else Words("acceptable")
        rows.append(Row(item.name, (size, second, *of_parts, follows)))
    return rows


def _follows(item: Candidate, choice: Choice, against: str | None, effect: Effect | None) -> Words:
    refusals = choice.refusals.get(item.name)
    if refusals:
        words = "; ".join(refusal_in_words(one, item.runs, item) for one in refusals)
        return Words(f"refused: {words}", mark="failed")
    untold = f"; {not_asked_in_words(item.not_asked)}" if item.not_asked else ""
    if item.name == against:
        return Words(f"acceptable, chosen{untold}", mark="" if untold else "best")
    if item.name in choice.set_aside:
        return Words(untold.removeprefix("; ") or "a requirement is undecided")
    words = "no run in common" if effect is None else _EFFECTS[effect]
    return Words(f"{words}{untold}", mark="best" if effect == "equivalent" and not untold else "")
