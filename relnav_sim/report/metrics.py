"""The metrics of tables, each declared once: label, unit, value, format.

A table names the metrics it shows and takes everything else from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import RunFigures, Span, span_index
from relnav_sim.report.tables import Cell, Number, Words, decimals_for
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval, bootstrap_interval, mean_interval, median_interval
from relnav_sim.statistics.verdicts import ratio_of_means
from relnav_sim.wording import counted, with_prefix

NOT_JUDGED = "cannot be judged"
Cells = Callable[[CaseFacts, Sequence[Interval], int], tuple[Cell, ...]]
PerRun = Callable[[FilterFacts, Span], Array]


def position_rms(item: RunFigures, span: Span) -> Array:
    """Return the RMS of the position error over a span, one figure for each computed run (n,), m."""
    return item.errors("rms", span, "r")


def velocity_rms(item: RunFigures, span: Span) -> Array:
    """Return the RMS of the velocity error over a span, one figure for each computed run (n,), m/s."""
    return item.errors("rms", span, "v")


def convergence_s(item: RunFigures, span: Span) -> Array:
    """Return the convergence time, one for each computed run (n,), s; it is of the whole run."""
    return item.convergence_s


def _no_run_by_itself(item: FilterFacts, span: Span) -> Array:
    return np.full(len(item.runs), np.nan)


@dataclass(frozen=True)
class Metric:
    """A metric of one filter in one case.

    Attributes:
        label: Its name in tables.
        unit: Its unit; empty without one.
        value: Its value over a span with its interval, from the filter's completed runs.
        cells: Its cells for the filters of a case: the values, and how many columns each cell takes.
        per_run: One value for each computed run (n,); NaN where a run by itself has none.
        numeric: Whether its cells are numbers with intervals.
    """

    label: str
    unit: str
    value: Callable[[FilterFacts, Span], Interval]
    cells: Cells
    per_run: PerRun = _no_run_by_itself
    numeric: bool = True

    @property
    def heading(self) -> str:
        """Its label with its unit, as a column is headed."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def row(self, case: CaseFacts, span: Span, width: int = 1) -> tuple[Cell, ...]:
        """Return the cells of all filters of a case over a span, each ``width`` columns wide."""
        return self.cells(case, [self.value(item, span) for item in case.filters], width)


def numbers(values: Sequence[Interval], span: int = 1, notes: Sequence[str] = ()) -> tuple[Number, ...]:
    """Return the values of one row with a common number of decimals."""
    decimals = decimals_for([f.estimate for f in values], [(f.high - f.low) / 2 for f in values])
    return tuple(
        Number(f.estimate, f.low, f.high, decimals, span, note)
        for f, note in zip(values, notes or [""] * len(values), strict=True)
    )


def diverged_note(item: FilterFacts) -> str:
    """Return in how many of its runs a filter diverged, those that failed left out."""
    return f"diverged in {item.diverged_completed} of {counted(item.completed, 'run')}"


def ratio_cells(case: CaseFacts, ratios: Sequence[Interval], width: int = 1) -> tuple[Cell, ...]:
    """Return each filter's ratio to a bound, with how many of its runs diverged; no number where most of them did."""
    shown = numbers(
        [NO_INTERVAL if item.mostly_diverged else ratio for item, ratio in zip(case.filters, ratios, strict=True)],
        width,
    )
    return tuple(
        cell
        if not item.diverged_completed
        else Words(diverged_note(item), math.inf, width, mark="failed")
        if item.mostly_diverged
        else replace(cell, note=f"({diverged_note(item)})", mark="failed")
        for item, cell in zip(case.filters, shown, strict=True)
    )


def _over_runs(label: str, unit: str, per_run: PerRun, cells: Cells | None = None) -> Metric:
    """Return a metric that is the mean over the completed runs of one value per computed run."""

    def value(item: FilterFacts, span: Span) -> Interval:
        return mean_interval(per_run(item, span)[item.ok])

    return Metric(label, unit, value, cells or _numbers, per_run)


def _numbers(case: CaseFacts, values: Sequence[Interval], width: int) -> tuple[Cell, ...]:
    return numbers(values, width)


def _convergence_cells(case: CaseFacts, values: Sequence[Interval], width: int) -> tuple[Cell, ...]:
    """Return the times with in how many runs a filter converged; no number where a run is too short to show any."""
    if not case.shows_convergence:
        return (Words(NOT_JUDGED, math.inf, width),) * len(case.filters)
    return numbers(values, width, [_converged_note(item) for item in case.filters])


