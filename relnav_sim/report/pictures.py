"""Which figures a report shows: of the whole result, and of each case."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.report import captions, figures
from relnav_sim.report.drawing import Picture, draw, file_name
from relnav_sim.report.facts import CaseFacts
from relnav_sim.report.figures.conditions import events_of
from relnav_sim.report.figures.data import leading_filter
from relnav_sim.report.figures.start import start_span
from relnav_sim.report.figures.sweep_points import grid_paths, varied_paths
from relnav_sim.report.ranking import Ranking

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

FIGURES_OF_A_CASE = 6  # about, and one per filter
_WORTH_A_ZOOM = 0.6
_WORTH_A_SWEEP = 3
_WORTH_A_RANGE = 1.3


def overall_pictures(results: Results, rankings: Sequence[Ranking], folder: Path) -> Iterator[Picture]:
    """Yield the figures over all cases: their accuracy, and what the campaign varies as a trend or as a grid."""
    cases = [ranking.case for ranking in rankings if ranking.standings]
    if len(cases) < 2:
        return
    figure = figures.accuracy_by_case(results, cases)
    yield draw(folder, "accuracy_by_case", figure, captions.accuracy_caption(cases), captions.accuracy_alt(rankings))
    varied = varied_paths(results)
    numbers = [path for path, values in varied.items() if all(isinstance(value, float) for value in values)]
    if any(len(set(varied[path])) >= _WORTH_A_SWEEP for path in numbers):
        path = max(numbers, key=lambda path: len(set(varied[path])))
        figure = figures.sweep_trend(results, cases[0])
        yield draw(folder, "sweep", figure, captions.sweep_caption(path, cases[0]), captions.sweep_alt(path))
    try:
        grid = grid_paths(results)
    except ValueError:
        return
    figure = figures.heat_map(results)
    yield draw(folder, "heat_map", figure, captions.heat_map_caption(grid, cases[0]), captions.heat_map_alt(grid))


def case_pictures(results: Results, ranking: Ranking, folder: Path, closely: bool) -> Iterator[Picture]:
    """Yield the figures of one case.

    Args:
        results: An opened result.
        ranking: The case.
        folder: Where the files go.
        closely: Whether to add the figures that one case is enough for: the trajectory, the runs to look at.
    """
    case = ranking.case
    start = f"case_{case.number:03d}"
    figure = figures.rms_over_time(results, case)
    yield draw(folder, f"{start}_rms", figure, captions.rms_caption(case), captions.rms_alt(case, ranking))
    span = start_span(results, case)
    if closely and span < _WORTH_A_ZOOM * case.times_s[-1]:
        figure = figures.rms_over_time(results, case, until_s=span, at_start=True)
        yield draw(folder, f"{start}_start", figure, captions.start_caption(case, span), captions.start_alt(span))
    figure = figures.consistency_over_time(results, case)
    caption, alt = captions.consistency_caption(case), captions.consistency_alt(case)
    yield draw(folder, f"{start}_consistency", figure, caption, alt)
    figure = figures.box_plots(results, case)
    yield draw(folder, f"{start}_boxes", figure, captions.boxes_caption(case), captions.boxes_alt(case, ranking))
    if len(ranking.standings) > 1:
        figure = figures.cost_against_accuracy(results, case)
        yield draw(folder, f"{start}_cost", figure, captions.cost_caption(case), captions.cost_alt(case))
    yield from _conditions(results, case, folder, start)
    if ranking.standings and closely:
        yield from _closer(results, case, folder, start)
    for number, name in enumerate(case.names):
        file = f"{start}_errors_{file_name(name, number)}"
        figure = figures.errors_with_envelope(results, case, name)
        caption, alt = captions.errors_caption(case, name), captions.errors_alt(case, name, ranking)
        yield draw(folder, file, figure, caption, alt, filter=name)


def _conditions(results: Results, case: CaseFacts, folder: Path, start: str) -> Iterator[Picture]:
    """Yield the figures of range and events where there are any to speak of."""
    settled = case.times_s >= case.settle_s
    ranges = np.linalg.norm(results.truth(case.index)[..., :3], axis=-1)
    ranges = ranges[:, settled if settled.any() else slice(None)]
    if ranges.min() > 0 and ranges.max() > _WORTH_A_RANGE * ranges.min():
        figure = figures.error_against_range(results, case)
        yield draw(folder, f"{start}_range", figure, captions.range_caption(case), captions.RANGE_ALT)
    if any(len(rows) for item in case.filters for rows in events_of(results, case, item).values()):
        figure = figures.error_around_events(results, case)
        yield draw(folder, f"{start}_events", figure, captions.EVENTS_CAPTION, captions.EVENTS_ALT)


def _closer(results: Results, case: CaseFacts, folder: Path, start: str) -> Iterator[Picture]:
    name = leading_filter(case)
    figure = figures.worst_runs(results, case, name)
    yield draw(folder, f"{start}_worst", figure, captions.worst_caption(case, name), captions.worst_alt(case, name))
    figure = figures.trajectory(results, case, [name], axes=case.axes)
    caption, alt = captions.trajectory_caption(case, name), captions.trajectory_alt(case, name)
    yield draw(folder, f"{start}_trajectory", figure, caption, alt)
