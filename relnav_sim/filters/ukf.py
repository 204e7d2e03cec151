"""Unscented Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.gauss_newton import jacobian_of_runs
from relnav_sim.filters.kalman import (
    GaussianFilter,
    GaussianFilterOptions,
    of_runs,
    reading_size,
    replace_runs,
)
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    point_numbers,
    point_update_in_single,
    unscented_prediction,
    unscented_update,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.single_points import SinglePoints
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.filters.square_root_update import square_root_update
from relnav_sim.filters.statistical_linearisation import statistical_linearisation
from relnav_sim.linalg import by_run, symmetric, transpose
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, Stretch

_IMAGE_ROUNDING = 1e-14


class UnscentedOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the unscented Kalman filter."""

    alpha: float = Field(
        default=1.0,
        gt=0,
        le=1,
        description="Spread of the sigma points. Default 1: points about one sigma away; at 1e-3 the centre's weight "
        "is about -1e6 and rounding shows in the mean",
    )
    beta: float = Field(
        default=0.0,
        description="Extra weight of the centre in covariances; 2 suits a Gaussian with alpha below 1; default 0, "
        "with which no weight is negative at kappa = 0",
    )
    kappa: float = Field(
        default=0.0,
        description="Second spread parameter; default 0: the cubature rule, positive definite for any measurement",
    )
    redraw: bool = Field(
        default=True,
        description="Draw the sigma points again after the process noise is added; false passes the propagated "
        "points on, which leaves the process noise out of the predicted measurement",
    )

    @model_validator(mode="after")
    def _points_of_the_covariance(self) -> Self:
        if self.arithmetic == "float32" and not self.redraw:
            raise ValueError(
                "redraw: false is computed in float64 only; points that leave the process noise out are no root of the "
                "covariance, which the update in float32 takes them for: leave it or arithmetic: float32 out"
            )
        return self


@dataclass(frozen=True)
class PropagatedPoints:
    """A Gaussian with the propagated sigma points it came from: centre (runs, n), offsets (runs, 2 n, n)."""

    mean: Array
    covariance: Array
    centre: Array
    offsets: Array


def unscented_operations(size: Size, options: Any) -> Operations:
    """Return what a filter of 2 n + 1 sigma points costs, drawn before the prediction and the update."""
    n, m, width = size.n, size.m, bytes_of(options)
    update = unscented_update(n, m) if width == 8 else point_update_in_single(n, m)
    return Operations(unscented_prediction(n) + update, point_numbers(n, m), width)


