"""Sampling a Gaussian prediction only where the measurement looks: shared by the divergence filters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation, in_kind, where_runs
from relnav_sim.filters.either_arithmetic import EitherArithmetic
from relnav_sim.filters.kalman import GaussianFilterOptions, innovation_of
from relnav_sim.filters.registry import create_filter
from relnav_sim.filters.ukf import UnscentedKalmanFilter, UnscentedOptions
from relnav_sim.linalg import CholeskyFactor, by_run, cholesky, kernel_for, transpose
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, linearised


def observed_states(measurement: Measurement, dimension: int) -> Indices:
    """Return the numbers of the components of the state the measurement depends on.

    A measurement says so by an attribute ``depends_on``, a tuple of component numbers; without it, or where it is
    None, the measurement is taken to depend on all of them.
    """
    stated = getattr(measurement, "depends_on", None)
    depends_on = tuple(range(dimension)) if stated is None else stated
    return np.array(sorted(depends_on), dtype=np.intp)


@dataclass(frozen=True)
class WhitenedPrior:
    """A prediction N(m, P) as x = m + G y + u: y ~ N(0, I) spans the d observed components, u the rest.

    The measurement fixes y alone, so p(u) outlives the update: a posterior N(a, C) of y gives exactly the mean
    m + G a and the covariance G C G^T + cov(u) of x (the regression of the unobserved components on the observed).

    Args:
        mean: m, (runs, n).
        covariance: P, (runs, n, n).
        roots: G^T = L^-1 P_o, (runs, d, n), where P_o are the observed rows of P and L L^T their observed block.
        remainder: cov(u), (runs, n, n); its observed rows and columns are zero.
        observed: The observed components.
    """

    mean: Array
    covariance: Array
    roots: Array
    remainder: Array
    observed: Indices

    def samples(self, mean: Array | None = None, root: Array | None = None) -> tuple[Array, Array]:
        """Return centre (runs, n) and root (runs, n, d) of the states of y = mean + root e, e ~ N(0, I), with u = 0.

        Args:
            mean: (runs, d); None: 0.
            root: (runs, d, d); None: I.
        """
        G = transpose(self.roots)
        if mean is None:
            return self.mean, G
        return self.mean + np.einsum("bdn,bd->bn", self.roots, mean), G if root is None else G @ root

    def coordinates(self, gaussian: Gaussian) -> tuple[Array, Array]:
        """Return mean (runs, d) and Cholesky factor (runs, d, d) of y for a Gaussian of x."""
        block = np.ix_(np.arange(len(self.mean)), self.observed, self.observed)
        factor = CholeskyFactor(self.covariance[block])
        offset = (gaussian.mean - self.mean)[:, self.observed]
        return factor.whiten(offset), factor.whiten_rows(cholesky(gaussian.covariance[block]))

    def posterior(self, mean: Array, covariance: Array) -> Gaussian:
        """Return the Gaussian of x for N(mean (runs, d), covariance (runs, d, d)) of y."""
        regressed = kernel_for(self.mean, kernels.sampling, "regressed")
        return Gaussian(*regressed(self.mean, self.roots, self.remainder, mean, covariance))


def whitened_prior(belief: Gaussian, observed: Indices) -> WhitenedPrior:
    """Return the prediction in the coordinates of its observed components."""
    m, P = np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.covariance)
    roots, remainder = kernel_for(P, kernels.sampling, "whitened")(P, observed)
    return WhitenedPrior(m, P, roots, remainder, observed)


@cache
def fixed_normals(dimension: int, samples: int) -> Array:
    """Return a fixed standard normal set (1, dimension, samples) with mean 0 and covariance I to rounding.

    Scrambled Sobol points (Owen 1998) through the inverse normal distribution, then shifted and rotated to the
    exact first two moments. It is the same set in every run and at every epoch.
    """
    from scipy.special import ndtri
    from scipy.stats import qmc  # scipy.stats takes longer to import than all else together

    sobol = qmc.Sobol(dimension, scramble=True, seed=20170906)
    normals = ndtri(sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]).T
    normals -= normals.mean(axis=1, keepdims=True)
    matched = np.linalg.solve(np.linalg.cholesky(normals @ normals.T / samples), normals)
    matched.flags.writeable = False
    return matched[None]


def sums_over_samples(w: Array, e: Array) -> Array:
    """Return sum_n w_n e_in, (runs, d), of weights (runs, samples) and samples (runs, d, samples).

    A stacked product, because `einsum` cuts sums over more than 8192 numbers where its buffer ends, which depends on
    how many runs come before.
    """
    sums: Array = (e @ w[:, :, None])[..., 0]
    return sums


@dataclass(frozen=True)
class Linearisation:
    """The measurement about the predicted mean: residual (runs, m), H, and R as the measurement gives it.

    `reading` is the size of z and its prediction, (runs, m), which decides what counts as rounding.
    """

    residual: Array
    reading: Array
    H: Array
    R: Array
    HPH: Array

    def innovation(self, r_scale: float = 1.0) -> Innovation:
        """Return NIS and log-likelihood of the Gaussian innovation with covariance H P H^T + r_scale R."""
        return innovation_of(self.HPH + r_scale * self.R, self.residual, self.reading)


class SamplingOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of every filter that samples the predicted Gaussian in its update."""


