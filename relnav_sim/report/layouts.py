"""The tables of a report: a case in the layout of Shi et al. (2025), Table 2, and all cases at a glance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from relnav_sim.report.axes import COMPONENTS, Array, describe_axes
from relnav_sim.report.facts import CaseFacts, FilterFacts, Span
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.intervals import Interval, bootstrap_interval

_INTERVALS = "Figures are means over runs; in brackets their 95 % interval (bootstrap over runs)."
_ONE_RUN = "One run only: there are no intervals."
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
            bootstrap_interval(item.errors(statistic, span, component)[item.ok])
            for item in case.filters
            for statistic in ("mean", "std")
        ]
        unit = "m/s" if component.startswith("v") else "m"
        cells = numbers(figures)
        rows.append(Row(_HEADINGS.get(component, component), cells, unit, opens_block=component == "vx"))
    rows += [
        _whole_row(
            "convergence time", "s", [(item.convergence_s, _converged_note(item)) for item in case.filters], case, True
        ),
        _whole_row("ANEES", "", [(item.consistency("anees", span), "") for item in case.filters], case),
        _whole_row("mean NIS", "", [(item.consistency("nis", span), "") for item in case.filters], case),
        _whole_row("CPU per step", "µs", [(item.cpu_us, "") for item in case.filters], case),
        Row("failed runs", tuple(_failed_cell(item, span=2) for item in case.filters)),
    ]
    where = f"t ≥ {case.settle_s:g} s" if span == "settled" else "the whole span"
    return Table(
        name=f"case_{case.number:03d}_{span}",
        title=f"Errors over {where}",
        caption=" ".join([f"Mean and standard deviation (std) of the error over time, {where}.", *_notes([case])]),
        corner="error",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def overview_table(rankings: Sequence[Ranking]) -> Table:
    """Return one row per case and filter with the headline figures."""
    several = len(rankings) > 1
    labels = [
        "position RMS [m]", "velocity RMS [m/s]", "RMS above the best [%]", "convergence [s]", "ANEES",
        "mean NIS", "CPU per step [µs]", "failed runs",
    ]  # fmt: skip
    columns = [Column(label, numeric=label != "failed runs") for label in labels]
    if several:
        columns.insert(0, Column("filter", numeric=False))
    rows = [row for ranking in rankings for row in _overview_rows(ranking, several)]
    cases = [ranking.case for ranking in rankings]
    spans = {case.when for case in cases}
    over = f"RMS, ANEES and NIS over {spans.pop()}." if len(spans) == 1 else "RMS, ANEES and NIS over the settled span."
    against = "Above the best: relative difference on the same runs."
    return Table(
        name="overview",
        title="All cases and filters" if several else "All filters",
        caption=" ".join([over, *_notes(cases, axes=False), against]),
        corner="case" if several else "filter",
        columns=tuple(columns),
        rows=tuple(rows),
        sortable=True,
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
            ),
        )
        for failure in case.failures
    ]
    return Table(
        name=f"case_{case.number:03d}_failures",
        title=f"Failed runs ({len(case.failures)})",
        caption="`relnav run FILE --only CASE:RUN` computes one of them again.",
        corner="run",
        columns=(Column("filter", numeric=False), Column("epoch", numeric=False), Column("reason", numeric=False)),
        rows=tuple(rows),
    )


def numbers(figures: Sequence[Interval], span: int = 1, notes: Sequence[str] = ()) -> tuple[Number, ...]:
    """Return figures of one row with a common number of decimals."""
    decimals = decimals_for([f.estimate for f in figures], [(f.high - f.low) / 2 for f in figures])
    return tuple(
        Number(f.estimate, f.low, f.high, decimals, span, note)
        for f, note in zip(figures, notes or [""] * len(figures), strict=True)
    )


def _whole_row(
    label: str, unit: str, figures: Sequence[tuple[Array, str]], case: CaseFacts, block: bool = False
) -> Row:
    found = [bootstrap_interval(values[item.ok]) for (values, _), item in zip(figures, case.filters, strict=True)]
    return Row(label, numbers(found, span=2, notes=[note for _, note in figures]), unit, opens_block=block)


def _overview_rows(ranking: Ranking, several: bool) -> list[Row]:
    case = ranking.case
    nothing = Interval(math.nan, math.nan, math.nan, 0.95, 0)
    standings = [ranking.of(item.name) for item in case.filters]

    def row_of(values: Sequence[Array]) -> tuple[Number, ...]:
        return numbers([bootstrap_interval(v[item.ok]) for v, item in zip(values, case.filters, strict=True)])

    position = numbers([nothing if s is None else s.position for s in standings])
    velocity = numbers([nothing if s is None else s.velocity for s in standings])
    convergence = row_of([item.convergence_s for item in case.filters])
    anees, nis = (row_of([item.consistency(w, case.span) for item in case.filters]) for w in _CONSISTENCY)
    cost = row_of([item.cpu_us for item in case.filters])
    rows = []
    for place, item in enumerate(case.filters):
        cells: list[Cell] = [position[place], velocity[place], _against_cell(ranking, item.name)]
        cells += [replace(convergence[place], note=_converged_note(item)), anees[place], nis[place], cost[place]]
        cells.append(_failed_cell(item))
        key = str(case.number)
        if several:
            cells.insert(0, Words(item.name))
            rows.append(
                Row(f"{case.number}: {case.label}", tuple(cells), key=key, order=case.number, opens_block=not place)
            )
        else:
            rows.append(Row(item.name, tuple(cells), key=key))
    for name in case.waiting:
        empty: list[Cell] = [Words("no run yet", span=len(_OVERVIEW_CELLS))]
        if several:
            rows.append(
                Row(f"{case.number}: {case.label}", (Words(name), *empty), key=str(case.number), order=case.number)
            )
        else:
            rows.append(Row(name, tuple(empty), key=str(case.number)))
    return rows


_CONSISTENCY: tuple[Literal["anees"], Literal["nis"]] = ("anees", "nis")
_OVERVIEW_CELLS = range(8)


def _against_cell(ranking: Ranking, name: str) -> Cell:
    standing = ranking.of(name)
    if standing is None:
        return Words("no completed run", math.inf)
    if len(ranking.standings) == 1:
        return Words("the only one", 0.0)
    if standing is ranking.best:
        return Words("best", 0.0, mark="best")
    if standing.against_best is None:
        return Words("no common run", math.inf)
    note, mark = "", ""
    if math.isnan(standing.percent.low):
        note = "undecided"
    elif not standing.told_apart:
        note, mark = "not told apart", "best"
    return replace(numbers([standing.percent])[0], note=note, mark=mark)


def _failed_cell(item: FilterFacts, span: int = 1) -> Words:
    total = len(item.runs)
    return Words(f"{item.failed} of {total}", item.failed / total, span, mark="failed" if item.failed else "")


def _converged_note(item: FilterFacts) -> str:
    return f"in {item.completed - item.never_converged} of {item.completed} runs" if item.never_converged else ""


def _notes(cases: Sequence[CaseFacts], axes: bool = True) -> list[str]:
    """Return what a reader must know to read the figures of these cases."""
    filters = [item for case in cases for item in case.filters]
    notes = [f"{describe_axes(cases[0].axes)}."] if axes and cases else []
    notes.append(_ONE_RUN if filters and max(item.completed for item in filters) <= 1 else _INTERVALS)
    if failed := sum(item.failed for item in filters):
        notes.append(f"{failed} failed run{'s are' if failed > 1 else ' is'} counted, and left out of every mean.")
    levels = {(case.convergence_m, case.hold_s) for case in cases}
    if len(levels) == 1 and np.isfinite(next(iter(levels))).all():
        size, hold = levels.pop()
        notes.append(f"Converged: position error below {size:g} m for {hold:g} s.")
    return notes
