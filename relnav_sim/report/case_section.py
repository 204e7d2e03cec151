"""One case of a report, made on its own: cases of a large campaign are made by several processes at once."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from relnav_sim.plots.axes import Axes
from relnav_sim.plots.budget import error_budget_over_time, error_budget_words
from relnav_sim.plots.facts import case_facts
from relnav_sim.report import layouts
from relnav_sim.report.attempts import attempted
from relnav_sim.report.case_tables import case_table_makers
from relnav_sim.report.curves import case_curves
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
from relnav_sim.report.editing_table import editing_notes
from relnav_sim.report.error_budget import MOST_BUDGETS, budget_section
from relnav_sim.report.evidence import acceptable_first
from relnav_sim.report.garbage import collected_rarely
from relnav_sim.report.opened import Opened
from relnav_sim.report.page import CaseSection
from relnav_sim.report.pictures import case_pictures
from relnav_sim.report.ranking import Ranking, rank
from relnav_sim.report.summary import verdict
from relnav_sim.report.tables import Table
from relnav_sim.report.whiteness_table import untested_residuals
from relnav_sim.results.settings import case_setting

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_MOST_CASES_WITH_WHOLE_SPAN = 20
_NOT_DRAWN = (
    "The figures of this case are omitted to keep the report small; its time series are in the chart above. "
    "A figure: relnav figure {result} errors --case {case}"
)
_NO_BUDGET = (
    "No error budget of this case, because the report shows more than {most} of them closely; "
    "it is: relnav budget CAMPAIGN --case {case} --result {result}"
)
_STRESSED = "Flown under the stress {stress}, of which no filter is told; the section on regret compares its cases."


@collected_rarely()
def compose_case(
    opened: Opened,
    index: int,
    axes: Axes,
    figure_folder: FigureFolder,
    drawn: bool,
    points: int,
    with_axes: bool,
    budgeted: bool,
) -> tuple[Ranking, CaseSection]:
    """Return one case of a result: the order of its filters, and its section of the report.

    Args:
        opened: The result.
        index: The case's number from 0.
        axes: The axes of tables and figures.
        figure_folder: Where the figures' files go.
        drawn: Whether to draw its figures.
        points: Most points of a curve of the page's chart.
        with_axes: Whether the chart shows errors per axis.
        budgeted: Whether to compute the error budget of its best filter.
    """
    results = opened.results
    ranking = rank(case_facts(results, index, axes))
    section = _section(ranking, len(results.headers))
    if stress := results.headers[index].stress:
        section = replace(section, notes=(_STRESSED.format(stress=stress), *section.notes))
    if not ranking.case.filters:
        return ranking, section
    asked = case_setting(results, index, "statistics.whiteness", False)
    if asked and all(item.by_channel is None for item in ranking.case.filters):  # so there is no table to say it
        section = replace(section, notes=(*section.notes, untested_residuals(ranking.case)))
    missing = list(section.missing)
    curves = attempted("The chart", partial(case_curves, results, ranking.case, points, with_axes), missing)
    section = replace(section, curves=curves, missing=tuple(missing))
    section, budget_pictures = _with_budget(results, ranking, section, figure_folder, drawn, budgeted)
    if not drawn:
        note = _NOT_DRAWN.format(result=shlex.quote(results.path.name), case=results.headers[index].id)
        return ranking, replace(section, notes=(*section.notes, note))
    pictures = case_pictures(results, ranking, figure_folder, closely=index == 0)
    return ranking, replace(section, pictures=(*pictures, *budget_pictures))


def _with_budget(
    results: Results, ranking: Ranking, section: CaseSection, figure_folder: FigureFolder, drawn: bool, budgeted: bool
) -> tuple[CaseSection, tuple[Picture, ...]]:
    """Return the section with the error budget of the best filter that has one, and its figure."""
    case = ranking.case
    if not ranking.standings or results.replay is not None:
        return section, ()
    if not budgeted:
        note = _NO_BUDGET.format(most=MOST_BUDGETS, case=case.index, result=shlex.quote(results.path.name))
        return replace(section, notes=(*section.notes, note)), ()
    missing = list(section.missing)
    ranked = acceptable_first(ranking)
    found = attempted("The error budget", partial(budget_section, results, case, ranked), missing)
    if found is None or isinstance(found, str):
        notes = section.notes if found is None else (*section.notes, found)
        return replace(section, notes=notes, missing=tuple(missing)), ()
    tables = (*section.more_tables, *found.tables) if section.more_tables else ()
    files = section.file_tables if tables else (*section.file_tables, *found.tables)
    section = replace(section, notes=(*section.notes, found.note), more_tables=tables, file_tables=files)
    if not drawn:
        return section, ()
    words = error_budget_words(found.curves)
    picture = draw(
        figure_folder,
        f"case_{case.index:03d}_budget",
        lambda: Drawing(error_budget_over_time(found.curves), words.caption, words.alt),
        found.curves.filter,
    )
    return section, () if picture is None else (picture,)


def budget_table(section: CaseSection) -> Table | None:
    """Return the error budget by source of a case; None where it has none."""
    name = f"case_{section.index:03d}_budget"
    return next((table for table in (*section.more_tables, *section.file_tables) if table.name == name), None)


def rank_cases(opened: Opened, indices: Sequence[int], axes: Axes) -> list[Ranking]:
    """Return the order of the filters in some cases of a result, by their numbers from 0."""
    return [rank(case_facts(opened.results, index, axes)) for index in indices]


def _section(ranking: Ranking, cases: int) -> CaseSection:
    case = ranking.case
    notes = [verdict(ranking)] if ranking.standings and cases > 1 else []
    if case.waiting:
        notes.append(f"No run yet of {', '.join(case.waiting)}.")
    notes.extend(editing_notes(case))
    if not case.filters:
        return CaseSection(case.index, case.label, tuple(notes), None, (), ())
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
        index=case.index,
        label=case.label,
        notes=tuple(notes),
        table=table,
        pictures=(),
        more_tables=(*failures, *(other if shown else ())),
        file_tables=() if shown else other,
        missing=tuple(missing),
    )
