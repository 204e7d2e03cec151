"""Gaussian-process regression: a trained process, predicting over (runs, points).

Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, ch. 2. One kernel is shared by all outputs, so
one Cholesky factor and one set of kernel values serve them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular

from relnav_sim.arrays import Array, Indices

# Noise variance over signal variance. With less, the Cholesky factor of a smooth kernel has no correct digits left.
LEAST_NOISE = 1e-11
# Points whose kernel values stay in a core's cache while they are worked on.
_POINTS_AT_ONCE = 256
# The triangular inverse of the factor is applied in this many blocks, each without most of its zeros.
_BLOCKS = 4


@dataclass(frozen=True)
class Kernel:
    """Squared-exponential kernel with a length scale for every input, and how data are standardised for it.

    cov(y(x), y(x')) = s_y^2 sf^2 [exp(-sum_j (x_j - x'_j)^2 / (2 l_j^2)) + noise_ratio (x is x')].

    Args:
        input_mean: (d,).
        length: l, in the inputs' units, (d,).
        output_mean: (q,).
        output_scale: s_y, (q,).
        signal_variance: sf^2 of the standardised outputs.
        noise_ratio: Variance of the noise on the outputs over that of the signal.
    """

    input_mean: Array
    length: Array
    output_mean: Array
    output_scale: Array
    signal_variance: float
    noise_ratio: float

    def scaled(self, inputs: Array) -> Array:
        """Return inputs (..., d) less their mean, in lengths."""
        return (inputs - self.input_mean) / self.length

    def correlation(self, scaled: Array) -> Array:
        """Return the correlations without noise of points (S, d) in lengths: (S, S)."""
        squares = np.zeros((len(scaled), len(scaled)))
        for column in scaled.T:
            squares += np.square(column[:, None] - column)
        return np.asarray(np.exp(-0.5 * squares))


@dataclass(frozen=True)
class GaussianProcess:
    """A Gaussian process that has seen its training data; made by `condition`.

    Args:
        kernel: The kernel.
        inputs: Training inputs in lengths, (S, d).
        weights: (C + noise_ratio I)^-1 Y, (S, q), with C the correlation and Y the standardised outputs.
        whitener: L^-T, (S, S), upper triangular, L L^T = C + noise_ratio I.
    """

    kernel: Kernel
    inputs: Array
    weights: Array
    whitener: Array

    def predict(self, points: Array) -> Array:
        """Return the outputs' means (runs, N, q) at points (runs, N, d)."""
        mean = np.empty((*points.shape[:2], self.weights.shape[1]))
        for part, correlation in self._correlations(points):
            np.matmul(correlation, self.weights, out=mean[part])
        return self._in_units(mean)

    def predict_with_variance(self, points: Array) -> tuple[Array, Array]:
        """Return the means (runs, N, q), and the variance of a standardised noisy output, (runs, N)."""
        mean = np.empty((*points.shape[:2], self.weights.shape[1]))
        explained = np.empty(points.shape[:2])
        for part, correlation in self._correlations(points):
            np.matmul(correlation, self.weights, out=mean[part])
            explained[part] = self._explained(correlation)
        return self._in_units(mean), self._variance(explained)

    def variance(self, points: Array) -> Array:
        """Return the variance of a standardised noisy output at points (runs, N, d): (runs, N)."""
        explained = np.empty(points.shape[:2])
        for part, correlation in self._correlations(points):
            explained[part] = self._explained(correlation)
        return self._variance(explained)

    def jacobian(self, points: Array) -> Array:
        """Return the derivatives of the means with respect to the inputs, (runs, q, d), at points (runs, d)."""
        slopes = np.empty((*points.shape[:1], self.weights.shape[1], points.shape[1]))
        for (runs, _), correlation in self._correlations(points[:, None]):
            # d c_s / d x = c_s (X_s - x) in lengths
            offsets = self.inputs - self.kernel.scaled(points[runs])[:, None]
            slopes[runs] = (self.weights.T * correlation) @ offsets
        return slopes * (self.kernel.output_scale[:, None] / self.kernel.length)

    def _in_units(self, mean: Array) -> Array:
        mean *= self.kernel.output_scale
        mean += self.kernel.output_mean
        return mean

    def _variance(self, explained: Array) -> Array:
        # Next to a training point rounding can leave less than nothing.
        left = np.maximum(1 - explained, 0)
        return np.asarray(self.kernel.signal_variance * (left + self.kernel.noise_ratio))

    def _explained(self, correlation: Array) -> Array:
        """Return |L^-1 c|^2, the share of the variance that the training data explain, (runs, points)."""
        S = len(self.inputs)
        edges = [S * block // _BLOCKS for block in range(_BLOCKS + 1)]
        explained = np.zeros(correlation.shape[:2])
        for first, last in pairwise(edges):
            white = correlation[..., :last] @ self.whitener[:last, first:last]
            explained += np.einsum("bps,bps->bp", white, white)
        return explained

    def _correlations(self, points: Array) -> Iterator[tuple[tuple[slice, slice], Array]]:
        """Yield parts of the points' two axes with their correlations to the training points, (runs, points, S).

        All products are one matrix product per run, of a size that depends on N alone, so that a run's bits do not
        depend on the others of its block.
        """
        runs, N, _ = points.shape
        runs_at_once = max(1, _POINTS_AT_ONCE // max(N, 1))
        squares = np.square(self.inputs).sum(axis=1)
        towards = -2 * np.ascontiguousarray(self.inputs.T)
        for run in range(0, runs, runs_at_once):
            for point in range(0, N, _POINTS_AT_ONCE):
                part = (slice(run, run + runs_at_once), slice(point, point + _POINTS_AT_ONCE))
                scaled = np.ascontiguousarray(self.kernel.scaled(points[part]))
                correlation = scaled @ towards
                correlation += squares
                correlation += np.einsum("bpd,bpd->bp", scaled, scaled)[..., None]
                np.maximum(correlation, 0, out=correlation)
                correlation *= -0.5
                np.exp(correlation, out=correlation)
                yield part, correlation


def condition(kernel: Kernel, inputs: Array, outputs: Array) -> GaussianProcess:
    """Return the process given training inputs (S, d) and outputs (S, q).

    Raises:
        numpy.linalg.LinAlgError: The noise ratio is too small for these inputs.
    """
    scaled = kernel.scaled(inputs)
    L = np.linalg.cholesky(kernel.correlation(scaled) + kernel.noise_ratio * np.eye(len(scaled)))
    standardised = (outputs - kernel.output_mean) / kernel.output_scale
    weights = solve_triangular(L.T, solve_triangular(L, standardised, lower=True))
    whitener = solve_triangular(L, np.eye(len(L)), lower=True).T
    return GaussianProcess(kernel, scaled, np.ascontiguousarray(weights), np.ascontiguousarray(whitener))


def most_informative(kernel: Kernel, inputs: Array, count: int) -> Indices:
    """Return the indices of the `count` inputs (S, d) that explain most, each the least explained by those before.

    A pivoted Cholesky decomposition (Foster et al., J. Machine Learning Research 10, 2009).
    """
    correlation = kernel.correlation(kernel.scaled(inputs))
    left = np.ones(len(inputs))
    columns = np.zeros((len(inputs), count))
    chosen = np.empty(count, dtype=np.intp)
    for k in range(count):
        pivot = int(np.argmax(left))
        chosen[k] = pivot
        columns[:, k] = correlation[:, pivot] - columns[:, :k] @ columns[pivot, :k]
        columns[:, k] /= np.sqrt(max(left[pivot], LEAST_NOISE))
        left -= np.square(columns[:, k])
        left[chosen[: k + 1]] = -np.inf
    return chosen
