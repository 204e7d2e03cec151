"""Sampling a Gaussian prediction only where the measurement looks: shared by the divergence filters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtri

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, where_runs
from relnav_sim.filters.kalman import GaussianFilter, GaussianFilterOptions, innovation_of
from relnav_sim.filters.registry import create_filter
from relnav_sim.filters.ukf import UnscentedKalmanFilter, UnscentedOptions
from relnav_sim.linalg import CholeskyFactor, cholesky, symmetric, transpose
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults

Index = slice | Indices


def observed_states(measurement: Measurement, dimension: int) -> Index:
    """Return which components of the state the measurement depends on.

    A measurement says so by an attribute ``depends_on``, a tuple of component numbers; without it, or where it is
    None, the measurement is taken to depend on all of them.
    """
    stated = getattr(measurement, "depends_on", None)
    depends_on = tuple(range(dimension)) if stated is None else stated
    first, last = min(depends_on, default=0), max(depends_on, default=0)
    if set(depends_on) == set(range(first, last + 1)):
        return slice(first, last + 1)
    return np.array(sorted(depends_on), dtype=np.intp)


@dataclass(frozen=True)
class WhitenedPrior:
    """A prediction N(m, P) as x = m + G y + u: y ~ N(0, I) spans the d observed components, u the rest.

    The measurement fixes y alone, so p(u) outlives the update: a posterior N(a, C) of y gives exactly the mean
    m + G a and the covariance G C G^T + cov(u) of x (the regression of the unobserved components on the observed).

    Args:
        mean: m, (runs, n).
        roots: G^T = L^-1 P_o, (runs, d, n), where P_o are the observed rows of P and L L^T their observed block.
        remainder: cov(u), (runs, n, n); its observed rows and columns are zero.
        factor: L.
        observed: The observed components.
    """

    mean: Array
    roots: Array
    remainder: Array
    factor: CholeskyFactor
    observed: Index

    def states(self, y: Array) -> Array:
        """Return the states of y (runs, d, N) with u = 0 and the unobserved components at m, (runs, N, n)."""
        # One product for all, [G m] [y; 1]: adding the mean would cost another pass over memory. Stored with the
        # samples last: each component is then contiguous for the measurement's arithmetic.
        runs, d, samples = y.shape
        root_and_mean = np.zeros((*self.mean.shape, d + 1))
        root_and_mean[:, self.observed, :d] = transpose(self.roots[:, :, self.observed])
        root_and_mean[:, :, d] = self.mean
        return transpose(root_and_mean @ np.concatenate([y, np.ones((runs, 1, samples))], axis=1))

    def coordinates(self, gaussian: Gaussian) -> tuple[Array, Array]:
        """Return mean (runs, d) and Cholesky factor (runs, d, d) of y for a Gaussian of x."""
        offset = (gaussian.mean - self.mean)[:, self.observed]
        spread = cholesky(gaussian.covariance[:, self.observed, :][:, :, self.observed])
        return self.factor.whiten(offset), self.factor.whiten_rows(spread)

    def posterior(self, mean: Array, covariance: Array) -> Gaussian:
        """Return the Gaussian of x for N(mean (runs, d), covariance (runs, d, d)) of y."""
        P = transpose(self.roots) @ covariance @ self.roots + self.remainder
        return Gaussian(self.mean + np.einsum("bdn,bd->bn", self.roots, mean), symmetric(P))


def whitened_prior(belief: Gaussian, observed: Index) -> WhitenedPrior:
    """Return the prediction in the coordinates of its observed components."""
    P = belief.covariance
    rows = P[:, observed, :]
    factor = CholeskyFactor(rows[:, :, observed])
    roots = factor.whiten_rows(rows)
    if rows.shape == P.shape:
        return WhitenedPrior(belief.mean, roots, np.zeros_like(P), factor, observed)
    remainder = P - transpose(roots) @ roots
    remainder[:, observed, :] = 0.0
    remainder[:, :, observed] = 0.0
    return WhitenedPrior(belief.mean, roots, remainder, factor, observed)


@cache
def fixed_normals(dimension: int, samples: int) -> Array:
    """Return a fixed standard normal set (1, dimension, samples) with mean 0 and covariance I to rounding.

    Scrambled Sobol points (Owen 1998) through the inverse normal distribution, then shifted and rotated to the
    exact first two moments. It is the same set in every run and at every epoch.
    """
    from scipy.stats import qmc  # scipy.stats takes longer to import than all else together

    sobol = qmc.Sobol(dimension, scramble=True, seed=20170906)
    normals = ndtri(sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]).T
    normals -= normals.mean(axis=1, keepdims=True)
    matched = np.linalg.solve(np.linalg.cholesky(normals @ normals.T / samples), normals)
    matched.flags.writeable = False
    return matched[None]


@cache
def _fixed_products(dimension: int, samples: int) -> Array:
    """Return 1, e and the products e_i e_j, j <= i, of the fixed set's points e, (1 + d + d (d + 1) / 2, samples)."""
    e = fixed_normals(dimension, samples)[0]
    i, j = np.tril_indices(dimension)
    return np.concatenate([np.ones((1, samples)), e, e[i] * e[j]])


