"""Two-step filter of Haupt, Kasdin, Keiser and Parkinson."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, in_kind, where_runs
from relnav_sim.filters.either_arithmetic import EitherArithmetic
from relnav_sim.filters.gauss_newton import (
    CostDigits,
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
    linearised_update,
    mean_in_single,
    whitening,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import NEEDS_NOISE, Whitener, not_definite
from relnav_sim.filters.two_step_start import OffManifold, StartKind, start_off_manifold
from relnav_sim.linalg import DOUBLE, kernel_for, symmetric, transpose
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import (
    all_channels,
    present_channels,
    unit_where_absent,
    zero_absent,
    zero_absent_rows,
)
from relnav_sim.streams import RandomSource


class TwoStepOptions(IterationOptions):
    """Options of the two-step filter."""

    start: StartKind = Field(
        default="unscented",
        description="Covariance of the first-step state y = [x; g(x)] at the first measurement. unscented: sigma "
        "points through g (Liu et al. 2011), the diagonal of what they find beyond the tangent counted twice because "
        "they miss the curvature across axes; unscented_plain: the sigma points' own covariance, as published, with "
        "nothing counted twice and no start_slack; closed_form: exact for quadratic g, from second derivatives; "
        "linearised: F P F^T, the original, singular but for start_slack, and wrong when the prior is wide",
    )
    start_slack: float = Field(
        default=1.0,
        gt=0,
        description="Extra variance of the g(x) block at the start, in units of R, without which the covariance of y "
        "can be singular; default 1: what one measurement could tell",
    )
    start_kappa: float | None = Field(
        default=None,
        ge=0,
        description="Spread kappa of the unscented start's 2 n + 1 points; default max(0, 3 - n), which gives a "
        "Gaussian's fourth moment where that is possible without a negative weight",
    )

    @model_validator(mode="after")
    def _plain_without_slack(self) -> TwoStepOptions:
        if self.start == "unscented_plain" and self.start_slack != 1:
            raise ValueError("start_slack has no use with start: unscented_plain, which adds nothing; leave it out")
        return self


@dataclass(frozen=True)
class TwoStepBelief(Gaussian):
    """The second-step state x as a Gaussian, and what the first-step state y = [x; g(x)] holds beyond f(x).

    With c = (y_g - g) - G (y_x - x), taken at the mean of the last update, y is a Gaussian of (y_x, c): c has
    covariance `scatter`, and given c, y_x = x + regression c with x's covariance.

    Args:
        mean: (runs, n).
        covariance: (runs, n, n).
        offset: Mean of y less f(mean), (runs, n + m), angles wrapped.
        regression: (runs, n, m).
        scatter: (runs, m, m).
        jacobian: G at the mean of the last update, (runs, m, n).
        started: Whether the run has had a measurement, (runs,); the arrays above are zero before.
    """

    offset: Array
    regression: Array
    scatter: Array
    jacobian: Array
    started: Mask


def two_step_operations(size: Size, options: Any) -> Operations:
    """Return what it costs: the first step over y = [x; g(x)], and all the iterations that the second may take."""
    n, m, width = size.n, size.m, bytes_of(options)
    first = covariance_prediction(n) + 2 * linearised_update(n, m, width) + linearised_update(m, m, width)
    roots = cholesky(n) + cholesky(m) + 2 * (n + m) + whitening(n, n) + whitening(m, m)
    turned = 2 * m * n * n + 12 * m * m * n + 6 * m**3
    misfit = 2 * n * n + 4 * n * m + 2 * m * m + 3 * n + 2 * m + 1
    step = 2 * n * n * (m + 1) + 6 * n * m * (m + 1) + m**3 + 4 * m * m + 2 * n + 3 * m + 1
    tests = digits_of_search(n, m, width) + definite_in_single(n, width)
    count = 2 * covariance_prediction(n) + mean_in_single(n, width) + first + roots + turned + tests
    count += options.max_iterations * (misfit + step)
    return Operations(count, gaussian_numbers(n, m) + gaussian_numbers(n + m, m), width)


@register_filter("two_step", TwoStepOptions, cost_us=5.0, overhead_us=530.0, operations=two_step_operations)
class TwoStepFilter(EitherArithmetic):
    """Two-step filter: a linear Kalman update of y = [x; g(x)], then x fitted to y by Gauss-Newton.

    Haupt, Kasdin, Keiser and Parkinson, J. Guidance, Control, and Dynamics 19(3), 1996; the unscented start is that of
    Liu et al. 2011. z = H y + v is linear, so the first step is exact; all nonlinearity is in the fit. For linear g
    it equals the Kalman filter. Use it when a wide prior meets a precise measurement; the iterated filter does as well.

    Everything depends on how far y may start off the manifold y = f(x). Not at all gives the extended Kalman filter;
    without limit, the iterated one. The start is made at the first measurement, from the prediction there.

    The covariance Py = N + F Px F^T is never formed: rounding would make its part N, found as Py - F Px F^T,
    indefinite, and Py becomes singular as N shrinks. With c = (y_g - g) - G (y_x - x), what y_g departs from the
    tangent, N is [K; I] V [K; I]^T in coordinates (x, c), where V is c's covariance and K the regression of y_x on
    it. Both steps update c, then x given c, so every covariance is a sum of positive parts, for linear g the
    covariance of x takes the very path of the Kalman filter, and a gap in the measurements leaves N alone.

    A measurement with channels missing updates y through those present; g(x) of the others stays part of y, and with
    several sensors so does g(x) of each, so that all their functions are called whichever is read.

    Limits: R must be positive definite; a noise-free channel fails the run. The off-manifold part gets no process
    noise, as in the original. NIS and log-likelihood come from the linear first step; those of the first measurement
    include the start's slack.
    """

    considers = False
    matches_covariance = False  # the correction is that of the first step's states

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: TwoStepOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def start(self, prior: Gaussian, source: RandomSource) -> TwoStepBelief:
        """Return the prior; y comes with the first measurement."""
        runs, n, m = *prior.mean.shape, self.measurement.dimension
        return TwoStepBelief(
            prior.mean,
            prior.covariance,
            offset=np.zeros((runs, n + m)),
            regression=np.zeros((runs, n, m)),
            scatter=np.zeros((runs, m, m)),
            jacobian=np.zeros((runs, m, n)),
            started=np.zeros(runs, dtype=bool),
        )

    def predict(self, belief: Any, step: Step) -> TwoStepBelief:
        """Return the belief with x propagated; y follows it, y + f(x_new) - f(x), so nothing else changes."""
        x = super().predict(belief, step)
        carried: TwoStepBelief = replace(belief, mean=x.mean, covariance=x.covariance)
        return carried

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[TwoStepBelief, Innovation]:
        """Return the belief after both steps; the innovation is the first step's."""
        R = all_channels(self.seen).noise(belief.mean, step.epoch)
        corrected, _, innovation = self.two_steps(belief, z, R, step)
        return corrected, innovation

    def two_steps(
        self, belief: TwoStepBelief, z: Array, R: Array, step: Step
    ) -> tuple[TwoStepBelief, tuple[Array, Array], Innovation]:
        """Return the belief after both steps, the residual z - H y and its H Py H^T after the first, the innovation.

        Args:
            belief: The prediction.
            z: (runs, m).
            R: Measurement noise to assume, of all channels, (m, m) or (runs, m, m).
            step: The epoch.
        """
        # y holds g(x) of every channel; which are present only tells what z sees of it.
        measurement, present, epoch = all_channels(self.seen), present_channels(self.seen), step.epoch
        g = measurement.predict(belief.mean, epoch)
        G = jacobian_of_runs(measurement, belief.mean, epoch)
        before = self._off_manifold(belief, G, R, epoch)
        expected = g + before.mean_c + times(G, before.mean_x)
        after, innovation = _first_step(before, measurement.residual(z, expected), G, R, present)
        # y's mean; its angles are not wrapped, so that differences to it stay continuous.
        y_g = g + after.mean_c + times(G, after.mean_x)

        fit = _Fit(after)
        evaluate, find_step = fit.search(measurement, belief.mean, y_g, G, epoch)
        digits = None
        if self._single is not None:
            size = np.abs(y_g) + reading_size(belief, G)
            digits = fit.digits_in_single(self._options.tolerance, size)
        deviation, iterations = gauss_newton(evaluate, find_step, np.zeros_like(belief.mean), self._options, digits)
        mean = belief.mean + deviation
        jacobian = jacobian_of_runs(measurement, mean, epoch)
        covariance, regression, scatter = fit.at(jacobian - G)
        corrected = TwoStepBelief(
            mean,
            covariance,
            offset=np.concatenate(
                [after.mean_x - deviation, measurement.residual(y_g, measurement.predict(mean, epoch))], axis=1
            ),
            regression=regression,
            scatter=scatter,
            jacobian=jacobian,
            started=np.ones(len(z), dtype=bool),
        )
        B = np.eye(len(z[0]), dtype=G.dtype) + G @ after.regression
        observed = G @ after.covariance @ transpose(G) + B @ after.scatter @ transpose(B)
        singular = dict.fromkeys(np.flatnonzero(not_definite(R, len(z))).tolist(), NEEDS_NOISE)
        lost = self.without_digits(fit.prior, R) | self.without_digits(fit.beyond, R)
        return (
            corrected,
            (measurement.residual(z, y_g), observed),
            replace(innovation, extras={"iterations": iterations}, failed={**innovation.failed, **lost, **singular}),
        )

    def _off_manifold(self, belief: TwoStepBelief, G: Array, R: Array, epoch: int) -> OffManifold:
        """Return the Gaussian of (y_x, c) about the prediction, new for the runs that have had no measurement."""
        started = belief.started
        if started.all():
            return _carried(belief, G)
        # Once in a flight, from differences of nearby measurements and Jacobians: by the models, in float64.
        options, measurement = self._options, all_channels(self.measurement)
        kappa = max(0.0, 3.0 - belief.mean.shape[1]) if options.start_kappa is None else options.start_kappa
        fresh = start_off_manifold(
            options.start,
            Gaussian(belief.mean.astype(DOUBLE, copy=False), belief.covariance.astype(DOUBLE, copy=False)),
            lambda x: measurement.predict(x, epoch),
            measurement.residual,
            lambda x: jacobian_of_runs(measurement, x, epoch),
            options.start_slack * R.astype(DOUBLE, copy=False),
            kappa,
        )
        fresh = in_kind(fresh, self.kind)
        if not started.any():
            return fresh
        return where_runs(started, _carried(belief, G), fresh)


