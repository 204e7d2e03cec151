"""Do errors and innovations match the covariances the filter states? NEES, ellipsoid coverage, NIS.

Definitions: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
section 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.results import layout
from relnav_sim.statistics.moments import Moments, merged, no_moments


def normalised_errors(error: Array, covariance: Array) -> tuple[Array, Mask, Mask]:
    """Return e^T P^-1 e of the whole state and of its position and velocity parts (their marginal covariances).

    Args:
        error: (runs, K, 6).
        covariance: (runs, K, 6, 6); only the lower triangle is read. Quickest where the epochs lie one after the other
            in memory.

    Returns:
        NEES (3, runs, K) in the order of `layout.BLOCKS`; whether the covariance is positive definite, and whether it
        is finite, (runs, K). The NEES of a covariance that is not is NaN or meaningless.
    """
    by_epoch = np.ascontiguousarray(covariance.swapaxes(0, 1))
    return kernels.statistics.normalised_errors(np.ascontiguousarray(error), by_epoch)


def chi_square_quantile(probability: float, dof: float) -> float:
    """Return the value that a chi-square variable of ``dof`` degrees of freedom stays below with a probability."""
    from scipy.special import gammaincinv

    return float(2 * gammaincinv(dof / 2, probability))


@dataclass(frozen=True)
class NeesSums:
    """Sums of NEES and counts inside the ellipsoids, per run: count (runs,), total (3, runs), inside (3, 5, runs)."""

    count: Integers
    total: Array
    inside: Integers

    def anees(self) -> Array:
        """Return the mean NEES divided by its degrees of freedom, (3, runs); NaN where nothing was counted."""
        return self.total / np.array(layout.BLOCK_SIZES)[:, None] / _divisor(self.count)

    def coverage(self) -> Array:
        """Return the share of epochs inside each ellipsoid, (3, 5, runs); NaN where nothing was counted."""
        return self.inside / _divisor(self.count)


def no_nees(runs: int) -> NeesSums:
    """Return the sums over nothing."""
    blocks, levels = len(layout.BLOCKS), len(layout.LEVELS)
    return NeesSums(
        np.zeros(runs, dtype=np.int64), np.zeros((blocks, runs)), np.zeros((blocks, levels, runs), dtype=np.int64)
    )


def merged_nees(a: NeesSums, b: NeesSums) -> NeesSums:
    """Return the sums over two chunks together."""
    return NeesSums(a.count + b.count, a.total + b.total, a.inside + b.inside)


def nees_limits() -> Array:
    """Return the chi-square quantiles of `layout.LEVELS` for each block of the state, (3, 5)."""
    return np.array([[chi_square_quantile(p, n) for p in layout.LEVELS] for n in layout.BLOCK_SIZES])


@dataclass(frozen=True)
class NisSums:
    """Moments of the NIS over updates, and the products of neighbours for its autocorrelation; arrays (runs,)."""

    moments: Moments
    products: Array
    first: Array
    last: Array

    def mean(self) -> Array:
        """Return the mean NIS (runs,); NaN without updates."""
        return self.moments.known(self.moments.mean)[0]

    def autocorrelation(self) -> Array:
        """Return the lag-1 autocorrelation over successive updates (runs,); NaN for fewer than 3 updates.

        sum (x_i - m)(x_{i+1} - m) / sum (x_i - m)^2 (Box and Jenkins 1976, eq. 2.1.12).
        """
        n, mean = self.moments.count, self.moments.mean[0]
        cross = self.products - mean * (2 * n * mean - self.first - self.last) + (n - 1) * np.square(mean)
        squares = self.moments.squares[0]
        return np.where((n >= 3) & (squares > 0), cross / np.where(squares > 0, squares, np.nan), np.nan)


def no_nis(runs: int) -> NisSums:
    """Return the sums over nothing."""
    zeros = np.zeros(runs)
    return NisSums(no_moments(1, runs), zeros, zeros, zeros)


def nis_sums(nis: Array, counted: Mask, epochs: slice) -> NisSums:
    """Return the sums over some epochs of a chunk, (runs, K); NaN rows are epochs without a measurement."""
    count, sums = kernels.counting.successive(np.ascontiguousarray(nis), counted, epochs.start, epochs.stop)
    return NisSums(Moments(count, *sums[:3, None]), *sums[3:])


def merged_nis(a: NisSums, b: NisSums) -> NisSums:
    """Return the sums over two successive chunks together."""
    none_before, none_after = a.moments.count == 0, b.moments.count == 0
    border = np.where(none_before | none_after, 0.0, a.last * b.first)
    return NisSums(
        merged(a.moments, b.moments),
        a.products + b.products + border,
        np.where(none_before, b.first, a.first),
        np.where(none_after, a.last, b.last),
    )


def at_common_dof(nis: Array, dof: Integers, common: Integers) -> Array:
    """Return the NIS shifted and scaled to the mean and variance of ``common`` degrees of freedom.

    A NIS of d degrees of freedom has mean d and variance 2 d, so that x = NIS sqrt(c / d) - (sqrt(c d) - c) has mean c
    and variance 2 c for every d: measurements with missing channels then leave no correlation of their own. Where d = c
    it is the NIS itself, to the bit.

    Args:
        nis: (runs, epochs); NaN without a measurement.
        dof: Its degrees of freedom (runs, epochs); 0 without a measurement.
        common: (runs,), positive where there is any measurement.
    """
    c, d = np.maximum(common, 1)[:, None].astype(float), np.maximum(dof, 1).astype(float)
    return np.asarray(nis * np.sqrt(c / d) - (np.sqrt(c * d) - c))


@dataclass(frozen=True)
class SensorSums:
    """Sums over the updates of one sensor, or of all, per run.

    Attributes:
        alike: Those of the NIS at common degrees of freedom.
        nis: Sum of the NIS (runs,).
        dof: Sum of its degrees of freedom (runs,).
    """

    alike: NisSums
    nis: Array
    dof: Integers

    @property
    def updates(self) -> Integers:
        """Number of updates (runs,)."""
        return self.alike.moments.count

    @property
    def lag1(self) -> Array:
        """Autocorrelation of the NIS between successive updates (runs,)."""
        return self.alike.autocorrelation()


def no_sensor(runs: int) -> SensorSums:
    """Return the sums over nothing."""
    return SensorSums(no_nis(runs), np.zeros(runs), np.zeros(runs, dtype=np.int64))


def sensor_sums(alike: NisSums, nis: Array, dof: Integers, counted: Mask, epochs: slice) -> SensorSums:
    """Return the sums over some epochs of a chunk, (runs, K); epochs without a NIS are not counted."""
    nis, dof = nis[:, epochs], dof[:, epochs]
    updated = counted[:, epochs] & np.isfinite(nis)
    return SensorSums(alike, np.where(updated, nis, 0.0).sum(axis=-1), np.where(updated, dof, 0).sum(axis=-1))


def merged_sensor(a: SensorSums, b: SensorSums, alike: NisSums | None = None) -> SensorSums:
    """Return the sums over two successive chunks together; ``alike``: their sums at common degrees, if known."""
    return SensorSums(merged_nis(a.alike, b.alike) if alike is None else alike, a.nis + b.nis, a.dof + b.dof)


def _divisor(count: Integers) -> Array:
    return np.where(count > 0, count, np.nan)