def _median_convergence(item: FilterFacts, span: Span) -> Interval:
    """Return the median over the completed runs; those that never converge count as infinite."""
    times = item.convergence_s[item.ok]
    return median_interval(np.where(np.isnan(times), np.inf, times))


def _converged_note(item: FilterFacts) -> str:
    return f"in {item.completed - item.never_converged} of {item.completed} runs" if item.never_converged else ""


def _nis_mean(item: FilterFacts, span: Span) -> Interval:
    values = item.consistency("nis", span)[item.ok]
    return mean_interval(values) if item.nis_is_chi_square else bootstrap_interval(values)


def _nis_per_dof(item: FilterFacts, span: Span) -> Interval:
    place = span_index(span)
    known = item.ok & (item.dof[:, place] > 0)
    return nis_ratio(item.nis_sum[known, place], item.dof[known, place], item.nis_is_chi_square)


def nis_ratio(total: Array, dof: Array, chi_square: bool) -> Interval:
    """Return the NIS per degree of freedom over runs with its interval.

    Where the noise is a mixture only the mean of the NIS is known, and its tails are long: then by the bootstrap over
    runs, the degrees of freedom being the runs' mean.

    Args:
        total: Sum of the NIS of each run (runs,); NaN: none.
        dof: Its degrees of freedom (runs,).
        chi_square: Whether the NIS is chi-square where the filter is consistent.
    """
    if chi_square:
        return ratio_of_means(total, dof)
    known = np.isfinite(total) & (dof > 0)
    return bootstrap_interval(total[known] / dof[known].mean()) if known.any() else NO_INTERVAL


def _mean_cost(item: FilterFacts, span: Span) -> Interval:
    # Without an interval: runs of one block are timed together, so they are no sample.
    known = item.cpu_us[item.ok & np.isfinite(item.cpu_us)]
    return Interval(float(known.mean()) if known.size else math.nan, math.nan, math.nan, CONFIDENCE, known.size)


def _cost_cells(case: CaseFacts, values: Sequence[Interval], width: int) -> tuple[Cell, ...]:
    """Return the times with the operations and bytes of an epoch by formula."""
    return numbers(values, width, [_operations_note(item) for item in case.filters])


def _operations_note(item: FilterFacts) -> str:
    if item.operations is None:
        return "(operations not stated)"
    count, size = item.operations.count, item.operations.bytes
    return f"({with_prefix(count)} operations, {with_prefix(size, 'B')})"


def _failed_share(item: FilterFacts, span: Span) -> Interval:
    return Interval(item.failed / len(item.runs), math.nan, math.nan, CONFIDENCE, len(item.runs))


def _failed_cells(case: CaseFacts, values: Sequence[Interval], width: int) -> tuple[Cell, ...]:
    return tuple(
        Words(f"{item.failed} of {share.runs}", share.estimate, width, mark="failed" if item.failed else "")
        for item, share in zip(case.filters, values, strict=True)
    )


POSITION_RMS = _over_runs("position RMS", "m", position_rms)
VELOCITY_RMS = _over_runs("velocity RMS", "m/s", velocity_rms)
TIMES_BOUND = Metric("position RMS / bound", "", lambda item, span: item.times_bound[span], ratio_cells)
CONVERGENCE = Metric("median convergence time", "s", _median_convergence, _convergence_cells, convergence_s)
ANEES = _over_runs("ANEES", "", lambda item, span: item.consistency("anees", span))
NIS = Metric("mean NIS", "", _nis_mean, _numbers, lambda item, span: item.consistency("nis", span))
NIS_PER_DOF = Metric("NIS per degree of freedom", "", _nis_per_dof, _numbers, lambda item, span: item.nis_per_dof(span))
CPU = Metric("CPU per step", "µs", _mean_cost, _cost_cells, lambda item, span: item.cpu_us)
FAILED = Metric("failed runs", "", _failed_share, _failed_cells, numeric=False)


def nis_metric(cases: Sequence[CaseFacts]) -> Metric:
    """Return how the NIS of these cases is told: as it is, or per degree of freedom where their updates differ."""
    known = {case.dimension for case in cases} - {None}
    return NIS_PER_DOF if len(known) > 1 or any(case.mixes_dimensions for case in cases) else NIS