class SamplingFilter(EitherArithmetic):
    """Prediction, linearisation and fallback of a filter that samples the predicted Gaussian in its update."""

    stochastic = True
    # The sampled covariance, with one block put back, would in the end be indefinite.
    considers = False

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: SamplingOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._observed = observed_states(measurement, dynamics.dimension)
        self._arithmetic = options.arithmetic
        points = UnscentedOptions(arithmetic=options.arithmetic)
        self._sigma_points = UnscentedKalmanFilter(dynamics, measurement, points)

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the predicted moments: exact for linear dynamics, by the cubature rule for others."""
        predicted = self._sigma_points.predict(belief, step)
        return predicted if self._single is None else Gaussian(predicted.mean, predicted.covariance)

    def linear_step(self, belief: Gaussian, step: Step) -> tuple[Array, Array]:
        """Return F and Q of the linear step that the prediction amounts to."""
        return self._sigma_points.linear_step(belief, step)

    def linearise(self, belief: Gaussian, z: Array, epoch: int) -> Linearisation:
        """Return residual, H, R and H P H^T at the predicted mean."""
        residual, H, R = linearised(self.seen, z, belief.mean, epoch)
        no_noise = np.zeros((1, H.shape[-2], H.shape[-2]), self.kind)
        P = np.ascontiguousarray(belief.covariance)
        HPH = kernel_for(P, kernels.kalman, "predict")(P, by_run(H, self.kind), no_noise)
        return Linearisation(residual, np.abs(z) + np.abs(z - residual), H, R, HPH)

    def iterated_update(self, belief: Gaussian, z: Array, alpha: float, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the update of the iterated extended Kalman filter with R / alpha."""
        tempered = _Tempered(self.measurement, alpha)
        iekf = create_filter("iekf", self.dynamics, tempered, arithmetic=self._arithmetic)
        posterior, innovation = iekf.update(belief, z, step)
        return in_kind(posterior, self.kind), innovation

    def with_fallback(
        self, posterior: Gaussian, usable: Mask, belief: Gaussian, z: Array, alpha: float, step: Step
    ) -> tuple[Gaussian, dict[int, str]]:
        """Return the posterior with the iterated update in the runs (runs,) that are not usable, and which failed."""
        if usable.all():
            return posterior, {}
        fallback, told = self.iterated_update(belief, z, alpha, step)
        failed = {place: why for place, why in told.failed.items() if not usable[place]}
        return where_runs(usable, posterior, fallback), failed


class _Tempered(MeasurementDefaults):
    """A measurement whose noise covariance is divided by alpha."""

    def __init__(self, measurement: Measurement, alpha: float) -> None:
        self._measurement, self._alpha = measurement, alpha
        self.dimension = measurement.dimension

    def predict(self, states: Array, epoch: int) -> Array:
        return self._measurement.predict(states, epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        return self._measurement.jacobian(states, epoch)

    def residual(self, z: Array, predicted: Array) -> Array:
        return self._measurement.residual(z, predicted)

    def noise(self, mean: Array, epoch: int) -> Array:
        return self._measurement.noise(mean, epoch) / self._alpha
