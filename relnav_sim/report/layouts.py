"""The tables of one case: its errors in the layout of Shi et al. (2025), Table 2, and its failed runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relnav_sim.conventions import CONFIDENCE
from relnav_sim.plots.axes import COMPONENTS, describe_axes
from relnav_sim.plots.facts import CaseFacts, FilterFacts, Span
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval, mean_interval
from relnav_sim.wording import counted, significant

INTERVALS = "Figures are means over runs; in brackets their 95 % interval."
_ONE_RUN = "One run only: there are no intervals."
_NO_RUN = "No run was completed: there are no figures."
WORST_RUNS = 2
NOT_JUDGED = "cannot be judged"
_HEADINGS = {"r": "r = |position|", "v": "v = |velocity|"}


def case_table(case: CaseFacts, span: Span) -> Table:
    """Return mean and standard deviation over time of every component's error, per filter.

    Each figure is the mean over the completed runs with its 95 % interval. Below stand what the case says
    about each filter as a whole: convergence, consistency, cost, failed runs.
    """
    columns = [
        Column(label, item.name, opens_group=label == "mean") for item in case.filters for label in ("mean", "std")
    ]
    rows = []
    for component in COMPONENTS:
        figures = [
            mean_interval(item.errors(statistic, span, component)[item.ok])
            for item in case.filters
            for statistic in ("mean", "std")
        ]
        unit = "m/s" if component.startswith("v") else "m"
        cells = numbers(figures)
        rows.append(Row(_HEADINGS.get(component, component), cells, unit, opens_block=component == "vx"))
    rows += [
        Row("convergence time", convergence_cells(case, 2), "s", opens_block=True),
        Row("ANEES", numbers([mean_interval(item.consistency("anees", span)[item.ok]) for item in case.filters], 2)),
        Row(
            "mean NIS",
            numbers([mean_interval(item.consistency("nis", span)[item.ok]) for item in case.filters], 2),
        ),
        Row("CPU per step", numbers([mean_cost(item) for item in case.filters], 2), "µs"),
        Row("failed runs", tuple(failed_cell(item, span=2) for item in case.filters)),
    ]
    where = f"t ≥ {case.settle_s:g} s" if span == "settled" else "the whole span"
    return Table(
        name=f"case_{case.number:03d}_{span}",
        title=f"Errors over {where}",
        caption=" ".join(
            [f"Mean and standard deviation (std) of the error over time, {where}.", *reading_notes([case])]
        ),
        corner="error",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def failures_table(case: CaseFacts) -> Table:
    """Return the failed runs of a case: which, where, when, why."""
    rows = [
        Row(
            f"run {failure.run}",
            (
                Words(failure.filter or "the whole run"),
                Words(str(failure.epoch) if failure.epoch >= 0 else "not known"),
                Words(failure.reason),
                Words(case.trace_command(failure.run)),
            ),
        )
        for failure in case.failures
    ]
    return Table(
        name=f"case_{case.number:03d}_failures",
        title=f"Failed runs ({len(case.failures)})",
        caption="Epoch: the first that failed. The other runs are not affected.",
        corner="run",
        columns=tuple(Column(label, numeric=False) for label in ("filter", "epoch", "reason", "a closer look")),
        rows=tuple(rows),
    )


def worst_runs_table(case: CaseFacts) -> Table:
    """Return the completed runs with the largest position RMS of each filter, and the command that shows them again."""
    found: dict[int, list[str]] = {}
    for item in case.filters:
        sizes, times = item.errors("rms", case.span, "r"), item.times_median(case.span)
        for row in item.worst_rows(case.span, WORST_RUNS) if item.completed > WORST_RUNS else ():
            lost = " (diverged)" if item.diverged[row] else ""
            words = f"{item.name} {significant(sizes[row])} m, {significant(times[row], 2)} times its median{lost}"
            found.setdefault(int(item.runs[row]), []).append(words)
    rows = [
        Row(f"run {run}", (Words("; ".join(words)), Words(case.trace_command(run)))) for run, words in found.items()
    ]
    return Table(
        name=f"case_{case.number:03d}_worst",
        title="Worst runs",
        caption=f"The {WORST_RUNS} completed runs of each filter with the largest position RMS ({case.when}).",
        corner="run",
        columns=(Column("position RMS", numeric=False), Column("a closer look", numeric=False)),
        rows=tuple(rows),
    )


def numbers(figures: Sequence[Interval], span: int = 1, notes: Sequence[str] = ()) -> tuple[Number, ...]:
    """Return figures of one row with a common number of decimals."""
    decimals = decimals_for([f.estimate for f in figures], [(f.high - f.low) / 2 for f in figures])
    return tuple(
        Number(f.estimate, f.low, f.high, decimals, span, note)
        for f, note in zip(figures, notes or [""] * len(figures), strict=True)
    )


def ratio_cells(case: CaseFacts, ratios: Sequence[Interval]) -> tuple[Cell, ...]:
    """Return each filter's ratio to a bound, with how many of its runs diverged; no number where most of them did."""
    shown = numbers(
        [NO_INTERVAL if item.mostly_diverged else ratio for item, ratio in zip(case.filters, ratios, strict=True)]
    )
    return tuple(
        cell
        if not item.diverged_completed
        else Words(diverged_note(item), math.inf, mark="failed")
        if item.mostly_diverged
        else replace(cell, note=f"({diverged_note(item)})", mark="failed")
        for item, cell in zip(case.filters, shown, strict=True)
    )


