"""Prediction and update by sigma points in float32."""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.single_precision import INDEFINITE, SingleGaussian, SinglePrecision
from relnav_sim.measurements.interface import Measurement


class SinglePoints(SinglePrecision):
    """The unscented filter in float32, its covariance held as such.

    The points are numbers of float32, f and h are evaluated at them in float64, and their images are rounded. The
    update is Joseph's form of the transform, see `kernels.joseph.update_by_points`.

    Args:
        dynamics: The filter's.
        measurement: The filter's.
        scale: alpha^2 (n + kappa).
        curvature: beta - alpha^2.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, scale: float, curvature: float) -> None:
        super().__init__(dynamics, measurement)
        self._spread, self._weight = np.sqrt(scale), 1 / (2 * scale)
        self._curvature = curvature
        # The weight of s s^T beside deviations from the mean, where it is the curvature beside those from the centre.
        self._centre_weight = 2 - dynamics.dimension / scale + curvature

    def predict(self, belief: Gaussian | SingleGaussian, step: Step) -> SingleGaussian:
        """Return the propagated belief; with linear dynamics the transform is exact, so F is applied at once."""
        if self._dynamics.linear:
            return super().predict(belief, step)
        prior, models = self.own(belief), self._models
        points, _ = self._points(prior)
        images = models.propagate(points, step)
        deviations = np.ascontiguousarray(images[:, 1:] - images[:, :1])
        return SingleGaussian(
            *kernels.sigma_points.predict_single(
                np.ascontiguousarray(images[:, 0]),
                deviations,
                models.process_noise(prior.x, step),
                self._weight,
                self._curvature,
            )
        )

    def update(self, belief: Gaussian | SingleGaussian, z: Array, step: Step) -> tuple[SingleGaussian, Innovation]:
        """Return the optimal update."""
        prior, models = self.own(belief), self._models
        points, offsets = self._points(prior)
        images, deviations = models.images(points, step.epoch)
        R = models.noise(prior.x, step.epoch)
        expected, S, C = kernels.sigma_points.moments_single(
            images, deviations, offsets, R, self._weight, self._curvature
        )
        residual = models.residual(z, expected)
        x, P, nis, log_likelihood, lost = kernels.joseph.update_by_points(
            prior.x, offsets, deviations, residual, S, C, R, self._weight, self._centre_weight, models.eps
        )
        failed = dict.fromkeys(lost.tolist(), INDEFINITE)
        return self._told(x, P, Innovation(nis, log_likelihood, failed=failed))

    def _points(self, belief: SingleGaussian) -> tuple[Array, Array]:
        """Return sigma points (runs, 2 n + 1, n) and their offsets; NaN where the covariance is indefinite.

        A state without variance is known: its points do not leave the mean.
        """
        known = np.einsum("bii->bi", belief.P) == 0
        if not known.any():
            return kernels.sigma_points.points_single(belief.x, belief.P, self._spread)[:2]
        P = belief.P + known[:, :, None] * np.eye(known.shape[1], dtype=belief.P.dtype)
        _, offsets, _ = kernels.sigma_points.points_single(belief.x, P, self._spread)
        offsets[np.broadcast_to(known[:, None, :], offsets.shape)] = 0.0
        centre = belief.x[:, None]
        return np.concatenate([centre, centre + offsets], axis=1), offsets
