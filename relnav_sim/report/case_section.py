"""One case of a report, made on its own: cases of a large campaign are made by several processes at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.report import captions, figures, layouts
from relnav_sim.report.axes import Axes
from relnav_sim.report.case_tables import all_case_tables
from relnav_sim.report.drawing import Picture, draw, file_name
from relnav_sim.report.facts import case_facts
from relnav_sim.report.page import CaseSection
from relnav_sim.report.ranking import Ranking, rank
from relnav_sim.report.summary import verdict

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_MOST_CASES_WITH_WHOLE_SPAN = 20
_NOT_DRAWN = "The figures of this case were left out to keep the report small; relnav_sim.report.figures draws them."


def compose_case(
    result_path: Path, index: int, axes: Axes, figure_folder: Path, drawn: bool
) -> tuple[Ranking, CaseSection]:
    """Return one case of a result: the order of its filters, and its section of the report.

    Args:
        result_path: The results file.
        index: The case's number from 0.
        axes: The axes of tables and figures.
        figure_folder: An existing folder for the figures' files.
        drawn: Whether to draw its figures.
    """
    from relnav_sim.results.read import open_results

    with open_results(result_path) as results:
        ranking = rank(case_facts(results, index, axes))
        section = _section(ranking, len(results.headers))
        if not ranking.case.filters:
            return ranking, section
        if not drawn:
            return ranking, replace(section, notes=(*section.notes, _NOT_DRAWN))
        return ranking, replace(section, pictures=tuple(_pictures(results, ranking, figure_folder)))


def _section(ranking: Ranking, cases: int) -> CaseSection:
    case = ranking.case
    notes = [verdict(ranking)] if ranking.standings and cases > 1 else []
    if case.waiting:
        notes.append(f"No run yet of {', '.join(case.waiting)}.")
    if not case.filters:
        return CaseSection(case.number, case.label, tuple(notes), None, (), ())
    failures = [layouts.failures_table(case)] if case.failures else []
    other = [*all_case_tables(ranking)] + ([layouts.case_table(case, "whole")] if case.span == "settled" else [])
    shown = cases <= _MOST_CASES_WITH_WHOLE_SPAN
    return CaseSection(
        number=case.number,
        label=case.label,
        notes=tuple(notes),
        table=layouts.case_table(case, case.span),
        pictures=(),
        more_tables=(*failures, *(other if shown else [])),
        file_tables=() if shown else tuple(other),
    )


def _pictures(results: Results, ranking: Ranking, folder: Path) -> Iterator[Picture]:
    case = ranking.case
    start = f"case_{case.number:03d}"
    figure = figures.rms_over_time(results, case)
    yield draw(folder, f"{start}_rms", figure, captions.rms_caption(case), captions.rms_alt(case, ranking))
    figure = figures.box_plots(results, case)
    yield draw(folder, f"{start}_boxes", figure, captions.boxes_caption(case), captions.boxes_alt(case, ranking))
    for number, name in enumerate(case.names):
        file = f"{start}_errors_{file_name(name, number)}"
        figure = figures.errors_with_envelope(results, case, name)
        yield draw(folder, file, figure, captions.errors_caption(case, name), captions.errors_alt(case, name, ranking))
