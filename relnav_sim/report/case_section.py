"""One case of a report, made on its own: cases of a large campaign are made by several processes at once."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from relnav_sim.plots.axes import Axes
from relnav_sim.plots.facts import case_facts
from relnav_sim.report import layouts
from relnav_sim.report.attempts import attempted
from relnav_sim.report.case_tables import case_table_makers
from relnav_sim.report.curves import case_curves
from relnav_sim.report.page import CaseSection
from relnav_sim.report.pictures import case_pictures
from relnav_sim.report.ranking import Ranking, rank
from relnav_sim.report.summary import verdict
from relnav_sim.report.tables import Table

_MOST_CASES_WITH_WHOLE_SPAN = 20
_NOT_DRAWN = (
    "The figures of this case were left out to keep the report small; its time series are in the chart above. "
    "A figure: relnav figure {result} errors --case {case}"
)
_STRESSED = "Flown under the stress {stress}, of which no filter is told; the section on regret compares its cases."


def compose_case(
    result_path: Path, index: int, axes: Axes, figure_folder: Path, drawn: bool, points: int, with_axes: bool
) -> tuple[Ranking, CaseSection]:
    """Return one case of a result: the order of its filters, and its section of the report.

    Args:
        result_path: The results file.
        index: The case's number from 0.
        axes: The axes of tables and figures.
        figure_folder: An existing folder for the figures' files.
        drawn: Whether to draw its figures.
        points: Most points of a curve of the page's chart.
        with_axes: Whether the chart shows errors per axis.
    """
    from relnav_sim.results.read import open_results

    with open_results(result_path) as results:
        ranking = rank(case_facts(results, index, axes))
        section = _section(ranking, len(results.headers))
        if stress := results.headers[index].stress:
            section = replace(section, notes=(_STRESSED.format(stress=stress), *section.notes))
        if not ranking.case.filters:
            return ranking, section
        missing = list(section.missing)
        curves = attempted("The chart", partial(case_curves, results, ranking.case, points, with_axes), missing)
        section = replace(section, curves=curves, missing=tuple(missing))
        if not drawn:
            note = _NOT_DRAWN.format(result=shlex.quote(result_path.name), case=results.headers[index].id)
            return ranking, replace(section, notes=(*section.notes, note))
        pictures = case_pictures(results, ranking, figure_folder, closely=index == 0)
        return ranking, replace(section, pictures=tuple(pictures))


def rank_cases(result_path: Path, indices: Sequence[int], axes: Axes) -> list[Ranking]:
    """Return the order of the filters in some cases of a result, by their numbers from 0."""
    from relnav_sim.results.read import open_results

    with open_results(result_path) as results:
        return [rank(case_facts(results, index, axes)) for index in indices]


def _section(ranking: Ranking, cases: int) -> CaseSection:
    case = ranking.case
    notes = [verdict(ranking)] if ranking.standings and cases > 1 else []
    if case.waiting:
        notes.append(f"No run yet of {', '.join(case.waiting)}.")
    if not case.filters:
        return CaseSection(case.number, case.label, tuple(notes), None, (), ())
    missing: list[str] = []

    def tables(makers: Mapping[str, Callable[[], Table | None]]) -> tuple[Table, ...]:
        made = [attempted(f"The table of {what}", make, missing) for what, make in makers.items()]
        return tuple(table for table in made if table is not None and table.rows)

    table = attempted("The table of errors", partial(layouts.case_table, case, case.span), missing)
    failures = tables({"failed runs": partial(layouts.failures_table, case)}) if case.failures else ()
    whole = {"errors over the whole span": partial(layouts.case_table, case, "whole")} if case.span == "settled" else {}
    other = tables({**case_table_makers(ranking), **whole})
    shown = cases <= _MOST_CASES_WITH_WHOLE_SPAN
    return CaseSection(
        number=case.number,
        label=case.label,
        notes=tuple(notes),
        table=table,
        pictures=(),
        more_tables=(*failures, *(other if shown else ())),
        file_tables=() if shown else other,
        missing=tuple(missing),
    )
