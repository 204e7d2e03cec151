"""Gaussian-process regression: a trained process, predicting over (runs, points).

Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, ch. 2. One kernel is shared by all outputs, so
one Cholesky factor and one set of kernel values serve them all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices

# Noise variance over signal variance. With less, the Cholesky factor of a smooth kernel has no correct digits left.
LEAST_NOISE = 1e-11


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
        whitener: L^-1, (S, S), lower triangular, L L^T = C + noise_ratio I.
        noise_counted: Whether variances are those of noisy outputs, or of what they are noisy measurements of.
    """

    kernel: Kernel
    inputs: Array
    weights: Array
    whitener: Array
    noise_counted: bool = True

    @property
    def output_scale(self) -> Array:
        """The outputs' scales s_y, (q,)."""
        return self.kernel.output_scale

    def predict(self, points: Array) -> Array:
        """Return the outputs' means (runs, N, q) at points (runs, N, d)."""
        mean, _ = self._predicted(points, with_variance=False)
        return mean

    def predict_with_variance(self, points: Array) -> tuple[Array, Array]:
        """Return the means (runs, N, q), and the variance of a standardised output, (runs, N)."""
        return self._predicted(points)

    def variance(self, points: Array) -> Array:
        """Return the variance of a standardised output at points (runs, N, d): (runs, N)."""
        _, variance = self._predicted(points, with_mean=False)
        return variance

    def jacobian(self, points: Array) -> Array:
        """Return the derivatives of the means with respect to the inputs, (runs, q, d), at points (runs, d)."""
        kernel = self.kernel
        slopes = kernels.gp.slopes(
            np.ascontiguousarray(points), kernel.input_mean, kernel.length, self.inputs, self.weights
        )
        return slopes * (kernel.output_scale[:, None] / kernel.length)

    def _predicted(self, points: Array, with_mean: bool = True, with_variance: bool = True) -> tuple[Array, Array]:
        """Return means and variances as `predict_with_variance`; those not asked for mean nothing."""
        kernel, (runs, N, d) = self.kernel, points.shape
        mean, explained = kernels.gp.predict(
            np.ascontiguousarray(points).reshape(runs * N, d),
            kernel.input_mean,
            kernel.length,
            self.inputs,
            self.weights,
            self.whitener,
            with_mean,
            with_variance,
        )
        mean *= kernel.output_scale
        mean += kernel.output_mean
        # Next to a training point rounding can leave less than nothing.
        left = np.maximum(1 - explained, 0)
        variance = kernel.signal_variance * (left + kernel.noise_ratio if self.noise_counted else left)
        return mean.reshape(runs, N, -1), variance.reshape(runs, N)


def condition(kernel: Kernel, inputs: Array, outputs: Array, noise_counted: bool = True) -> GaussianProcess:
    """Return the process given training inputs (S, d) and outputs (S, q).

    Raises:
        numpy.linalg.LinAlgError: The noise ratio is too small for these inputs.
    """
    from scipy.linalg import solve_triangular

    scaled = np.ascontiguousarray(kernel.scaled(inputs))
    L = np.linalg.cholesky(kernel.correlation(scaled) + kernel.noise_ratio * np.eye(len(scaled)))
    standardised = (outputs - kernel.output_mean) / kernel.output_scale
    weights = solve_triangular(L.T, solve_triangular(L, standardised, lower=True))
    whitener = solve_triangular(L, np.eye(len(L)), lower=True)
    return GaussianProcess(kernel, scaled, np.ascontiguousarray(weights), np.ascontiguousarray(whitener), noise_counted)


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
