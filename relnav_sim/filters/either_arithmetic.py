"""Filters whose update is written once for both arithmetics: it computes as the arrays do that it is given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import RoundedMeasurement
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states, in_kind, keep_considered
from relnav_sim.filters.kalman import GaussianFilter, GaussianFilterOptions
from relnav_sim.filters.single_precision import INDEFINITE
from relnav_sim.filters.square_root import NEEDS_NOISE, Whitener, not_definite
from relnav_sim.linalg import DOUBLE, SINGLE
from relnav_sim.measurements.interface import Measurement


class EitherArithmetic(GaussianFilter):
    """A Gaussian filter whose `correct` follows the type of its arrays.

    In float32 it is given a belief and measurements of float32, and measures by `seen`, whose numbers are rounded.
    Between epochs the belief lies in arrays of float64, as everything outside the filter has them; their numbers are
    ones of float32, so that nothing is rounded on the way.

    Attributes:
        seen: The measurement as the algorithm sees it.
        kind: The type of its arrays.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianFilterOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self.seen: Measurement = measurement if self._single is None else RoundedMeasurement(measurement)
        self.kind = DOUBLE if self._single is None else SINGLE

    def start(self, prior: Gaussian, source: Any) -> Any:
        """Return the prior."""
        return in_kind(in_kind(prior, self.kind), DOUBLE)

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        predicted = super().predict(belief, step)
        return predicted if self._single is None else Gaussian(predicted.mean, predicted.covariance)

    def update(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the corrected belief, its considered states as they were."""
        if self._single is None:
            return super().update(belief, z, step)
        corrected, innovation = super().update(in_kind(belief, SINGLE), np.ascontiguousarray(z, dtype=SINGLE), step)
        extras = {name: np.asarray(value, dtype=DOUBLE) for name, value in innovation.extras.items()}
        failed = self._single.lost(corrected.mean, corrected.covariance) | dict(innovation.failed)
        return in_kind(corrected, DOUBLE), replace(innovation, extras=extras, failed=failed)

    def without_digits(self, whitener: Whitener, R: Array) -> dict[int, str]:
        """Return why runs can't go on in float32: R (runs, m, m) or (m, m) is singular, or what was to be whitened.

        Float64 has ways of its own for them.
        """
        if self._single is None:
            return {}
        lost = ~np.isfinite(whitener.root.sum(axis=(1, 2)))
        failed = dict.fromkeys(np.flatnonzero(lost).tolist(), INDEFINITE)
        return failed | dict.fromkeys(np.flatnonzero(not_definite(R, len(lost))).tolist(), NEEDS_NOISE)

    def keep_considered(self, predicted: Any, corrected: Any) -> Any:
        """Return the corrected belief with the considered states as predicted."""
        return keep_considered(predicted, corrected, considered_states(self.dynamics))
