"""Which figures a report shows: of the whole result, and of each case."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim import plots
from relnav_sim.plots.conditions import events_of
from relnav_sim.plots.data import leading_filter
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.start import start_span
from relnav_sim.plots.sweep_points import grid_paths, varied_paths
from relnav_sim.report import captions
from relnav_sim.report.drawing import Drawing, Picture, draw, file_name
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

    def accuracy() -> Drawing:
        figure = plots.accuracy_by_case(results, cases)
        return Drawing(figure, captions.accuracy_caption(cases), captions.accuracy_alt(rankings))

    def sweep() -> Drawing | None:
        varied = varied_paths(results)
        numbers = [path for path, values in varied.items() if all(isinstance(value, float) for value in values)]
        if not any(len(set(varied[path])) >= _WORTH_A_SWEEP for path in numbers):
            return None
        path = max(numbers, key=lambda path: len(set(varied[path])))
        figure = plots.sweep_trend(results, cases[0])
        return Drawing(figure, captions.sweep_caption(path, cases[0]), captions.sweep_alt(path))

    def heat_map() -> Drawing | None:
        try:
            grid = grid_paths(results)
        except plots.FigureError:
            return None
        figure = plots.heat_map(results)
        return Drawing(figure, captions.heat_map_caption(grid, cases[0]), captions.heat_map_alt(grid))

    yield from _drawn(folder, {"accuracy_by_case": accuracy, "sweep": sweep, "heat_map": heat_map})


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

    def rms() -> Drawing:
        figure = plots.rms_over_time(results, case)
        return Drawing(figure, captions.rms_caption(case), captions.rms_alt(case, ranking))

    def consistency() -> Drawing:
        figure = plots.consistency_over_time(results, case)
        return Drawing(figure, captions.consistency_caption(case), captions.consistency_alt(case))

    def boxes() -> Drawing:
        figure = plots.box_plots(results, case)
        return Drawing(figure, captions.boxes_caption(case), captions.boxes_alt(case, ranking))

    def cost() -> Drawing | None:
        if len(ranking.standings) < 2:
            return None
        figure = plots.cost_against_accuracy(results, case)
        return Drawing(figure, captions.cost_caption(case), captions.cost_alt(case))

    def errors(name: str) -> Drawing:
        figure = plots.errors_with_envelope(results, case, name)
        return Drawing(figure, captions.errors_caption(case, name), captions.errors_alt(case, name, ranking))

    pieces: dict[str, Callable[[], Drawing | None]] = {"rms": rms}
    if closely:
        pieces["start"] = partial(_start, results, case)
    pieces |= {"consistency": consistency, "boxes": boxes, "cost": cost}
    pieces |= {"range": partial(_range, results, case), "events": partial(_events, results, case)}
    if ranking.standings and closely:
        pieces |= {"worst": partial(_worst, results, case), "trajectory": partial(_trajectory, results, case)}
    yield from _drawn(folder, {f"{start}_{name}": make for name, make in pieces.items()})
    for number, name in enumerate(case.names):
        yield from _drawn(folder, {f"{start}_errors_{file_name(name, number)}": partial(errors, name)}, name)


def _drawn(folder: Path, pieces: Mapping[str, Callable[[], Drawing | None]], filter: str = "") -> Iterator[Picture]:
    for name, make in pieces.items():
        if (picture := draw(folder, name, make, filter)) is not None:
            yield picture


def _start(results: Results, case: CaseFacts) -> Drawing | None:
    span = start_span(results, case)
    if span >= _WORTH_A_ZOOM * case.times_s[-1]:
        return None
    figure = plots.rms_over_time(results, case, until_s=span, at_start=True)
    return Drawing(figure, captions.start_caption(case, span), captions.start_alt(span))


def _range(results: Results, case: CaseFacts) -> Drawing | None:
    """Return the errors against the range where that varies enough."""
    settled = case.times_s >= case.settle_s
    ranges = np.linalg.norm(results.truth(case.index)[..., :3], axis=-1)
    ranges = ranges[:, settled if settled.any() else slice(None)]
    if not (ranges.min() > 0 and ranges.max() > _WORTH_A_RANGE * ranges.min()):
        return None
    return Drawing(plots.error_against_range(results, case), captions.range_caption(case), captions.RANGE_ALT)


def _events(results: Results, case: CaseFacts) -> Drawing | None:
    if not any(len(rows) for item in case.filters for rows in events_of(results, case, item).values()):
        return None
    return Drawing(plots.error_around_events(results, case), captions.EVENTS_CAPTION, captions.EVENTS_ALT)


def _worst(results: Results, case: CaseFacts) -> Drawing:
    name = leading_filter(case)
    figure = plots.worst_runs(results, case, name)
    return Drawing(figure, captions.worst_caption(case, name), captions.worst_alt(case, name))


def _trajectory(results: Results, case: CaseFacts) -> Drawing:
    name = leading_filter(case)
    figure = plots.trajectory(results, case, [name], axes=case.axes)
    return Drawing(figure, captions.trajectory_caption(case, name), captions.trajectory_alt(case, name))
