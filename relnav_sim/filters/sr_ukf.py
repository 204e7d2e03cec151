"""Square-root unscented Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states
from relnav_sim.filters.gauss_newton import jacobian_of_runs
from relnav_sim.filters.kalman import GaussianFilter, GaussianFilterOptions, reading_size
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    cholesky,
    householder,
    point_numbers,
    triangle,
    udu,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.single_roots import SingleRoots
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.filters.square_root_update import root_update
from relnav_sim.filters.statistical_linearisation import statistical_linearisation
from relnav_sim.linalg import by_run, symmetric, transpose
from relnav_sim.measurements.interface import Measurement
from relnav_sim.streams import RandomSource

# Share of a noise's sigma that is left of it, given the channels before, from which on it counts as none.
_NOISE_FREE = 1e-7


class SquareRootUnscentedOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the square-root unscented Kalman filter."""

    kappa: float = Field(
        default=0.0,
        ge=0,
        description="Spread of the sigma points; default 0: the square-root cubature filter. Not negative, so that "
        "every weight has a real root and no downdate is needed",
    )


@dataclass(frozen=True)
class RootGaussian:
    """A Gaussian belief per run: mean (runs, n), lower-triangular root (runs, n, n) of the covariance."""

    mean: Array
    root: Array

    @property
    def covariance(self) -> Array:
        """The covariance root root^T, (runs, n, n)."""
        return symmetric(self.root @ transpose(self.root))


def _operations(size: Size, options: Any) -> Operations:
    """Return what it costs: triangular forms of (n, 3 n + 1) and (m + n, 2 n + 1 + m) deviations."""
    n, m, width = size.n, size.m, bytes_of(options)
    points = 3 * n * n

    def deviations(p: int) -> int:
        return 2 + p * (6 * n + 2)

    def root(p: int) -> int:
        return cholesky(p) + 2 * p if width == 8 else udu(p) + p + triangle(p)

    prediction = points + deviations(n) + root(n) + householder(n, 3 * n + 1)
    roots = root(m) + householder(m + n, 2 * n + 1 + m)
    tests = (m + n) * (2 * (2 * n + 1 + m) + 1) + 6 * m + n * (n + 3) + m * m
    return Operations(prediction + points + deviations(n) + deviations(m) + roots + tests, point_numbers(n, m), width)


@register_filter("sr_ukf", SquareRootUnscentedOptions, cost_us=2.2, overhead_us=75.0, operations=_operations)
class SquareRootUnscentedKalmanFilter(GaussianFilter):
    """Square-root unscented Kalman filter: the unscented filter with the covariance held as its root.

    Van der Merwe and Wan, ICASSP 2001; Arasaratnam and Haykin (2009) for kappa = 0. Prediction and update are each
    one QR of an array of weighted deviations; the covariance is positive definite by construction and half the
    digits suffice. Equal to `ukf` with alpha = 1, beta = 0 and the same kappa. Use it when a very precise
    measurement meets a wide prior, or when a run is long. A singular prior, process noise or measurement
    noise is no obstacle.
    """

    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: SquareRootUnscentedOptions) -> None:
        super().__init__(dynamics, measurement, options)
        scale = dynamics.dimension + options.kappa
        self._spread = float(np.sqrt(scale))
        self._weight = 1 / (2 * scale)
        self._centre_weight = options.kappa / scale
        self._roots_in_single = (
            SingleRoots(dynamics, measurement, scale, self._centre_weight) if options.arithmetic == "float32" else None
        )

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the prior with its covariance factored."""
        if self._roots_in_single is not None:
            return self._roots_in_single.start(prior)
        return RootGaussian(prior.mean, semidefinite_root(prior.covariance))

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the propagated belief, its root that of [deviations, Q^(1/2)]."""
        if self._roots_in_single is not None:
            return self._roots_in_single.predict(belief, step)
        prior: RootGaussian = belief
        mean = prior.mean
        noise = semidefinite_root(by_run(self.dynamics.process_noise(mean, step)))
        if self.dynamics.linear:
            # The transform of a linear function is exact; its pairs of opposite deviations need one column.
            mean, deviations = self.dynamics.propagate(mean, step), self.dynamics.transition(mean, step) @ prior.root
        else:
            images = self.dynamics.propagate(self._points(prior)[0], step)
            shift, deviations = self._deviations(images[:, 1:] - images[:, :1])
            mean = images[:, 0] + shift
        return RootGaussian(mean, kernels.roots.triangular(deviations, noise))

    def linear_step(self, belief: Any, step: Step) -> tuple[Array, Array]:
        """Return F and Q of the linear step that the transform amounts to; Q holds what the curvature adds."""
        if self.dynamics.linear:
            return super().linear_step(belief, step)
        points, offsets = self._points(belief)
        images = self.dynamics.propagate(points, step)
        images = images[:, 1:] - images[:, :1]
        # Weights that sum to 1, that of the centre included, leave -1 for the square of the mean's shift.
        F, Omega = statistical_linearisation(belief.covariance, offsets, images, self._weight, -1.0)
        return F, Omega + by_run(self.dynamics.process_noise(belief.mean, step))

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the update: the root of [[Y, R^(1/2)], [X, 0]] holds those of S and P and the gain times the first."""
        if self._roots_in_single is not None:
            return self._roots_in_single.update(belief, z, step)
        prior: RootGaussian = belief
        points, offsets = self._points(prior)
        images = self.measurement.predict(points, step.epoch)
        shift, Y = self._deviations(self.measurement.residual(images[:, 1:], images[:, :1]))
        _, X = self._deviations(offsets)
        R = self.measurement.noise(prior.mean, step.epoch)
        noise_root = semidefinite_root(by_run(R))
        expected = images[:, 0] + shift
        reading = np.abs(z) + np.abs(expected)
        exact = (np.einsum("bii->bi", noise_root) <= _NOISE_FREE * np.sqrt(np.einsum("...ii->...i", R))).any(axis=1)
        if exact.any():
            H = jacobian_of_runs(self.measurement, prior.mean, step.epoch)
            reading = reading + np.where(exact[:, None], reading_size(Gaussian(prior.mean, prior.covariance), H), 0.0)
        update = root_update(X, Y, noise_root, self.measurement.residual(z, expected), reading)
        gain, posterior = update.gain, update.root
        places = list(considered_states(self.dynamics))
        if places:
            # What the update took from the considered block is put back as further columns of the root.
            gain, kept = gain.copy(), np.zeros_like(gain)
            kept[:, places], gain[:, places] = gain[:, places], 0.0
            posterior = kernels.roots.triangular(posterior, kept)
        mean = prior.mean + np.einsum("bnm,bm->bn", gain, update.white)
        return RootGaussian(mean, posterior), update.innovation

    def keep_considered(self, predicted: Any, corrected: Any) -> Any:
        """Return the corrected belief, whose considered states `correct` has kept already."""
        return corrected

    def _points(self, belief: RootGaussian) -> tuple[Array, Array]:
        """Return the sigma points (runs, 2 n + 1, n), the centre first, and their offsets (runs, 2 n, n)."""
        mean, root = np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.root)
        return kernels.sigma_points.points_of_root(mean, root, self._spread)

    def _deviations(self, images: Array) -> tuple[Array, Array]:
        """Return mean (runs, p) and weighted deviations from it (runs, p, 2 n + 1) of images less the centre's."""
        images = np.ascontiguousarray(images)
        return kernels.sigma_points.weighted_deviations(images, self._weight, self._centre_weight)
