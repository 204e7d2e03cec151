"""The tables of one case: its errors in the layout of Shi et al. (2025), Table 2, and its failed runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.plots.axes import COMPONENTS, describe_axes
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.run_figures import Span
from relnav_sim.report.metrics import ANEES, CONVERGENCE, CPU, FAILED, nis_metric, numbers
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.statistics.intervals import mean_interval
from relnav_sim.wording import significant

INTERVALS = "Values are means over runs; in brackets their 95 % interval."
_ONE_RUN = "One run only: there are no intervals."
_NO_RUN = "No run was completed: there are no values."
WORST_RUNS = 2
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
        Row(metric.label, metric.row(case, span, width=2), metric.unit, opens_block=metric is CONVERGENCE)
        for metric in (CONVERGENCE, ANEES, nis_metric([case]), CPU, FAILED)
    ]
    where = f"t ≥ {case.settle_s:g} s" if span == "settled" else "the whole span"
    return Table(
        name=f"case_{case.index:03d}_{span}",
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
        name=f"case_{case.index:03d}_failures",
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
        name=f"case_{case.index:03d}_worst",
        title="Worst runs",
        caption=f"The {WORST_RUNS} completed runs of each filter with the largest position RMS ({case.when}).",
        corner="run",
        columns=(Column("position RMS", numeric=False), Column("a closer look", numeric=False)),
        rows=tuple(rows),
    )


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
        notes.append(
            f"Convergence time: when the position error first falls below {size:g} m for {hold:g} s, whatever it is "
            "later; median over runs."
        )
    return notes
