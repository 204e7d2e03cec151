"""What a case says beyond its errors: consistency, convergence, spread, reliability, diagnostics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import span_index
from relnav_sim.report.augmented_table import augmented_table
from relnav_sim.report.comparison_table import comparison_table
from relnav_sim.report.editing_table import editing_table
from relnav_sim.report.in_full_tables import by_part_table, correlations_table
from relnav_sim.report.layouts import INTERVALS, worst_runs_table
from relnav_sim.report.metrics import (
    NIS_PER_DOF,
    NOT_JUDGED,
    TIMES_BOUND,
    nis_metric,
    nis_ratio,
    numbers,
    ratio_cells,
)
from relnav_sim.report.observability_table import observability_table
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.report.whiteness_table import whiteness_table
from relnav_sim.results import layout
from relnav_sim.statistics.convergence import RELATIVE_CONVERGENCE
from relnav_sim.statistics.intervals import (
    Band,
    Interval,
    chi_square_band,
    effective_samples,
    lag1_band,
    mean_interval,
    median_interval,
    sum_band,
    wilson_interval,
)
from relnav_sim.wording import MISSING, listed, significant

_AVAILABILITY_NOTE = " Epochs with a measurement: share of the epochs of the time span of the metrics."
_KNOWN = {
    "rejected": "measurements that were rejected (share)",
    "underweighted": "updates that were underweighted (share)",
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


def consistency_table(case: CaseFacts) -> Table:
    """Return whether the errors and innovations of each filter match its covariances."""
    span = span_index(case.span)
    rows = [
        *_bound_rows(case),
        _row(case, "ANEES, whole state", lambda item: mean_interval(item.per_run("anees", span, 0)), opens=True),
        _bands(case, "95 % band if consistent", lambda item: _anees_band(case, item)),
        _row(case, "ANEES, position", lambda item: mean_interval(item.per_run("anees", span, 1))),
        _row(case, "ANEES, velocity", lambda item: mean_interval(item.per_run("anees", span, 2))),
        *_nis_rows(case),
        *_sensor_rows(case),
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
        "counts the epochs as as many independent ones as the correlation of the NEES leaves. NIS: "
        f"{_expected_nis(case)}, and no correlation between updates. "
        "Ellipsoids: as many percent of the epochs as they are named for."
        f"{no_band_note(case)}",
        rows,
    )


def _nis_rows(case: CaseFacts) -> list[Row]:
    """Return the NIS over all sensors: its mean, or where updates had different dimensions its mean per degree."""
    span, metric = span_index(case.span), nis_metric([case])

    def band(item: FilterFacts) -> Band | None:
        dof, updates = (int(values[item.ok, span].sum()) for values in (item.dof, item.stored["updates"]))
        if not dof or not item.nis_is_chi_square:
            return None
        return sum_band(dof, dof if metric is NIS_PER_DOF else updates)

    def white(item: FilterFacts) -> Band | None:
        updates = int(item.per_run("updates", span).sum())
        return lag1_band(updates) if updates else None

    return [
        Row(metric.label, metric.row(case, case.span), metric.unit, opens_block=True),
        _bands(case, "95 % band if consistent", band),
        _row(case, "NIS, autocorrelation at lag 1", lambda item: mean_interval(item.per_run("nis_lag1", span))),
        _bands(case, "95 % band if white", white),
    ]


def _sensor_rows(case: CaseFacts) -> list[Row]:
    """Return the NIS of each sensor by itself, with its own degrees of freedom; none of the only sensor."""
    rows: list[Row] = []
    for sensor in case.sensors if len(case.sensors) > 1 else ():
        rows += [
            _row(case, f"{NIS_PER_DOF.label}, {sensor}", partial(_sensor_nis, case, sensor), opens=True),
            _bands(case, f"95 % band if consistent, {sensor}", partial(_sensor_band, case, sensor)),
            _row(case, f"NIS, autocorrelation at lag 1, {sensor}", partial(_sensor_lag1, case, sensor)),
            _bands(case, f"95 % band if white, {sensor}", partial(_sensor_white, case, sensor)),
        ]
    return rows


def _sensor_nis(case: CaseFacts, sensor: str, item: FilterFacts) -> Interval:
    total, dof = (item.of_sensor(sensor, name, case.span) for name in ("nis_sum", "dof_sum"))
    return nis_ratio(total, dof, sensor not in item.mixture_sensors)


def _sensor_band(case: CaseFacts, sensor: str, item: FilterFacts) -> Band | None:
    dof = float(np.nansum(item.of_sensor(sensor, "dof_sum", case.span)))
    return sum_band(dof, dof) if dof and sensor not in item.mixture_sensors else None


def _sensor_lag1(case: CaseFacts, sensor: str, item: FilterFacts) -> Interval:
    return mean_interval(item.of_sensor(sensor, "nis_lag1", case.span))


def _sensor_white(case: CaseFacts, sensor: str, item: FilterFacts) -> Band | None:
    updates = int(np.nansum(item.of_sensor(sensor, "updates", case.span)))
    return lag1_band(updates) if updates else None


def _expected_nis(case: CaseFacts) -> str:
    if case.mixes_dimensions:
        return "1 per degree of freedom, which are the channels that were present"
    known = "" if case.dimension is None else f", {case.dimension}"
    return f"the dimension of the measurement{known}"


def no_band_note(case: CaseFacts) -> str:
    """Return why filters have no band of the NIS where the noise is a mixture; nothing where all have one."""
    names = [item.name for item in case.filters if not item.nis_is_chi_square]
    if not names:
        return ""
    return (
        f" {listed(names)}: the noise is a mixture, so the mean NIS is the dimension where the filter is told its "
        "covariance, but there is no chi-square band; judge by the interval of the mean, by the bootstrap over runs "
        "(Efron 1987)."
    )


def convergence_table(case: CaseFacts) -> Table:
    """Return when each filter's position error became small, by several definitions; no row where all did at once."""
    if case.converged_at_once:
        return _table(case, "convergence", "Convergence of the position error", "", [])
    held = f"for {case.hold_s:g} s"
    named = (
        (f"below {case.convergence_m:g} m {held}", "convergence"),
        (f"below {case.convergence_m:g} m to the end", "convergence_final"),
        (f"below {RELATIVE_CONVERGENCE:g} times the steady-state RMS {held}", "convergence_relative"),
    )
    rows = []
    for label, name in named:
        if name != "convergence_final" and not case.shows_convergence:
            rows.append(Row(label, (Words(NOT_JUDGED),) * len(case.filters)))
            continue
        rows.append(_row(case, label, _median_time(name), "s"))
        reached = [int(np.isfinite(item.per_run(name)).sum()) for item in case.filters]
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
        f"{'' if case.shows_convergence else ' ' + case.not_judged}",
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
    rows += _availability_rows(case)
    names = sorted({name for item in case.filters for name in item.diagnostics})
    for place, name in enumerate(names):
        rows.append(_row(case, _KNOWN.get(name, name), _diagnostic(name), opens=place == 0))
    return _table(
        case,
        "reliability",
        "Reliability and diagnostics",
        "Rates with their Wilson interval. Diverged: failed, or beyond the 0.9999 ellipsoid of its own covariance for "
        "more than 5 % of the last half of the run, or, where the result holds a bound, beyond it for 50 s with a "
        "position error above ten times the bound of a perfect model, at the stored epochs. Below: what the filters "
        "report of their own working, mean over updates."
        f"{_AVAILABILITY_NOTE if _availability_rows(case) else ''}",
        rows,
    )


