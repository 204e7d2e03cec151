"""All cases and filters in one table, a row each, with the figures that decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from relnav_sim.report.layouts import convergence_cells, failed_cell, mean_cost, numbers, ratio_cells, reading_notes
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.report.wording import short_labels
from relnav_sim.statistics.intervals import Interval, mean_interval

_LIMIT = "position RMS / bound"
_FIGURES = (
    "position RMS [m]",
    "velocity RMS [m/s]",
    "RMS above the best [%]",
    _LIMIT,
    "convergence [s]",
    "ANEES",
    "mean NIS",
    "CPU per step [µs]",
)
_NOTHING = Interval(math.nan, math.nan, math.nan, 0.95, 0)


def overview_table(rankings: Sequence[Ranking]) -> Table:
    """Return one row per case and filter with the headline figures; without a column of cases if there is one."""
    cases = [ranking.case for ranking in rankings]
    bounded = any(math.isfinite(item.times_bound[case.span].estimate) for case in cases for item in case.filters)
    figures = [label for label in _FIGURES if bounded or label != _LIMIT]
    columns = [*(Column(label) for label in figures), Column("failed runs", numeric=False)]
    if len(cases) > 1:
        headings = [
            f"{c.number}: {label}" for c, label in zip(cases, short_labels([c.label for c in cases]), strict=True)
        ]
        columns.insert(0, Column("filter", numeric=False))
        rows = [
            replace(
                row,
                label=f"{ranking.case.number}" if place else heading,
                cells=(Words(row.label), *row.cells),
                opens_block=not place,
                record=heading,
            )
            for ranking, heading in zip(rankings, headings, strict=True)
            for place, row in enumerate(_rows(ranking, bounded))
        ]
    else:
        rows = [replace(row, order=None) for ranking in rankings for row in _rows(ranking, bounded)]
    spans = {case.when for case in cases}
    over = spans.pop() if len(spans) == 1 else "the settled span"
    above = "Above the best: relative difference on the same runs."
    above += (
        " RMS / bound: root mean squares over all runs and stored epochs, of the error and of the Cramér-Rao bound "
        "of a perfect model with the filter's sensors; none for a filter that diverged in half of its runs or more."
        if bounded
        else ""
    )
    return Table(
        name="overview",
        title="All cases and filters" if len(cases) > 1 else "All filters",
        caption=" ".join([f"RMS, ANEES and NIS over {over}.", *reading_notes(cases, axes=False), above]),
        corner="case" if len(cases) > 1 else "filter",
        columns=tuple(columns),
        rows=tuple(rows),
        sortable=True,
    )


def _rows(ranking: Ranking, bounded: bool) -> list[Row]:
    """Return a row per filter of a case, headed by the filter's name; figures of one column share their decimals."""
    case = ranking.case
    standings = [ranking.of(item.name) for item in case.filters]
    columns = (
        numbers([_NOTHING if standing is None else standing.position for standing in standings]),
        numbers([_NOTHING if standing is None else standing.velocity for standing in standings]),
        [_above_best(ranking, item.name) for item in case.filters],
        *([ratio_cells(case, [item.times_bound[case.span] for item in case.filters])] if bounded else []),
        convergence_cells(case),
        numbers([mean_interval(item.consistency("anees", case.span)[item.ok]) for item in case.filters]),
        numbers([mean_interval(item.consistency("nis", case.span)[item.ok]) for item in case.filters]),
        numbers([mean_cost(item) for item in case.filters]),
        [failed_cell(item) for item in case.filters],
    )
    key = str(case.number)
    rows = [
        Row(item.name, cells, key=key, order=case.number)
        for item, cells in zip(case.filters, zip(*columns, strict=True), strict=True)
    ]
    waiting = Words("no run yet", span=len(columns))
    return rows + [Row(name, (waiting,), key=key, order=case.number) for name in case.waiting]


def _above_best(ranking: Ranking, name: str) -> Cell:
    standing = ranking.of(name)
    if standing is None:
        return Words("no completed run", math.inf)
    if not standing.facts.observable:
        return Words("not observable", math.inf)
    if len(ranking.ranked) == 1:
        return Words("the only one", 0.0)
    if standing is ranking.best:
        return Words("best", 0.0, mark="best")
    if standing.against_best is None:
        return Words("no common run", math.inf)
    note, mark = "", ""
    if math.isnan(standing.percent.low):
        note = "too few runs to decide"
    elif not standing.told_apart:
        note, mark = "not told apart", "best"
    return replace(numbers([standing.percent])[0], note=note, mark=mark)
