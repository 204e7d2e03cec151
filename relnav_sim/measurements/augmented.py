"""What is measured of an augmented state [x; b]: the base's measurement, distorted by the augmented states b."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.linalg import images, matrices
from relnav_sim.measurements.around import Around
from relnav_sim.measurements.interface import Measurement, Mixture


class Distortion(Protocol):
    """What augmented states b (..., e) do to a measurement.

    Attributes:
        sees: The numbers, from 0, of the augmented states that the measurement depends on.
        turns: The small turn of the host about the sensor's axes, T b, (3, e), that comes on top through the base's own
            ``turning(x, epoch)``, linear in b; None: it is in `apply`, or there is none.
    """

    sees: tuple[int, ...]
    turns: Array | None

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return the measurement (..., m) that takes the place of the error-free `predicted` (..., m)."""
        ...

    def jacobian(self, predicted: Array, extra: Array) -> tuple[Array | None, Array]:
        """Return its derivatives by `predicted`, (..., m, m), or None for I, and by `extra`, (..., m, e)."""
        ...


class AdditiveBias:
    """A measurement off by C b, and by a small turn T b of the host.

    Args:
        matrix: C, (m, e).
        turns: T, (3, e), rad; None: the host does not turn.
    """

    def __init__(self, matrix: ArrayLike, turns: Array | None = None) -> None:
        self._C = np.array(matrix, dtype=float, order="C")
        self.turns = turns if turns is not None and turns.any() else None
        felt = self._C.any(axis=0) if self.turns is None else self._C.any(axis=0) | self.turns.any(axis=0)
        self.sees = tuple(np.flatnonzero(felt).tolist())

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return predicted + C b."""
        return predicted + images(self._C, extra)

    def jacobian(self, predicted: Array, extra: Array) -> tuple[None, Array]:
        """Return None (I) and C."""
        return None, self._C


class AugmentedMeasurement(Around):
    """A measurement of [x; b]: what the base measures of x, distorted by the augmented states.

    Args:
        base: What is measured of x, with its noise.
        states: Number of states n of x.
        distortion: What b does to the measurement.
    """

    change = "what augmented states do to a measurement"

    def __init__(self, base: Measurement, states: int, distortion: Distortion) -> None:
        super().__init__(base)
        self._n = states
        self._distortion = distortion
        self.states = None  # those of x are not all that there are
        seen = self.depends_on
        self.depends_on = (
            *(range(states) if seen is None else seen),
            *(states + place for place in distortion.sees),
        )

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the distorted measurements of states (runs, ..., n + e)."""
        x, b = self._split(states)
        return self._distorted(x, b, self.base.predict(x, epoch), epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives by [x; b], (runs, ..., m, n + e), or (m, n + e) where they are constant."""
        x, b = self._split(states)
        return self._jacobian(x, b, self.base.predict(x, epoch), epoch)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n + e)."""
        x, b = self._split(mean)
        predicted = self.base.predict(x, epoch)
        H = self._jacobian(x, b, predicted, epoch)
        return self.base.residual(z, self._distorted(x, b, predicted, epoch)), H, self.base.noise(x, epoch)

    def _split(self, states: Array) -> tuple[Array, Array]:
        """Return x and b, in C order."""
        return np.ascontiguousarray(states[..., : self._n]), np.ascontiguousarray(states[..., self._n :])

    def _distorted(self, x: Array, b: Array, predicted: Array, epoch: int) -> Array:
        reading = self._distortion.apply(predicted, b)
        by_turns = self._by_turns(x, epoch)
        return reading if by_turns is None else reading + np.einsum("...ij,...j->...i", by_turns, b)

    def _jacobian(self, x: Array, b: Array, predicted: Array, epoch: int) -> Array:
        """Return the derivatives by [x; b], (runs, ..., m, n + e), or (m, n + e) where they are constant."""
        H = self.base.jacobian(x, epoch)
        by_predicted, by_extra = self._distortion.jacobian(predicted, b)
        by_turns = self._by_turns(x, epoch)
        if by_turns is not None:
            by_extra = by_extra + by_turns
        if by_predicted is not None:
            whole = kernels.maps.chained(matrices(by_predicted), matrices(H), matrices(by_extra))
            return whole.reshape(*predicted.shape, whole.shape[-1])
        leading = H.shape[:-2] if by_extra.ndim == 2 else np.broadcast_shapes(H.shape[:-2], by_extra.shape[:-2])
        whole = np.empty((*leading, self.dimension, H.shape[-1] + by_extra.shape[-1]))
        whole[..., : self._n] = H
        whole[..., self._n :] = by_extra
        return whole

    def _by_turns(self, x: Array, epoch: int) -> Array | None:
        """Return what the augmented states do to the measurement by turning the host, (runs, ..., m, e)."""
        if self._distortion.turns is None:
            return None
        return np.asarray(self.turning(x, epoch) @ self._distortion.turns)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the base's R at x."""
        return self.base.noise(np.ascontiguousarray(mean[..., : self._n]), epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the base's mixture at x."""
        return self.base.mixture(np.ascontiguousarray(mean[..., : self._n]), epoch)