def _availability_rows(case: CaseFacts) -> list[Row]:
    """Return in how many of the epochs each sensor gave a measurement; nothing where an only one always did."""
    shares = {sensor: [_readings(case, sensor, item) for item in case.filters] for sensor in case.sensors}
    if len(shares) == 1 and not any(share < 100 for share in next(iter(shares.values()))):
        return []
    return [
        Row(
            f"epochs with a measurement, {sensor}",
            tuple(Number(share, decimals=1) for share in found),
            "%",
            opens_block=not n,
        )
        for n, (sensor, found) in enumerate(shares.items())
    ]


def _readings(case: CaseFacts, sensor: str, item: FilterFacts) -> float:
    """Return in how many per cent of the epochs of all completed runs the sensor gave a measurement; NaN without it."""
    span = span_index(case.span)
    updates, epochs = item.of_sensor(sensor, "updates", case.span).sum(), item.per_run("epochs", span).sum()
    return float(100 * updates / epochs) if epochs else math.nan


def _table(case: CaseFacts, what: str, title: str, caption: str, rows: Sequence[Row]) -> Table:
    return Table(
        name=f"case_{case.index:03d}_{what}",
        title=title,
        caption=caption,
        corner="quantity",
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
        Row(f"{TIMES_BOUND.label}, {model}", ratio_cells(case, ratios))
        for model, ratios in named.items()
        if any(math.isfinite(ratio.estimate) for ratio in ratios)
    ]


def _bands(case: CaseFacts, label: str, of: Callable[[FilterFacts], Band | None]) -> Row:
    return Row(label, tuple(_band_cell(of(item)) for item in case.filters))


def _band_cell(band: Band | None) -> Cell:
    return Words(MISSING) if band is None else Words(f"[{significant(band.low, 4)}, {significant(band.high, 4)}]")


def _percent_of(span: int, block: int, level: int) -> Figure:
    return lambda item: mean_interval(100 * item.per_run("coverage", span, block, level), most=100)


def _quantile(span: int, norm: int, place: int) -> Figure:
    return lambda item: mean_interval(item.per_run("quantile", span, norm, place))


def _largest(span: int, quantity: int, over: Callable[[Array], float]) -> Figure:
    def of(item: FilterFacts) -> Interval:
        values = item.per_run("max", span, quantity)
        if over is np.mean or not len(values):
            return mean_interval(values)
        return Interval(float(over(values)), math.nan, math.nan, CONFIDENCE, len(values))

    return of


def _diagnostic(name: str) -> Figure:
    return lambda item: mean_interval(item.diagnostics.get(name, np.full(len(item.runs), np.nan))[item.ok])


def _median_time(name: str, *place: int) -> Figure:
    def of(item: FilterFacts) -> Interval:
        times = item.per_run(name, *place)
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


def case_table_makers(ranking: Ranking) -> dict[str, Callable[[], Table | None]]:
    """Return what makes every further table of a case that has runs, by what it is about; None: nothing to show."""
    case = ranking.case
    comparison = {"comparison": partial(comparison_table, ranking)} if len(ranking.ranked) > 1 else {}
    return {
        **comparison,
        "worst runs": partial(worst_runs_table, case),
        "consistency": partial(consistency_table, case),
        "consistency by axis and plane": partial(by_part_table, case),
        "formal and actual covariance": partial(correlations_table, case),
        "residuals by channel": partial(whiteness_table, case),
        "observability": partial(observability_table, case),
        "convergence": partial(convergence_table, case),
        "spread": partial(spread_table, case),
        "augmented states": partial(augmented_table, case),
        "measurement editing": partial(editing_table, case),
        "reliability": partial(reliability_table, case),
    }
