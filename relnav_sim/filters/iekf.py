"""Iterated extended Kalman filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.gauss_newton import IterationOptions, gauss_newton, jacobian_of_runs, times
from relnav_sim.filters.kalman import GaussianFilter, joseph_update
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import Whitener
from relnav_sim.linalg import CholeskyFactor, transpose
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.measurement import Measurement

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
        prior, noise = Whitener(P), Whitener(np.broadcast_to(R, (len(m), *R.shape[-2:])))

        # All in deviations from m: a tight prior needs their digits.
        def evaluate(deviation: Array) -> tuple[Array, Array]:
            residual = measurement.residual(z, measurement.predict(m + deviation, epoch))
            return prior.squared(deviation) + noise.squared(residual), residual

        def find_step(deviation: Array, residual: Array) -> tuple[Array, Array]:
            H = jacobian_of_runs(measurement, m + deviation, epoch)
            HP = H @ P
            nu = residual + times(H, deviation)
            w = CholeskyFactor(HP @ transpose(H) + R).solve(nu[:, :, None])[:, :, 0]
            move = times(transpose(HP), w) - deviation
            return move, prior.squared(move) + noise.squared(times(H, move))

        residual = measurement.residual(z, measurement.predict(m, epoch))
        _, innovation = joseph_update(belief, residual, measurement.jacobian(m, epoch), R)
        deviation, iterations = gauss_newton(evaluate, find_step, np.zeros_like(m), self._options)
        linearised, _ = joseph_update(belief, residual, measurement.jacobian(m + deviation, epoch), R)
        return (
            Gaussian(m + deviation, linearised.covariance),
            Innovation(innovation.nis, innovation.log_likelihood, {"iterations": iterations}),
        )
