"""All cases and filters in one table, a row each, with the figures that decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from relnav_sim.plots.facts import CaseFacts
from relnav_sim.report.decision_table import NO_DIFFERENCE_THAT_MATTERS
from relnav_sim.report.layouts import reading_notes
from relnav_sim.report.metrics import (
    ANEES,
    CONVERGENCE,
    CPU,
    FAILED,
    POSITION_RMS,
    TIMES_BOUND,
    VELOCITY_RMS,
    Metric,
    nis_metric,
    numbers,
)
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.results.case_names import case_in_tables
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval
from relnav_sim.wording import short_labels

_ABOVE_BEST = Column("RMS above the best [%]")
_ERRORS = (POSITION_RMS, VELOCITY_RMS)


def overview_table(rankings: Sequence[Ranking]) -> Table:
    """Return one row per case and filter with the headline figures; without a column of cases if there is one."""
    cases = [ranking.case for ranking in rankings]
    bounded = any(math.isfinite(item.times_bound[case.span].estimate) for case in cases for item in case.filters)
    others = [TIMES_BOUND, CONVERGENCE, ANEES, nis_metric(cases), CPU, FAILED]
    at_once = all(case.converged_at_once for case in cases)
    left_out = [*([] if bounded else [TIMES_BOUND]), *([CONVERGENCE] if at_once else [])]
    others = [metric for metric in others if metric not in left_out]
    columns = [*map(_column, _ERRORS), _ABOVE_BEST, *map(_column, others)]
    if len(cases) > 1:
        headings = [
            case_in_tables(c.index, label)
            for c, label in zip(cases, short_labels([c.label for c in cases]), strict=True)
        ]
        columns.insert(0, Column("filter", numeric=False))
        rows = [
            replace(
                row,
                label=f"{ranking.case.index}" if place else heading,
                cells=(Words(row.label), *row.cells),
                opens_block=not place,
                record=heading,
            )
            for ranking, heading in zip(rankings, headings, strict=True)
            for place, row in enumerate(_rows(ranking, others))
        ]
    else:
        rows = [replace(row, order=None) for ranking in rankings for row in _rows(ranking, others)]
    over = over_in_words(cases)
    above = "Above the best: relative difference on the same runs."
    above += (
        " RMS / bound: root mean squares over all runs and stored epochs, of the error and of the Cramér-Rao bound "
        "of a perfect model with the filter's sensors; none for a filter that diverged in half of its runs or more."
        if bounded
        else ""
    )
    if bounded and any(item.known_when for case in cases for item in case.filters):
        above += " The bound is that of filters in flight; what is known only later may lie below it."
    return Table(
        name="overview",
        title="All cases and filters" if len(cases) > 1 else "All filters",
        caption=" ".join([f"RMS, ANEES and NIS over {over}.", *reading_notes(cases, axes=False), above]),
        corner="case" if len(cases) > 1 else "filter",
        columns=tuple(columns),
        rows=tuple(rows),
        sortable=True,
        stacks=True,
    )


def over_in_words(cases: Sequence[CaseFacts]) -> str:
    """Return the headline span of cases in words."""
    spans = {case.when for case in cases}
    return spans.pop() if len(spans) == 1 else "the steady state of each case"


def _rows(ranking: Ranking, others: Sequence[Metric]) -> list[Row]:
    """Return a row per filter of a case, headed by the filter's name; figures of one column share their decimals."""
    case = ranking.case
    columns = (
        *(metric.row(case, case.span) for metric in _ERRORS),
        [_above_best(ranking, item.name) for item in case.filters],
        *(metric.row(case, case.span) for metric in others),
    )
    key = str(case.index)
    rows = [
        Row(item.name, cells, key=key, order=case.index)
        for item, cells in zip(case.filters, zip(*columns, strict=True), strict=True)
    ]
    waiting = Words("no run yet", span=len(columns))
    return rows + [Row(name, (waiting,), key=key, order=case.index) for name in case.waiting]


def _column(metric: Metric) -> Column:
    return Column(metric.heading, numeric=metric.numeric)


def _above_best(ranking: Ranking, name: str) -> Cell:
    standing = ranking.of(name)
    if standing is None:
        return Words("no completed run", math.inf)
    if not standing.facts.observable:
        return Words("not observable", math.inf)
    if standing in ranking.known_later:
        return Words(f"known {standing.facts.known_when}", math.inf)
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
        pair, margin = _simultaneous(ranking, name), ranking.case.matters_percent
        within = abs(pair.low) < margin and abs(pair.high) < margin
        note, mark = NO_DIFFERENCE_THAT_MATTERS if within else "no significant difference", "best"
    return replace(numbers([standing.percent])[0], note=note, mark=mark)


def _simultaneous(ranking: Ranking, name: str) -> Interval:
    """Return by how many percent a filter lies above the best, with the interval that holds for all pairs together."""
    found = (pair.simultaneous for pair in ranking.position if (pair.first, pair.second) == (name, ranking.best.name))
    return next(found, NO_INTERVAL)
