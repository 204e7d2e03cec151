"""Iterated extended Kalman filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.gauss_newton import IterationOptions, gauss_newton, jacobian_of_runs, times
from relnav_sim.filters.kalman import GaussianFilter, joseph_update
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import Whitener, semidefinite_solve
from relnav_sim.linalg import symmetric, transpose
from relnav_sim.measurements.interface import Measurement

Array = NDArray[np.float64]


@register_filter("iekf", IterationOptions, cost_us=8.0, overhead_us=720.0)
class IteratedExtendedKalmanFilter(GaussianFilter):
    """Iterated extended Kalman filter: the maximum of the posterior, by Gauss-Newton with a line search.

    Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.3; Bell and Cathey (1993). Use it when the
    prior is wide against the range, at start-up above all: it converges where the extended filter diverges, at two
    to three times the cost. The covariance is Joseph's at the maximum.

    Limits: NIS and log-likelihood are those of the linearisation at the prediction, as in the extended filter.
    Noise that depends on the state is taken at the prediction. Only a local maximum is sought.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: IterationOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the mode of the posterior, the covariance of its linearisation there, and the innovation."""
        measurement, epoch, m, P = self.measurement, step.epoch, belief.mean, belief.covariance
        R = measurement.noise(m, epoch)
        noise = Whitener(np.broadcast_to(R, (len(m), *R.shape[-2:])))
        prior = Whitener(P)
        residual = measurement.residual(z, measurement.predict(m, epoch))
        H = jacobian_of_runs(measurement, m, epoch)
        _, innovation = joseph_update(belief, residual, H, R)
        misfit = _ExactMisfit(noise, H @ P @ transpose(H), innovation) if noise.has_exact else None

        # All in deviations from m: a tight prior needs their digits.
        def evaluate(deviation: Array) -> tuple[Array, Array]:
            residual = measurement.residual(z, measurement.predict(m + deviation, epoch))
            cost = prior.squared(deviation) + noise.squared(residual)
            return cost if misfit is None else cost + misfit.penalty(residual), residual

        def find_step(deviation: Array, residual: Array) -> tuple[Array, Array]:
            H = jacobian_of_runs(measurement, m + deviation, epoch)
            HP = H @ P
            nu = residual + times(H, deviation)
            w = semidefinite_solve(symmetric(HP @ transpose(H)) + R, nu[:, :, None])[:, :, 0]
            move = times(transpose(HP), w) - deviation
            return move, prior.squared(move) + noise.squared(times(H, move))

        deviation, iterations = gauss_newton(evaluate, find_step, np.zeros_like(m), self._options)
        linearised, _ = joseph_update(belief, residual, measurement.jacobian(m + deviation, epoch), R)
        failed = dict(innovation.failed)
        if misfit is not None:
            reached = measurement.residual(z, measurement.predict(m + deviation, epoch))
            failed |= dict.fromkeys(np.flatnonzero(misfit.remains(reached)).tolist(), NOT_REACHED)
        return (
            Gaussian(m + deviation, linearised.covariance),
            replace(innovation, extras={"iterations": iterations}, failed=failed),
        )


NOT_REACHED = "the search did not reach a state that explains the noise-free measurement"
_REACHED = 1e-6


class _ExactMisfit:
    """What is left of a residual in the directions without noise, which a state must explain altogether.

    An exact penalty joins the cost: with a weight above the constraint's multiplier, Gauss-Newton steps go down it
    (Nocedal and Wright, Numerical Optimization, 2006, section 18.3). The multiplier at the start is the whitened
    innovation; ten times that leaves room for the curvature.

    Args:
        noise: The whitener of R.
        HPH: Covariance of the predicted reading, (runs, m, m), which gives the misfit its unit.
        innovation: That of the linearisation at the start.
    """

    def __init__(self, noise: Whitener, HPH: Array, innovation: Innovation) -> None:
        self._noise = noise
        variance = np.einsum("bij,bjk,bik->bi", noise.exact, HPH, noise.exact)
        self._unit = np.sqrt(np.where(variance > 0, variance, 1.0))
        self._weight = 10 * (1 + np.sqrt(np.where(np.isfinite(innovation.nis), innovation.nis, 0.0)))

    def penalty(self, residual: Array) -> Array:
        """Return the penalty of a residual (runs, m): (runs,)."""
        penalty: Array = self._weight * self._misfit(residual).sum(axis=1)
        return penalty

    def remains(self, residual: Array) -> NDArray[np.bool_]:
        """Return where the residual is not explained, (runs,)."""
        return np.asarray((self._misfit(residual) > _REACHED).any(axis=1))

    def _misfit(self, residual: Array) -> Array:
        return np.abs(times(self._noise.exact, residual)) / self._unit