def diverged_note(item: FilterFacts) -> str:
    """Return in how many of its runs a filter diverged, those that failed left out."""
    return f"diverged in {item.diverged_completed} of {counted(item.completed, 'run')}"


def mean_cost(item: FilterFacts) -> Interval:
    """Return the mean CPU time per filter step, microseconds.

    Without an interval: runs of one block are timed together, so they are no sample.
    """
    known = item.cpu_us[item.ok & np.isfinite(item.cpu_us)]
    return Interval(float(known.mean()) if known.size else math.nan, math.nan, math.nan, CONFIDENCE, known.size)


def failed_cell(item: FilterFacts, span: int = 1) -> Words:
    """Return how many of a filter's runs failed."""
    total = len(item.runs)
    return Words(f"{item.failed} of {total}", item.failed / total, span, mark="failed" if item.failed else "")


def convergence_cells(case: CaseFacts, span: int = 1) -> tuple[Cell, ...]:
    """Return each filter's convergence time, where a run is long enough to show one."""
    if not case.shows_convergence:
        return (Words(NOT_JUDGED, math.inf, span),) * len(case.filters)
    times = [mean_interval(item.convergence_s[item.ok]) for item in case.filters]
    return numbers(times, span, [_converged_note(item) for item in case.filters])


def _converged_note(item: FilterFacts) -> str:
    """Return in how many runs a filter converged, where not in all."""
    return f"in {item.completed - item.never_converged} of {item.completed} runs" if item.never_converged else ""


def reading_notes(cases: Sequence[CaseFacts], axes: bool = True) -> list[str]:
    """Return what a reader must know to read the figures of these cases."""
    filters = [item for case in cases for item in case.filters]
    notes = [f"{describe_axes(cases[0].axes)}."] if axes and cases else []
    most = max((item.completed for item in filters), default=0)
    notes.append(INTERVALS if most > 1 else _ONE_RUN if most else _NO_RUN)
    if failed := sum(item.failed for item in filters):
        notes.append(f"{failed} failed run{'s are' if failed > 1 else ' is'} counted, and left out of every mean.")
    notes += list(dict.fromkeys(case.not_judged for case in cases if not case.shows_convergence))
    levels = {(case.convergence_m, case.hold_s) for case in cases if case.shows_convergence}
    if len(levels) == 1 and np.isfinite(next(iter(levels))).all():
        size, hold = levels.pop()
        notes.append(f"Converged: position error below {size:g} m for {hold:g} s.")
    return notes
