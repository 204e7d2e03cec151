"""Iterated extended Kalman filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.either_arithmetic import EitherArithmetic
from relnav_sim.filters.gauss_newton import (
    IterationOptions,
    digits_in_single,
    gauss_newton,
    jacobian_of_runs,
    times,
)
from relnav_sim.filters.kalman import joseph_update, reading_size
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    cholesky,
    covariance_prediction,
    definite_in_single,
    digits_of_search,
    gaussian_numbers,
    innovation_covariance,
    linearised_update,
    mean_in_single,
    whitening,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import Whitener, semidefinite_root, semidefinite_solve, squares
from relnav_sim.filters.square_root_update import REPEATED, root_update, rounding_of
from relnav_sim.linalg import by_run, kernel_for, transpose
from relnav_sim.measurements.interface import Measurement


def search_operations(size: Size, iterations: int, number_bytes: int) -> int:
    """Return the operations of a Gauss-Newton search without halved steps, and of the updates before and after it."""
    n, m = size.n, size.m
    solved = innovation_covariance(n, m) + 2 * m * n + cholesky(m) + 2 * m + 2 * m * m
    costs = 2 * (2 * n * (n + 1) + 2 * m * (m + 1) + 1)
    updates = 2 * linearised_update(n, m, number_bytes)
    return whitening(n, n) + whitening(m, m) + updates + iterations * (solved + costs)


def _operations(size: Size, options: Any) -> Operations:
    """Return what it costs with all the iterations that it may take."""
    width = bytes_of(options)
    prediction = covariance_prediction(size.n) + mean_in_single(size.n, width)
    tests = digits_of_search(size.n, size.m, width) + definite_in_single(size.n, width)
    count = prediction + search_operations(size, options.max_iterations, width) + tests
    return Operations(count, gaussian_numbers(size.n, size.m), width)


@register_filter("iekf", IterationOptions, cost_us=4.0, overhead_us=260.0, operations=_operations)
class IteratedExtendedKalmanFilter(EitherArithmetic):
    """Iterated extended Kalman filter: the maximum of the posterior, by Gauss-Newton with a line search.

    Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.3; Bell and Cathey (1993). Use it when the
    prior is wide against the range, at start-up above all: it converges where the extended filter diverges, at two
    to three times the cost. The covariance is Joseph's at the maximum.

    Limits: NIS and log-likelihood are those of the linearisation at the prediction, as in the extended filter.
    Noise that depends on the state is taken at the prediction. Only a local maximum is sought. In float32 noise is
    needed in every channel.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: IterationOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the mode of the posterior, the covariance of its linearisation there, and the innovation."""
        measurement, epoch = self.seen, step.epoch
        m, P = np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.covariance)
        R = measurement.noise(m, epoch)
        noise = Whitener(np.broadcast_to(R, (len(m), *R.shape[-2:])))
        prior = Whitener(P)
        residual = measurement.residual(z, measurement.predict(m, epoch))
        H = jacobian_of_runs(measurement, m, epoch)
        _, innovation = joseph_update(belief, residual, H, R)
        exact = _ExactReading(noise, belief, H, R, residual, innovation) if noise.has_exact else None
        digits = None
        if self._single is not None:
            size = reading_size(belief, H) + np.abs(residual)
            digits = digits_in_single(self._options.tolerance, prior, np.einsum("bii->bi", P), noise, size)
        linearised_reading = kernel_for(m, kernels.iekf, "linearised_reading")

        # All in deviations from m: a tight prior needs their digits.
        def evaluate(deviation: Array) -> tuple[Array, Array]:
            residual = np.ascontiguousarray(measurement.residual(z, measurement.predict(m + deviation, epoch)))
            cost = squares(prior, deviation, noise, residual)
            return cost if exact is None else cost + exact.penalty(residual), residual

        def find_step(deviation: Array, residual: Array) -> tuple[Array, Array]:
            H = jacobian_of_runs(measurement, m + deviation, epoch)
            HP, S, nu = linearised_reading(H, P, by_run(R, m.dtype), deviation, residual)
            w = semidefinite_solve(S, nu[:, :, None])[:, :, 0]
            goal = times(transpose(HP), w)
            if exact is not None:
                goal[exact.rows] = exact.goal(deviation, H, nu)
            move = goal - deviation
            return move, squares(prior, move, noise, times(H, move))

        deviation, iterations = gauss_newton(evaluate, find_step, np.zeros_like(m), self._options, digits)
        linearised, _ = joseph_update(belief, residual, measurement.jacobian(m + deviation, epoch), R)
        failed = dict(innovation.failed) | self.without_digits(prior, R)
        if exact is not None:
            reached = measurement.residual(z, measurement.predict(m + deviation, epoch))
            failed |= dict.fromkeys(np.flatnonzero(exact.remains(reached)).tolist(), NOT_REACHED)
        return (
            Gaussian(m + deviation, linearised.covariance),
            replace(innovation, extras={"iterations": iterations}, failed=failed),
        )


NOT_REACHED = "the search did not reach a state that explains the noise-free measurement"
_REACHED = 1e-6


class _ExactReading:
    """A measurement with directions without noise, which a state must explain altogether.

    What is left of the residual there, the misfit, joins the cost as an exact penalty: with a weight above the
    constraint's multiplier, Gauss-Newton steps go down it (Nocedal and Wright, Numerical Optimization, 2006, section
    18.3). The multiplier at the start is the whitened innovation; ten times that leaves room for the curvature.

    What `root_update` counts as rounding is no misfit here either, and a direction that it counts as known gives
    neither a step nor a unit: the covariance holds nothing but rounding there.

    Args:
        noise: The whitener of R.
        belief: The prediction.
        H: Jacobian there (runs, m, n).
        R: Noise (runs, m, m) or (m, m).
        residual: That of the prediction, (runs, m).
        innovation: That of the linearisation at the start.

    Attributes:
        rows: The runs that have such directions.
    """

    def __init__(
        self, noise: Whitener, belief: Gaussian, H: Array, R: Array, residual: Array, innovation: Innovation
    ) -> None:
        self._exact, m = noise.exact, residual.shape[1]
        self.rows = np.flatnonzero(noise.exact.any(axis=(1, 2)))
        self._belief = Gaussian(belief.mean[self.rows], belief.covariance[self.rows])
        self._noise_root = semidefinite_root(np.broadcast_to(R, (len(residual), m, m))[self.rows])
        root = semidefinite_root(belief.covariance)
        self._root = root[self.rows]
        size = reading_size(belief, H) + np.abs(residual).max(axis=1, keepdims=True)
        size = times(np.abs(noise.exact), size)
        sd = np.sqrt(np.square(noise.exact @ H @ root).sum(axis=2))
        known = sd <= rounding_of(size)
        self._rounding = np.where(known, REPEATED * size, rounding_of(size))
        unit = np.where(known, self._rounding, sd)
        self._unit = np.where(unit > 0, unit, 1.0)
        self._weight = 10 * (1 + np.sqrt(np.where(np.isfinite(innovation.nis), innovation.nis, 0.0)))

    def goal(self, deviation: Array, H: Array, nu: Array) -> Array:
        """Return the deviation (rows, n) that the linearisation at another (runs, n) leads to.

        Args:
            deviation: From the prediction, (runs, n).
            H: Jacobian there (runs, m, n).
            nu: Residual of the linearisation at the prediction, (runs, m).
        """
        rows, X = self.rows, self._root
        there = Gaussian(self._belief.mean + deviation[rows], self._belief.covariance)
        update = root_update(X, H[rows] @ X, self._noise_root, nu[rows], reading_size(there, H[rows]))
        return times(update.gain, update.white)

    def penalty(self, residual: Array) -> Array:
        """Return the penalty of a residual (runs, m): (runs,)."""
        penalty: Array = self._weight * self._misfit(residual).sum(axis=1)
        return penalty

    def remains(self, residual: Array) -> Mask:
        """Return where the residual is not explained, (runs,)."""
        return np.asarray((self._misfit(residual) > _REACHED).any(axis=1))

    def _misfit(self, residual: Array) -> Array:
        return np.maximum(np.abs(times(self._exact, residual)) - self._rounding, 0.0) / self._unit
