"""What the formal covariances of a filter say with their correlations, where a result holds them whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from relnav_sim.arrays import Mask
from relnav_sim.plots.axes import Axes, turned_covariances, turned_states
from relnav_sim.statistics.formal_covariance import ByPart, Ensemble, ensemble_at

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

Span = TypeVar("Span", bound=str)

_RUNS_AT_ONCE = 100
"""Runs whose covariances are held in memory together."""


@dataclass(frozen=True)
class InFull:
    """The figures of one filter in the axes of the report; runs are the completed ones.

    Attributes:
        by_part: Consistency by axis and plane, by span.
        at_end: Formal against actual covariance at the last stored epoch; None for fewer than two runs.
    """

    by_part: Mapping[str, ByPart]
    at_end: Ensemble | None


def covariances_in_full(
    results: Results, index: int, name: str, axes: Axes, spans: Mapping[Span, Mask]
) -> InFull | None:
    """Return the figures of one filter; None where the result holds no covariances of it.

    Args:
        results: An opened result.
        index: The case's number from 0.
        name: The filter.
        axes: The axes of the report.
        spans: Which stored epochs belong to each span.
    """
    last = results.covariance(index, name, epochs=slice(-1, None))
    if last is None:
        return None
    ok = results.statistic(index, name, "failed") == 0
    error = turned_states(results.error(index, name), axes)
    parts: dict[Span, list[ByPart]] = {span: [] for span in spans}
    for first in range(0, len(error), _RUNS_AT_ONCE):
        rows = slice(first, first + _RUNS_AT_ONCE)
        whole = results.covariance(index, name, rows)
        assert whole is not None  # as the last epoch's
        covariance = turned_covariances(whole[ok[rows]], axes)
        for span, chosen in spans.items():
            parts[span].append(ByPart.of(error[rows][ok[rows]][:, chosen], covariance[:, chosen]))
    by_part: dict[str, ByPart] = {
        span: ByPart(*(np.concatenate([getattr(each, of) for each in own]) for of in ("anees", "coverage")))
        for span, own in parts.items()
    }
    return InFull(by_part, ensemble_at(error[ok, -1], turned_covariances(last[ok, 0], axes)))
