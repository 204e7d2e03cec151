"""A start that is fitted to the first measurements, which the filter then does not get."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.batch_least_squares import BatchLeastSquares, BatchOptions
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.filters.ekf import ExtendedKalmanFilter, ExtendedOptions
from relnav_sim.filters.passes import last_pass
from relnav_sim.filters.run import FilterHistory, advance
from relnav_sim.streams import RandomSource


@dataclass(frozen=True)
class FittedStart:
    """A start fitted to the measurements of the first epochs.

    Attributes:
        mean: At epoch 0 and the K epochs after, (runs, 1 + K, n): without measurements until the last of them, where
            the fit is there.
        covariance: (runs, 1 + K, n, n).
        unfit: Why runs have no fit, by place; they are NaN.
    """

    mean: Array
    covariance: Array
    unfit: Mapping[int, str]

    @property
    def end(self) -> Gaussian:
        """What the filter starts from, at the last of the epochs."""
        return Gaussian(self.mean[:, -1].copy(), self.covariance[:, -1].copy())


def fitted_start(
    filter: Filter, z: Mapping[str, Array], start: Gaussian, source: RandomSource, step_s: float
) -> FittedStart:
    """Return the fit of the measurements z of the epochs from 1 on, by the filter's own models without process noise.

    Args:
        filter: The filter, which is not used itself.
        z: Measurements of K epochs by sensor, (runs, K, m).
        start: What is known at epoch 0.
        source: Seed and runs.
        step_s: Time between epochs, s.
    """
    fit = BatchLeastSquares(filter.dynamics, filter.measurement, BatchOptions())

    def go(begin: Any) -> tuple[Any, FilterHistory]:
        return advance(fit, begin, z, 1, step_s)

    begin = last_pass(fit, fit.start(start, source), lambda begin: go(begin)[0])
    history = go(begin)[1]
    unfit = {one.run: f"{one.reason} at epoch {one.epoch}" for one in history.failures} | fit.unfit(begin)
    unfit = {place: f"no start could be fitted: {reason}" for place, reason in unfit.items()}
    unread = {name: np.full_like(readings, np.nan) for name, readings in z.items()}
    unaided = ExtendedKalmanFilter(filter.dynamics, filter.measurement, ExtendedOptions())
    waiting = advance(unaided, start, unread, 1, step_s)[1]
    waiting = waiting.after(start.mean[:, None], start.covariance[:, None])
    mean, covariance = waiting.mean.copy(), waiting.covariance.copy()
    mean[:, -1], covariance[:, -1] = history.mean[:, -1], history.covariance[:, -1]
    places = list(unfit)
    mean[places], covariance[places] = np.nan, np.nan
    return FittedStart(mean, covariance, unfit)
