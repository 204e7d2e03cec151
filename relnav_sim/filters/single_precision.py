"""The Kalman filter in float32, its covariance held as such and updated in Joseph's form."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step, moves_by_transition
from relnav_sim.filters.arithmetic import ModelsInArithmetic
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states
from relnav_sim.linalg import SINGLE, by_run
from relnav_sim.measurements.interface import Measurement

_EPS = float(np.finfo(SINGLE).eps)

INDEFINITE = (
    "the covariance is not positive definite any more in float32; take ud_ekf, whose covariance can't lose that, or "
    "float64"
)


def joseph_in_single(x: Array, P: Array, residual: Array, H: Array, R: Array) -> tuple[Array, Array, Innovation]:
    """Return mean and covariance of the optimal update in float32, and the innovation.

    Args:
        x: Predicted means (runs, n), of float32 as all others.
        P: Their covariances (runs, n, n).
        residual: (runs, m).
        H: (runs or 1, m, n), or (m, n).
        R: (runs or 1, m, m), or (m, m).
    """
    x, P, residual = (np.ascontiguousarray(A, dtype=SINGLE) for A in (x, P, residual))
    x, P, nis, log_likelihood, lost = kernels.joseph.update_single(
        x, P, residual, by_run(H, SINGLE), by_run(R, SINGLE), _EPS
    )
    return x, P, Innovation(nis, log_likelihood, failed=dict.fromkeys(lost.tolist(), INDEFINITE))


@dataclass(frozen=True)
class SingleGaussian:
    """A Gaussian belief per run in float32: mean x (runs, n) and covariance P (runs, n, n)."""

    x: Array
    P: Array

    @property
    def mean(self) -> Array:
        """The mean (runs, n), in float64."""
        return self.x.astype(np.float64)

    @property
    def covariance(self) -> Array:
        """The covariance (runs, n, n), in float64."""
        return self.P.astype(np.float64)


class SinglePrecision:
    """Prediction and update of a filter with linearised models, in float32.

    The short form of the update, P - W^T W, loses as many digits as the prior is wider than the noise, and float32 has
    seven. So Joseph's form is taken throughout; a run whose covariance is not positive definite after it has failed.

    Args:
        dynamics: The filter's.
        measurement: The filter's.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement) -> None:
        self._dynamics = dynamics
        self._models = ModelsInArithmetic(dynamics, measurement, "float32")

    def own(self, belief: Gaussian | SingleGaussian) -> SingleGaussian:
        """Return a belief, rounded to float32."""
        return SingleGaussian(self._models.own(belief.mean), self._models.own(belief.covariance))

    def predict(self, belief: Gaussian | SingleGaussian, step: Step) -> SingleGaussian:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        prior, models = self.own(belief), self._models
        F, Q = models.matrices(prior.x, step)
        mean, P = kernels.kalman.predict_linear_single(prior.x, prior.P, F, Q)
        return SingleGaussian(mean if moves_by_transition(self._dynamics) else models.propagate(prior.x, step), P)

    def linearised(self, z: Array, belief: Gaussian | SingleGaussian, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual, H and R of a measurement at the mean, in float32."""
        return self._models.linearised(z, belief.mean, epoch)

    def joseph_update(
        self, belief: Gaussian | SingleGaussian, residual: Array, H: Array, R: Array
    ) -> tuple[SingleGaussian, Innovation]:
        """Return the optimal update."""
        prior = self.own(belief)
        return self._told(*joseph_in_single(prior.x, prior.P, residual, H, R))

    def lost(self, x: Array, P: Array) -> dict[int, str]:
        """Return why runs can't go on whose covariance is indefinite, or whose states are rounded by over a sigma."""
        # What is known has no pivot.
        C = P + (np.einsum("bii->bi", P) == 0)[:, :, None] * np.eye(P.shape[1], dtype=P.dtype)
        pivots, variances = (np.einsum("bii->bi", A) for A in (kernels.roots.cholesky_single(C)[0], C))
        sound = (np.square(pivots) > self._models.eps * variances).all(axis=1)
        failed = self._models.coarse(x, P.astype(np.float64))
        return failed | dict.fromkeys(np.flatnonzero(~sound).tolist(), INDEFINITE)

    def keep_considered(self, predicted: Gaussian | SingleGaussian, corrected: SingleGaussian) -> SingleGaussian:
        """Return an optimal update with the considered states as predicted, see `belief.keep_considered`."""
        places = list(considered_states(self._dynamics))
        if not places:
            return corrected
        prior, x, P = self.own(predicted), corrected.x.copy(), corrected.P.copy()
        x[:, places] = prior.x[:, places]
        block = np.ix_(range(len(x)), places, places)
        P[block] = prior.P[block]
        return SingleGaussian(x, P)

    def _told(self, x: Array, P: Array, innovation: Innovation) -> tuple[SingleGaussian, Innovation]:
        """Return an update and which runs can't go on, those of the innovation and those whose state is coarse."""
        corrected = SingleGaussian(x, P)
        failed = self._models.coarse(x, corrected.covariance) | dict(innovation.failed)
        return corrected, replace(innovation, failed=failed)
