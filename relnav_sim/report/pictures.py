"""Which figures a report shows: of the whole result, and of each case."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim import plots
from relnav_sim.plots.availability import has_outage
from relnav_sim.plots.conditions import events_of
from relnav_sim.plots.data import leading_filter
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.start import start_span
from relnav_sim.plots.sweep_points import grid_paths, varied_paths
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw, file_name
from relnav_sim.report.ranking import Ranking

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

FIGURES_OF_A_CASE = 7  # about, and one per filter
_ELLIPSE_SIGMA = 3.0
_WORTH_A_ZOOM = 0.6
_WORTH_A_SWEEP = 3
_WORTH_A_RANGE = 1.3


def overall_pictures(results: Results, rankings: Sequence[Ranking], folder: FigureFolder) -> Iterator[Picture]:
    """Yield the figures over all cases: their accuracy, and what the campaign varies as a trend or as a grid."""
    cases = [ranking.case for ranking in rankings if ranking.standings]
    if len(cases) < 2:
        return

    def accuracy() -> Drawing:
        figure = plots.accuracy_by_case(results, cases)
        return _described("cases", figure, cases)

    def sweep() -> Drawing | None:
        varied = varied_paths(results)
        numbers = [path for path, values in varied.items() if all(isinstance(value, float) for value in values)]
        if not any(len(set(varied[path])) >= _WORTH_A_SWEEP for path in numbers):
            return None
        path = max(numbers, key=lambda path: len(set(varied[path])))
        figure = plots.sweep_trend(results, cases[0], known=cases)
        return _described("sweep", figure, cases[0], path)

    def heat_map() -> Drawing | None:
        try:
            grid = grid_paths(results)
        except plots.FigureError:
            return None
        figure = plots.heat_map(results, cases=cases)
        return _described("heat_map", figure, cases[0], grid)

    yield from _drawn(folder, {"accuracy_by_case": accuracy, "sweep": sweep, "heat_map": heat_map})


def case_pictures(results: Results, ranking: Ranking, folder: FigureFolder, closely: bool) -> Iterator[Picture]:
    """Yield the figures of one case.

    Args:
        results: An opened result.
        ranking: The case.
        folder: Where the files go.
        closely: Whether to add the figures that one case is enough for: the trajectory, the runs to look at.
    """
    case = ranking.case
    start = f"case_{case.index:03d}"

    def rms() -> Drawing:
        figure = plots.rms_over_time(results, case)
        return _described("rms", figure, case)

    def consistency() -> Drawing:
        figure = plots.consistency_over_time(results, case)
        return _described("consistency", figure, case)

    def boxes() -> Drawing:
        figure = plots.box_plots(results, case)
        return _described("boxes", figure, case)

    def cost() -> Drawing | None:
        if len(ranking.standings) < 2:
            return None
        figure = plots.cost_against_accuracy(results, case)
        return _described("cost", figure, case)

    def errors(name: str) -> Drawing:
        figure = plots.errors_with_envelope(results, case, name)
        return _described("errors", figure, case, name)

    pieces: dict[str, Callable[[], Drawing | None]] = {"rms": rms}
    if closely:
        pieces["start"] = partial(_start, results, case)
    pieces |= {"consistency": consistency, "boxes": boxes, "cost": cost}
    pieces |= {"availability": partial(_availability, results, case)}
    pieces |= {"observability": partial(_observability, results, case)}
    pieces |= {"range": partial(_range, results, case), "events": partial(_events, results, case)}
    if ranking.standings and closely:
        pieces |= {"worst": partial(_worst, results, case), "trajectory": partial(_trajectory, results, case)}
    yield from _drawn(folder, {f"{start}_{name}": make for name, make in pieces.items()})
    for number, name in enumerate(case.names):
        yield from _drawn(folder, {f"{start}_errors_{file_name(name, number)}": partial(errors, name)}, name)
        if case.filter(name).by_channel is not None:
            whiteness = {f"{start}_whiteness_{file_name(name, number)}": partial(_whiteness, results, case, name)}
            yield from _drawn(folder, whiteness, name)
        if case.filter(name).in_full is not None:
            ellipses = {f"{start}_ellipses_{file_name(name, number)}": partial(_ellipses, results, case, name)}
            yield from _drawn(folder, ellipses, name)


def _described(kind: str, figure: Figure, *about: Any) -> Drawing:
    """Return a figure with the words of its kind."""
    words = plots.FIGURE_KINDS[kind].in_words(*about)
    return Drawing(figure, words.caption, words.alt)


def _drawn(
    folder: FigureFolder, pieces: Mapping[str, Callable[[], Drawing | None]], filter: str = ""
) -> Iterator[Picture]:
    for name, make in pieces.items():
        if (picture := draw(folder, name, make, filter)) is not None:
            yield picture


def _ellipses(results: Results, case: CaseFacts, name: str) -> Drawing:
    figure = plots.error_ellipses(results, case, name, axes=case.axes, sigma=_ELLIPSE_SIGMA)
    return _described("ellipses", figure, case, name, _ELLIPSE_SIGMA, True)


def _whiteness(results: Results, case: CaseFacts, name: str) -> Drawing:
    return _described("whiteness", plots.residual_whiteness(results, case, name), case, name)


def _start(results: Results, case: CaseFacts) -> Drawing | None:
    span = start_span(results, case)
    if span >= _WORTH_A_ZOOM * case.times_s[-1]:
        return None
    figure = plots.rms_over_time(results, case, until_s=span, at_start=True)
    return _described("start", figure, case, span)


def _range(results: Results, case: CaseFacts) -> Drawing | None:
    """Return the errors against the range where that varies enough."""
    settled = case.times_s >= case.settle_s
    ranges = np.linalg.norm(results.truth(case.index)[..., :3], axis=-1)
    ranges = ranges[:, settled if settled.any() else slice(None)]
    if not (ranges.min() > 0 and ranges.max() > _WORTH_A_RANGE * ranges.min()):
        return None
    return _described("range", plots.error_against_range(results, case), case)


def _availability(results: Results, case: CaseFacts) -> Drawing | None:
    """Return when sensors gave measurements, where there are several, or the only one has an outage."""
    if len(case.sensors) < 2 and not has_outage(case):
        return None
    return _described("availability", plots.availability_over_time(results, case), case)


def _observability(results: Results, case: CaseFacts) -> Drawing | None:
    if not any(item.observability for item in case.filters):
        return None
    return _described("observability", plots.observability_over_time(results, case), case)


def _events(results: Results, case: CaseFacts) -> Drawing | None:
    if not any(len(rows) for item in case.filters for rows in events_of(results, case, item).values()):
        return None
    return _described("events", plots.error_around_events(results, case), case)


def _worst(results: Results, case: CaseFacts) -> Drawing:
    name = leading_filter(case)
    figure = plots.worst_runs(results, case, name)
    return _described("worst", figure, case, name)


def _trajectory(results: Results, case: CaseFacts) -> Drawing:
    name = leading_filter(case)
    figure = plots.trajectory(results, case, [name], axes=case.axes)
    return _described("trajectory", figure, case, [name])