def fixed_sums(w: Array, dimension: int, samples: int) -> tuple[Array, Array, Array]:
    """Return what `weighted_sums` does for the fixed set, at a third of the cost."""
    sums = (_fixed_products(dimension, samples) @ w[:, :, None])[:, :, 0]
    i, j = np.tril_indices(dimension)
    products = np.empty((len(w), dimension, dimension))
    products[:, i, j] = products[:, j, i] = sums[:, dimension + 1 :]
    return sums[:, 0], sums[:, 1 : dimension + 1], products


def sums_over_samples(w: Array, e: Array) -> Array:
    """Return sum_n w_n e_in, (runs, d), of weights (runs, samples) and samples (runs, d, samples).

    A stacked product, because `einsum` cuts sums over more than 8192 numbers where its buffer ends, which depends on
    how many runs come before.
    """
    sums: Array = (e @ w[:, :, None])[..., 0]
    return sums


def weighted_sums(w: Array, e: Array) -> tuple[Array, Array, Array]:
    """Return sum w (runs,), sum w e (runs, d), sum w e e^T (runs, d, d) of samples e (runs, d, N), w (runs, N)."""
    d = e.shape[1]
    products = np.empty((len(w), d, d))
    for i in range(d):
        row = sums_over_samples(w * e[:, i], e[:, : i + 1])
        products[:, i, : i + 1] = row
        products[:, : i + 1, i] = row
    return w.sum(axis=1), sums_over_samples(w, e), products


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


class SamplingFilter(GaussianFilter):
    """Prediction, linearisation and fallback of a filter that samples the predicted Gaussian in its update."""

    stochastic = True
    # The sampled covariance, with one block put back, would in the end be indefinite.
    considers = False

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianFilterOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._observed = observed_states(measurement, dynamics.dimension)
        self._sigma_points = UnscentedKalmanFilter(dynamics, measurement, UnscentedOptions())

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the predicted moments: exact for linear dynamics, by the cubature rule for others."""
        return self._sigma_points.predict(belief, step)

    def linearise(self, belief: Gaussian, z: Array, epoch: int) -> Linearisation:
        """Return residual, H, R and H P H^T at the predicted mean."""
        predicted = self.measurement.predict(belief.mean, epoch)
        residual = self.measurement.residual(z, predicted)
        H = self.measurement.jacobian(belief.mean, epoch)
        HPH = symmetric(H @ belief.covariance @ transpose(H))
        R = self.measurement.noise(belief.mean, epoch)
        return Linearisation(residual, np.abs(z) + np.abs(predicted), H, R, HPH)

    def iterated_update(self, belief: Gaussian, z: Array, alpha: float, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the update of the iterated extended Kalman filter with R / alpha."""
        iekf = create_filter("iekf", self.dynamics, _Tempered(self.measurement, alpha))
        update: tuple[Gaussian, Innovation] = iekf.update(belief, z, step)
        return update

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
