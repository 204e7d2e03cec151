"""What a case says beyond its errors: comparison, consistency, convergence, spread, reliability, diagnostics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from relnav_sim.plots.axes import Array
from relnav_sim.plots.facts import CaseFacts, FilterFacts, span_index
from relnav_sim.report.extra_table import extra_table
from relnav_sim.report.layouts import INTERVALS, NOT_JUDGED, not_judged, numbers, ratio_cells, worst_runs_table
from relnav_sim.report.ranking import Pair, Ranking
from relnav_sim.report.tables import MISSING, Cell, Column, Number, Row, Table, Words
from relnav_sim.report.wording import counted, figure, listed
from relnav_sim.results import layout
from relnav_sim.statistics.convergence import RELATIVE_CONVERGENCE
from relnav_sim.statistics.intervals import (
    Band,
    Comparison,
    Interval,
    chi_square_band,
    effective_samples,
    fewest_runs_to_decide,
    lag1_band,
    mean_interval,
    median_interval,
    wilson_interval,
)

MEASURED = 3
"""Components of a radar measurement, polar or converted: the mean of the NIS of a consistent filter."""
_MANY_RUNS = 100_000
_KNOWN = {
    "rejected": "measurements that the gate refused (share)",
    "ess": "effective sample size",
    "resampled": "updates that resampled (share)",
    "alpha": "alpha in use",
    "nis_tempered": "NIS with the tempered noise R / alpha",
    "accepted": "moves accepted (share)",
    "stages": "tempering stages",
    "outlier_probability": "probability of an outlier",
    "lowest_weight": "lowest weight of the mixture",
}

Figure = Callable[[FilterFacts], Interval]


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
        for group in ("position RMS [m]", "velocity RMS [m/s]")
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
        name=f"case_{case.number:03d}_comparison",
        title=f"Comparison of filters ({case.when})",
        caption="First minus second on their common runs: mean over runs with its 95 % interval. The verdict is the "
        "first's. Verdicts, intervals and p (sign-flip test, after Holm) hold at 95 % for all pairs of the case "
        "together: zero lies in an interval where the verdict is undecided. Decided at: runs at which a difference of "
        "this size would be told apart with a probability of 0.8. "
        f"{fewest_in_words(len(ranking.position), 'pair')}",
        corner="filters",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def consistency_table(case: CaseFacts) -> Table:
    """Return whether the errors and innovations of each filter match its covariances."""
    span = span_index(case.span)
    rows = [
        *_bound_rows(case),
        _row(case, "ANEES, whole state", lambda item: _mean(item.figure("anees", span, 0)), opens=True),
        _bands(case, "95 % band if consistent", lambda item: _anees_band(case, item)),
        _row(case, "ANEES, position", lambda item: _mean(item.figure("anees", span, 1))),
        _row(case, "ANEES, velocity", lambda item: _mean(item.figure("anees", span, 2))),
        _row(case, "mean NIS", lambda item: _mean(item.figure("nis_mean", span)), opens=True),
        _bands(case, "95 % band if consistent", lambda item: _nis_band(item, span)),
        _row(case, "NIS, autocorrelation at lag 1", lambda item: _mean(item.figure("nis_lag1", span))),
        _bands(case, "95 % band if white", lambda item: _lag_band(item, span)),
    ]
    for block, name in enumerate(("whole state", "position", "velocity")):
        for level, probability in enumerate(layout.LEVELS[:4]):
            label = f"inside the {100 * probability:g} % ellipsoid, {name}"
            part = _percent_of(span, block, level)
            rows.append(_row(case, label, part, "%", opens=level == 0))
    return _table(
        case,
        "consistency",
        f"Consistency ({case.when})",
        f"{INTERVALS} RMS / bound: of the error and of the Cramér-Rao bound over all runs and stored epochs; at the "
        "bound of its own model a filter is as good as it expects to be. ANEES: 1 for a consistent filter; its band "
        "counts the epochs as as many independent ones as the correlation of the NEES leaves. NIS: the dimension of "
        "the measurement, 3, and no correlation between updates. Ellipsoids: as many percent of the epochs as they are "
        "named for."
        f"{no_band_note(case)}",
        rows,
    )


def no_band_note(case: CaseFacts) -> str:
    """Return why filters that assume a mixture have no band of the NIS; nothing where all have one."""
    names = [item.name for item in case.filters if not item.nis_is_chi_square]
    if not names:
        return ""
    return (
        f" {listed(names)}: noise assumed as a mixture, so the mean NIS is the dimension where the model is right, but "
        "there is no chi-square band; judge by the interval of the mean over runs."
    )


def convergence_table(case: CaseFacts) -> Table:
    """Return when each filter's position error became small, by several definitions."""
    held = f"for {case.hold_s:g} s"
    named = (
        (f"below {case.convergence_m:g} m {held}", "convergence"),
        (f"below {case.convergence_m:g} m to the end", "convergence_final"),
        (f"below {RELATIVE_CONVERGENCE:g} times the settled RMS {held}", "convergence_relative"),
    )
    rows = []
    for label, name in named:
        if name != "convergence_final" and not case.shows_convergence:
            rows.append(Row(label, (Words(NOT_JUDGED),) * len(case.filters)))
            continue
        rows.append(_row(case, label, _median_time(name), "s"))
        reached = [int(np.isfinite(item.figure(name)).sum()) for item in case.filters]
        cells = tuple(_rate(count, item.completed) for count, item in zip(reached, case.filters, strict=True))
        rows.append(Row("… reached by", cells, "% of runs"))
    for place, threshold in enumerate(layout.THRESHOLDS_M if case.shows_convergence else ()):
        time = _median_time("convergence_level", place)
        rows.append(_row(case, f"below {threshold:g} m {held}", time, "s", opens=place == 0))
    return _table(
        case,
        "convergence",
        "Convergence of the position error",
        "First time from which the position error stays below a size: median over the completed runs, ∞ where fewer "
        "than half of them get there, with its exact 95 % interval. Shares of runs with their Wilson interval."
        f"{'' if case.shows_convergence else ' ' + not_judged(case)}",
        rows,
    )