def _carried(belief: TwoStepBelief, G: Array) -> OffManifold:
    """Return what the last update left, seen from the tangent G at the prediction.

    Where c was slack about the old tangent, it is (I + (G_old - G) K) c about the new one.
    """
    n = belief.mean.shape[1]
    offset_x, offset_g = belief.offset[:, :n], belief.offset[:, n:]
    K = transpose(belief.regression)
    turned = kernel_for(G, kernels.two_step, "turned")
    B, scatter = turned(G - belief.jacobian, belief.regression, np.ascontiguousarray(K), belief.scatter)
    return OffManifold(
        offset_x, offset_g - times(G, offset_x), belief.covariance, np.ascontiguousarray(transpose(B)), scatter
    )


def _first_step(
    before: OffManifold, nu: Array, G: Array, R: Array, present: Mask | None
) -> tuple[OffManifold, Innovation]:
    """Return (y_x, c) after z = y_g + v, and the innovation.

    Given c the measurement sees y_x through G; so c is updated with the noise G P G^T + R, then y_x given c with R.

    Args:
        before: The prediction.
        nu: z less its expectation, (runs, m).
        G: Jacobian at the prediction, (runs, m, n).
        R: (m, m) or (runs, m, m).
        present: The channels (runs, m) that z has; None: all.
    """
    K, P = before.regression, before.covariance
    B = np.eye(len(nu[0]), dtype=G.dtype) + G @ K
    if present is not None:
        leading = nu.shape[:1]
        nu, R = zero_absent(nu, present), unit_where_absent(R, present)
        G, B = zero_absent_rows(G, present, leading), zero_absent_rows(B, present, leading)
    GP = G @ P
    W = symmetric(GP @ transpose(G)) + R
    c, innovation = joseph_update(Gaussian(before.mean_c, before.scatter), nu, B, W)
    moved = c.mean - before.mean_c
    x, told = joseph_update(Gaussian(before.mean_x + times(K, moved), P), nu - times(B, moved), G, R)
    innovation = replace(innovation, failed={**innovation.failed, **told.failed})
    gain = transpose(kernel_for(W, kernels.roots, "solve")(W, GP)[0])
    return OffManifold(x.mean, c.mean, x.covariance, K - gain @ B, c.covariance), innovation