@register_filter("ukf", UnscentedOptions, cost_us=1.3, overhead_us=45.0, operations=unscented_operations)
class UnscentedKalmanFilter(GaussianFilter):
    """Unscented Kalman filter: 2 n + 1 sigma points instead of a linearisation.

    Julier and Uhlmann, Proc. IEEE 92(3), 2004; van der Merwe's alpha, beta, kappa. Use it when the prior's spread
    bends the measurement function (near targets, poor priors); with a small spread it equals the extended filter.

    All moments are sums over deviations from the image of the centre point: with sum(W) = 1 the mean is
    h(X_0) + w sum(d_i), and the covariance w sum(d_i d_i^T) + (beta - alpha^2) d d^T, d = w sum(d_i). The centre's
    large negative weight at small alpha never enters, and angles need no circular mean.
    """

    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: UnscentedOptions) -> None:
        super().__init__(dynamics, measurement, options)
        n = dynamics.dimension
        scale = options.alpha**2 * (n + options.kappa)
        if scale <= 0:
            raise ValueError(f"kappa = {options.kappa:g} needs to exceed minus the number of states, {-n}")
        self._spread = np.sqrt(scale)
        self._weight = 1 / (2 * scale)
        self._curvature = options.beta - options.alpha**2
        self._redraw = options.redraw
        self._points_in_single = (
            SinglePoints(dynamics, measurement, scale, self._curvature) if options.arithmetic == "float32" else None
        )

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the propagated belief; with linear dynamics the transform is exact, so F is applied at once."""
        if self._points_in_single is not None:
            return self._points_in_single.predict(belief, step)
        if self.dynamics.linear and self._redraw:
            return super().predict(belief, step)
        centre, images, _ = self._propagated(belief, step)
        Q = self.dynamics.process_noise(belief.mean, step)
        mean, covariance = kernels.sigma_points.predict(
            np.ascontiguousarray(centre), np.ascontiguousarray(images), by_run(Q), self._weight, self._curvature
        )
        if self._redraw:
            return Gaussian(mean, covariance)
        return PropagatedPoints(mean, covariance, centre, images)

    def compiled_epochs(self, belief: Gaussian, stretch: Stretch, first_epoch: int) -> int | None:
        """Take as many epochs of a stretch in one go as dynamics and measurement can; None: they can't."""
        if not self._redraw:
            return None
        transform = kernels.point_step.Transform(float(self._spread), self._weight, self._curvature)
        update = CompiledUpdate("filtered_by_points", transform)
        return self.epochs_by(UnscentedKalmanFilter, update, belief, stretch, first_epoch)

    def linear_step(self, belief: Gaussian, step: Step) -> tuple[Array, Array]:
        """Return F and Q of the linear step that the transform amounts to; Q holds what the curvature adds."""
        if self.dynamics.linear:
            return super().linear_step(belief, step)
        _, images, offsets = self._propagated(belief, step)
        F, Omega = statistical_linearisation(belief.covariance, offsets, images, self._weight, self._curvature)
        return F, Omega + by_run(self.dynamics.process_noise(belief.mean, step))

    def _propagated(self, belief: Gaussian, step: Step) -> tuple[Array, Array, Array]:
        """Return the image of the mean, those of the points less that, and the points' offsets from the mean."""
        points, offsets = self._points(belief)
        if self.dynamics.linear:
            return self.dynamics.propagate(belief.mean, step), self.dynamics.propagate(offsets, step), offsets
        propagated = self.dynamics.propagate(points, step)
        return propagated[:, 0], propagated[:, 1:] - propagated[:, :1], offsets

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the update with the mean and covariances of the transformed sigma points."""
        if self._points_in_single is not None:
            return self._points_in_single.update(belief, z, step)
        if isinstance(belief, PropagatedPoints):
            offsets = belief.offsets
            points = np.concatenate([belief.centre[:, None], belief.centre[:, None] + offsets], axis=1)
        else:
            points, offsets = self._points(belief)
        images = self.measurement.predict(points, step.epoch)
        deviations = self.measurement.residual(images, images[:, :1])
        R = by_run(self.measurement.noise(belief.mean, step.epoch))
        expected, S, cross = kernels.sigma_points.moments(
            np.ascontiguousarray(images),
            np.ascontiguousarray(deviations),
            np.ascontiguousarray(offsets),
            R,
            self._weight,
            self._curvature,
        )
        residual = self.measurement.residual(z, expected)
        mean, P, nis, log_likelihood, rows = kernels.kalman.update_by_moments(
            np.ascontiguousarray(belief.mean),
            np.ascontiguousarray(belief.covariance),
            np.ascontiguousarray(residual),
            cross,
            S,
            R,
        )
        update = Gaussian(mean, P), Innovation(nis, log_likelihood)
        if isinstance(belief, PropagatedPoints) or len(rows) == 0:
            return update
        prior = Gaussian(belief.mean[rows], belief.covariance[rows])
        H = jacobian_of_runs(self.measurement, belief.mean, step.epoch)[rows]
        reading = reading_size(prior, H) + np.abs(images[rows, 0]) + np.abs(z[rows])
        exact = self._from_roots(
            prior, H, deviations[rows, 1:], offsets[rows], of_runs(R, rows), residual[rows], reading
        )
        return replace_runs(rows, update, exact)

    def _from_roots(
        self, prior: Gaussian, H: Array, deviations: Array, offsets: Array, R: Array, residual: Array, reading: Array
    ) -> tuple[Gaussian, Innovation]:
        """Return the same update for a prior that is far wider than the noise, or singular.

        The halves d+ - d- and d+ + d- of a pair of opposite points split S = B B^T + Omega + R: B, the central
        differences over the spread, is statistical linearisation, H P H^T in roots; Omega is what the measurement's
        curvature adds, and joins the noise (Lefebvre, Bruyninckx and De Schutter, IEEE Trans. Automatic Control 47(8),
        2002). The subtraction P - P_xz S^-1 P_zx, which loses the noise, is never made.
        """
        n = prior.mean.shape[1]
        ahead, behind = deviations[:, :n], deviations[:, n:]
        B = transpose(ahead - behind) / (2 * self._spread)
        even = (ahead + behind) / 2
        shift = self._weight * np.einsum("bij->bj", deviations)
        Omega = 2 * self._weight * (transpose(even) @ even) + self._curvature * shift[:, :, None] * shift[:, None, :]
        # What a linear measurement departs from its slope is the rounding of its images.
        straight = np.einsum("bii->bi", Omega) <= np.square(_IMAGE_ROUNDING * reading)
        Omega = np.where(straight[:, :, None] | straight[:, None, :], 0.0, Omega)
        X = transpose(offsets[:, :n]) / self._spread
        return square_root_update(prior, H, X, B, symmetric(Omega) + R, residual, reading)

    def _points(self, belief: Gaussian) -> tuple[Array, Array]:
        """Return sigma points (runs, 2 n + 1, n) and their offsets (runs, 2 n, n); the covariance may be singular."""
        m, P = np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.covariance)
        points, offsets, without_factor = kernels.sigma_points.points(m, P, self._spread)
        if without_factor:
            singular = ~np.isfinite(offsets.sum(axis=(1, 2)))
            roots = semidefinite_root(P[singular])
            points[singular], offsets[singular] = kernels.sigma_points.points_of_root(m[singular], roots, self._spread)
        return points, offsets
