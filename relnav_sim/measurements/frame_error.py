"""Noise of a measurement that is given in axes which err: the orbit frame that a craft computes for itself."""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.linalg import in_rows, matrices
from relnav_sim.measurements.around import Around
from relnav_sim.measurements.interface import Measurement, Mixture, joint_components, linearised

_UPPER = np.triu_indices(6)
COLUMNS = len(_UPPER[0])
"""Numbers behind a measurement that tell the covariance of its frame."""


def with_frame(z: Array, covariance: Array) -> Array:
    """Return z (runs, K, m) with the frame's covariance (runs or 1, K, 6, 6) behind: (runs, K, m + COLUMNS)."""
    told = np.broadcast_to(covariance[..., *_UPPER], (*z.shape[:2], COLUMNS))
    return np.concatenate([z, told], axis=-1)


class FrameError(Around):
    """A measurement model for measurements in a frame with a white error.

    A frame turned by a small theta, with a rate that is off, moves the relative state (r, v) in it to r + r x theta,
    v + v x theta + r x phi (see `astro.frame_error`). With H the Jacobian and P the covariance of theta and phi,
    R grows by G P G^T, G = H [[r x], 0; [v x], [r x]]. For a sensor on the deputy that is right to |r| over the
    radius of the orbit.

    Args:
        base: The measurement in a frame without error; its state begins with position and velocity, RTN.
        covariance: P (6, 6), RTN, rad and rad/s; None: each measurement has its own behind it, from `with_frame`.
    """

    change = "the error of its host's frame"

    def __init__(self, base: Measurement, covariance: Array | None = None) -> None:
        super().__init__(base)
        self._constant = covariance
        self._told: Array | None = None
        self._first_epoch = 0

    def take(self, z: Array, first_epoch: int) -> Array:
        """Return the measurements (runs, K, m) without the covariances behind them, which are kept."""
        if self._constant is None:
            m = self.dimension
            told = np.empty((z.shape[1], z.shape[0], 6, 6))  # an epoch after the other in memory
            told[..., *_UPPER] = told[..., *_UPPER[::-1]] = z[..., m:].swapaxes(0, 1)
            self._told, self._first_epoch = told, first_epoch
            z = z[..., :m]
        return super().take(z, first_epoch)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the base's R and what the frame adds at `mean` (runs, n): (runs, m, m)."""
        return self.base.noise(mean, epoch) + self._added(self.base.jacobian(mean, epoch), mean, epoch)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n)."""
        residual, H, R = linearised(self.base, z, mean, epoch)
        return residual, H, R + self._added(H, mean, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the base's components, the frame's part added to each: (runs, k, m, m)."""
        mixture = self.base.mixture(mean, epoch)
        if mixture is None:
            return None
        weights, covariances = joint_components(mixture)
        added = self._added(self.base.jacobian(mean, epoch), mean, epoch)
        return Mixture(weights, covariances + added[:, None], shared=True)

    def _added(self, H: Array, mean: Array, epoch: int) -> Array:
        """Return G P G^T (runs, m, m); 0 before the first measurements, when filters may ask for the components."""
        if self._constant is not None:
            P = self._constant
        elif self._told is not None:
            P = self._told[epoch - self._first_epoch]
        else:
            P = np.zeros((6, 6))
        return frame_noise(H, mean, P)


def frame_noise(H: Array, states: Array, covariance: Array) -> Array:
    """Return G P G^T (runs, m, m), what an error of the frame adds to R.

    Args:
        H: Jacobian of a measurement, (m, n) or (runs, m, n).
        states: Where it is taken, (runs, n).
        covariance: P, (6, 6) or (runs, 6, 6).
    """
    return kernels.frame_error.added(matrices(H), in_rows(states), matrices(covariance))