class _Fit:
    """The second step: x fitted to y, min |y - f(x)|^2 in Py^-1, as a sum over c and y_x given c.

    With q(x) what f(x) departs from the tangent, less c's mean, and t(x) = x - mean_x - K q(x), the cost is
    |q|^2 in V^-1 plus |t|^2 in P^-1. D = dq/dx is zero for linear g. The step comes from the update of t by q.
    """

    def __init__(self, y: OffManifold) -> None:
        self._y = y
        self.prior, self.beyond = Whitener(y.covariance), Whitener(y.scatter)

    def digits_in_single(self, tolerance: float, reading: Array) -> CostDigits:
        """Return what float32 leaves of the cost; measurement (runs, m): the size of y_g and of its parts."""
        variances = np.einsum("bii->bi", self._y.covariance)
        return digits_in_single(tolerance, self.prior, variances, self.beyond, reading)

    def search(
        self, measurement: Measurement, origin: Array, y_g: Array, G: Array, epoch: int
    ) -> tuple[Callable[[Array], tuple[Array, Array]], Callable[[Array, Array], tuple[Array, Array]]]:
        """Return cost and step for `gauss_newton`, in deviations from `origin`, where G is the Jacobian."""
        y, W, U = self._y, self.prior.root, self.beyond.root
        misfit, step = (kernel_for(W, kernels.two_step, name) for name in ("misfit", "step"))

        def evaluate(deviation: Array) -> tuple[Array, Array]:
            beyond = measurement.residual(y_g, measurement.predict(origin + deviation, epoch))
            beyond = np.ascontiguousarray(beyond)
            both, cost = misfit(G, y.regression, y.mean_x, deviation, beyond, W, U)
            return cost, both

        def find_step(deviation: Array, both: Array) -> tuple[Array, Array]:
            D = jacobian_of_runs(measurement, origin + deviation, epoch) - G
            found: tuple[Array, Array] = step(D, y.regression, y.covariance, y.scatter, both, W, U)
            return found

        return evaluate, find_step

    def at(self, D: Array) -> tuple[Array, Array, Array]:
        """Return Px = (F^T Py^-1 F)^-1 where dq/dx = D, and the regression and scatter of y beyond f(x) from there."""
        y, K = self._y, self._y.regression
        linearise, turned = (kernel_for(D, kernels.two_step, name) for name in ("linearise", "turned"))
        E, EP, S = linearise(D, K, y.covariance, y.scatter)
        updated, _ = joseph_update(Gaussian(y.mean_x, y.covariance), y.mean_c, E, y.scatter)
        n = D.shape[2]
        predict, solve = kernel_for(D, kernels.kalman, "predict"), kernel_for(D, kernels.roots, "solve")
        P = predict(updated.covariance, np.eye(n, dtype=D.dtype) + K @ E, np.zeros((1, n, n), D.dtype))
        B, scatter = turned(D, K, solve(S, y.scatter @ transpose(K) - EP)[0], S)
        return P, np.ascontiguousarray(transpose(B)), scatter
