"""The numbers of a replay, filter by filter, that its page and its terminal output show."""

from __future__ import annotations

from dataclasses import dataclass

from relnav_sim.simulation.replayed import Replay, ReplayedFilter
from relnav_sim.statistics.residual_checks import FilterChecks, filter_checks
from relnav_sim.statistics.scores import Scores, scores


@dataclass(frozen=True)
class FilterFigures:
    """What is said of one filter.

    Attributes:
        name: Its name.
        replayed: What it said.
        checks: What its residuals say about it.
        scores: Its errors; None where the truth is not known.
    """

    name: str
    replayed: ReplayedFilter
    checks: FilterChecks
    scores: Scores | None


def figures_of(replay: Replay) -> list[FilterFigures]:
    """Return the numbers of every filter that ran through."""
    return [_figures(replay, name, one) for name, one in replay.block.filters.items()]


def _figures(replay: Replay, name: str, one: ReplayedFilter) -> FilterFigures:
    residuals = {sensor: (each.accepted, each.sigma) for sensor, each in one.residuals.items()}
    nis = {sensor: (one.nis[sensor], one.dof[sensor]) for sensor in one.nis}
    checks = filter_checks(one.channels, residuals, nis, one.smoothed_change, one.names)
    results = [result.filters[name] for result in replay.block.results if name in result.filters]
    return FilterFigures(name, one, checks, scores(results) if results else None)
