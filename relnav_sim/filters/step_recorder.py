"""A filter that takes down, as it predicts, the linear steps that a smoother goes back by."""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian, Innovation
from relnav_sim.filters.segments import Segment
from relnav_sim.streams import RandomSource


class StepRecorder:
    """A filter as it is, with its steps taken down.

    Dynamics may be fed what arrives during a run, and a process noise may be found during it, so that nobody can ask
    for a step any more once the run is over.

    Args:
        filter: The filter; it has `linear_step`, as every Gaussian filter does.
    """

    def __init__(self, filter: Filter) -> None:
        self.dynamics, self.measurement, self.stochastic = filter.dynamics, filter.measurement, filter.stochastic
        self._filter = filter
        self._steps: list[tuple[Array, Array, Array]] = []

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the filter's start."""
        return self._filter.start(prior, source)

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the filter's prediction."""
        predicted = self._filter.predict(belief, step)
        F, Q = self._filter.linear_step(belief, step)  # type: ignore[attr-defined]  # said above
        # In float64, as the smoother goes, whatever the filter computes in.
        self._steps.append((np.asarray(predicted.mean, dtype=np.float64), F, Q))
        return predicted

    def update(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the filter's update."""
        return self._filter.update(belief, z, step)

    def segment(self, before: Gaussian, mean: Array, covariance: Array) -> Segment:
        """Return the epochs predicted since the last call.

        Args:
            before: One epoch before the first.
            mean: Filtered, (runs, K, n); where they are one more than the steps, the first is the start itself.
            covariance: (runs, K, n, n).
        """
        images, transitions, noises = zip(*self._steps, strict=True)
        self._steps = []
        means, covariances = (np.ascontiguousarray(series.swapaxes(0, 1)) for series in (mean, covariance))
        matrices = covariances.shape[1:]
        image = np.stack(images)
        F, Q = (np.stack([np.broadcast_to(A, matrices) for A in each]) for each in (transitions, noises))
        if len(image) < len(means):
            # Of the step to the start nothing is known, and nothing asked.
            image, F, Q = (np.concatenate([A[:1], A]) for A in (image, F, Q))
        return Segment(before, means, covariances, image, F, Q)