def spread_table(case: CaseFacts) -> Table:
    """Return quantiles and the largest of the errors over time."""
    span = span_index(case.span)
    rows = []
    for norm, (name, unit) in enumerate((("|position|", "m"), ("|velocity|", "m/s"))):
        for i, probability in enumerate(layout.PROBABILITIES):
            word = "median" if probability == 0.5 else f"{100 * probability:g} % quantile"
            rows.append(_row(case, f"{name}, {word}", _quantile(span, norm, i), unit, opens=norm == 1 and i == 0))
        rows.append(_row(case, f"{name}, largest", _largest(span, 6 + norm, np.mean), unit))
        rows.append(_row(case, f"{name}, largest of all runs", _largest(span, 6 + norm, np.max), unit))
    return _table(
        case,
        "spread",
        f"Spread of the errors ({case.when})",
        f"{INTERVALS} Quantiles over the epochs of each run, from counts in bins 1/32 wide.",
        rows,
    )


def reliability_table(case: CaseFacts) -> Table:
    """Return how often each filter failed or diverged, and what it reports of its own working."""
    rows = [
        Row("failed", tuple(_rate(item.failed, len(item.runs)) for item in case.filters), "% of runs"),
        Row(
            "diverged, failures included",
            tuple(_rate(int(item.diverged.sum()), len(item.runs)) for item in case.filters),
            "% of runs",
        ),
    ]
    names = sorted({name for item in case.filters for name in item.diagnostics})
    for place, name in enumerate(names):
        rows.append(_row(case, _KNOWN.get(name, name), _diagnostic(name), opens=place == 0))
    return _table(
        case,
        "reliability",
        "Reliability and diagnostics",
        "Rates with their Wilson interval. Diverged: failed, or beyond the 0.9999 ellipsoid of its own covariance for "
        "more than 5 % of the last half of the run, or, where the result holds a bound, more than ten times the bound "
        "off for 50 s at the stored epochs. Below: what the filters report of their own working, mean over updates.",
        rows,
    )


