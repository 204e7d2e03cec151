"""The filters of a case in pairs: by how much they differ, and whether that is decided."""

from __future__ import annotations

from relnav_sim.report.metrics import POSITION_RMS, VELOCITY_RMS, numbers
from relnav_sim.report.ranking import Pair, Ranking
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.intervals import Comparison, Interval, fewest_runs_to_decide
from relnav_sim.wording import counted

_MANY_RUNS = 100_000

DECIDED_AT = (
    "Decided at: runs at which a difference of this size, whether or not it matters, would be significant with a "
    "probability of 0.8."
)


def comparison_table(ranking: Ranking) -> Table:
    """Return every pair of filters of a case: by how much they differ, whether that is decided, how many runs would."""
    velocity = {(pair.first, pair.second): pair for pair in ranking.velocity}
    velocity |= {(pair.second, pair.first): pair for pair in ranking.velocity}
    rows = [
        Row(
            f"{pair.first} against {pair.second}",
            (*_pair_cells(pair, "m"), *_pair_cells(velocity.get((pair.first, pair.second)), "m/s", pair.first)),
        )
        for pair in ranking.position
    ]
    columns = [
        Column(label, group, numeric, opens_group=label == "difference")
        for group in (POSITION_RMS.heading, VELOCITY_RMS.heading)
        for label, numeric in (
            ("difference", True),
            ("%", True),
            ("verdict", False),
            ("p", True),
            ("decided at", False),
        )
    ]
    case = ranking.case
    return Table(
        name=f"case_{case.index:03d}_comparison",
        title=f"Comparison of filters ({case.when})",
        caption="First minus second on their common runs: mean over runs with its 95 % interval. The verdict is the "
        "first's. Verdicts, intervals and p (sign-flip test, after Holm) hold at 95 % for all pairs of the case "
        f"together: zero lies in an interval where the verdict is undecided. {DECIDED_AT} "
        f"{fewest_in_words(len(ranking.position), 'pair')}",
        corner="filters",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def _pair_cells(pair: Pair | None, unit: str, first: str = "") -> tuple[Cell, ...]:
    """Return difference, percent, verdict, p and runs; turned round where the pair's first is not the row's."""
    if pair is None:
        return (Words("no common run", span=5),)
    sign = -1.0 if first and pair.first != first else 1.0
    found, comparison = pair.comparison.difference, pair.comparison
    turned = {"better": "worse", "worse": "better"} if sign < 0 else {}
    verdict = verdict_in_words(comparison)
    shown = numbers([_turned(found, sign)])[0]
    percent = numbers([_turned(pair.percent, sign)])[0]
    p_value = p_number(comparison.p_value)
    return shown, percent, Words(turned.get(verdict, verdict)), p_value, Words(decided_at(comparison))


def _turned(found: Interval, sign: float) -> Interval:
    if sign > 0:
        return found
    return Interval(-found.estimate, -found.high, -found.low, found.level, found.runs)


def fewest_in_words(comparisons: int, noun: str) -> str:
    """Return how many runs a family of comparisons needs at least."""
    return f"{counted(comparisons, noun)}: it takes {fewest_runs_to_decide(comparisons)} runs or more to decide any."


def p_number(p_value: float) -> Number:
    """Return a p-value with as many decimals as it needs."""
    return Number(p_value, decimals=3 if p_value >= 0.0005 else 6)


def verdict_in_words(comparison: Comparison) -> str:
    """Return the verdict; ``equal`` where the two have the same figure in every run."""
    return "equal" if _equal_in_all(comparison) else comparison.verdict


def decided_at(comparison: Comparison) -> str:
    """Return at how many runs a comparison is decided, or would be."""
    runs, needed = comparison.difference.runs, comparison.runs_to_decide
    if comparison.verdict != "undecided":
        return f"{runs} runs, decided"
    if _equal_in_all(comparison):
        return f"equal in all {runs} runs"
    if needed is None:
        return "no number of runs"
    if needed > _MANY_RUNS:
        return f"more than {_MANY_RUNS} runs"
    return f"about {float(f'{needed:.2g}'):.0f} runs" if needed > runs else f"a few more than {runs} runs"


def _equal_in_all(comparison: Comparison) -> bool:
    difference = comparison.difference
    return difference.low == difference.estimate == difference.high == 0