def _table(case: CaseFacts, what: str, title: str, caption: str, rows: Sequence[Row]) -> Table:
    return Table(
        name=f"case_{case.number:03d}_{what}",
        title=title,
        caption=caption,
        corner="figure",
        columns=tuple(Column(item.name) for item in case.filters),
        rows=tuple(rows),
    )


def _row(case: CaseFacts, label: str, of: Figure, unit: str = "", opens: bool = False) -> Row:
    return Row(label, numbers([of(item) for item in case.filters]), unit, opens_block=opens)


def _bound_rows(case: CaseFacts) -> list[Row]:
    """Return how many times the bounds each filter's position RMS is, as far as the result holds them."""
    named = {
        "perfect model": [item.times_bound[case.span] for item in case.filters],
        "own model": [item.times_own_bound[case.span] for item in case.filters],
    }
    return [
        Row(f"position RMS / bound, {model}", ratio_cells(case, ratios))
        for model, ratios in named.items()
        if any(math.isfinite(ratio.estimate) for ratio in ratios)
    ]


def _bands(case: CaseFacts, label: str, of: Callable[[FilterFacts], Band | None]) -> Row:
    return Row(label, tuple(_band_cell(of(item)) for item in case.filters))


def _band_cell(band: Band | None) -> Cell:
    return Words(MISSING) if band is None else Words(f"[{figure(band.low, 4)}, {figure(band.high, 4)}]")


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


def _mean(values: Array) -> Interval:
    return mean_interval(values)


def _percent_of(span: int, block: int, level: int) -> Figure:
    return lambda item: mean_interval(100 * item.figure("coverage", span, block, level), most=100)


def _quantile(span: int, norm: int, place: int) -> Figure:
    return lambda item: mean_interval(item.figure("quantile", span, norm, place))


def _largest(span: int, quantity: int, over: Callable[[Array], float]) -> Figure:
    def of(item: FilterFacts) -> Interval:
        values = item.figure("max", span, quantity)
        if over is np.mean or not len(values):
            return mean_interval(values)
        return Interval(float(over(values)), math.nan, math.nan, 0.95, len(values))

    return of


def _diagnostic(name: str) -> Figure:
    return lambda item: mean_interval(item.diagnostics.get(name, np.full(len(item.runs), np.nan))[item.ok])


def _median_time(name: str, *place: int) -> Figure:
    def of(item: FilterFacts) -> Interval:
        times = item.figure(name, *place)
        return median_interval(np.where(np.isnan(times), np.inf, times))

    return of


def _rate(count: int, total: int) -> Number:
    if not total:
        return Number(math.nan)
    found = wilson_interval(count, total)
    return Number(100 * found.estimate, 100 * found.low, 100 * found.high, 1, note=f"({count} of {total})")


def _anees_band(case: CaseFacts, item: FilterFacts) -> Band | None:
    if not item.completed or not math.isfinite(item.nees_time_s):
        return None
    start = case.settle_s if case.span == "settled" else case.times_s[0]
    samples = effective_samples(float(case.times_s[-1]) - start, item.nees_time_s)
    return chi_square_band(item.completed, layout.BLOCK_SIZES[0], samples)


def _nis_band(item: FilterFacts, span: int) -> Band | None:
    if not item.nis_is_chi_square:
        return None
    updates = _updates(item, span)
    return chi_square_band(updates, MEASURED, normalised=False) if updates else None


def _lag_band(item: FilterFacts, span: int) -> Band | None:
    updates = _updates(item, span)
    return lag1_band(updates) if updates else None


def _updates(item: FilterFacts, span: int) -> int:
    return int(item.figure("updates", span).sum())


def case_table_makers(ranking: Ranking) -> dict[str, Callable[[], Table | None]]:
    """Return what makes every further table of a case that has runs, by what it is about; None: nothing to show."""
    case = ranking.case
    comparison = {"comparison": partial(comparison_table, ranking)} if len(ranking.ranked) > 1 else {}
    return {
        **comparison,
        "worst runs": partial(worst_runs_table, case),
        "consistency": partial(consistency_table, case),
        "convergence": partial(convergence_table, case),
        "spread": partial(spread_table, case),
        "extra states": partial(extra_table, case),
        "reliability": partial(reliability_table, case),
    }
