"""Mean, spread and largest value of successive chunks of epochs, without a pass back over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers, Mask


@dataclass(frozen=True)
class Moments:
    """Count, mean, sum of squared deviations and largest size of some quantities, per run.

    Attributes:
        count: Epochs counted (runs,).
        mean: Mean (quantities, runs); 0 where nothing was counted.
        squares: Sum of squared deviations from the mean (quantities, runs).
        largest: Largest absolute value (quantities, runs).
    """

    count: Integers
    mean: Array
    squares: Array
    largest: Array

    def std(self) -> Array:
        """Return the standard deviation with divisor n, (quantities, runs); NaN where nothing was counted."""
        return np.sqrt(self.squares / self._divisor())

    def rms(self) -> Array:
        """Return the root mean square (quantities, runs); NaN where nothing was counted."""
        return np.sqrt(np.square(self.mean) + self.squares / self._divisor())

    def known(self, values: Array) -> Array:
        """Return the values with NaN where nothing was counted."""
        return np.where(self.count > 0, values, np.nan)

    def _divisor(self) -> Array:
        return np.where(self.count > 0, self.count, np.nan)


def no_moments(quantities: int, runs: int) -> Moments:
    """Return the moments of nothing."""
    zeros = np.zeros((quantities, runs))
    return Moments(np.zeros(runs, dtype=np.int64), zeros, zeros, zeros)


def moments(values: Array, counted: Mask) -> Moments:
    """Return the moments of one chunk.

    Args:
        values: (runs, epochs, quantities).
        counted: Epochs that count (runs, epochs).
    """
    values, counted = np.ascontiguousarray(values), np.ascontiguousarray(counted)
    count, sums = kernels.counting.moments(values, counted, 0, values.shape[1])
    return Moments(count, *sums)


def merged(a: Moments, b: Moments) -> Moments:
    """Return the moments of two successive chunks together (Chan, Golub and LeVeque 1983, eq. 2.1)."""
    count = a.count + b.count
    total = np.maximum(count, 1)
    shift = b.mean - a.mean
    return Moments(
        count,
        a.mean + shift * (b.count / total),
        a.squares + b.squares + np.square(shift) * (a.count * (b.count / total)),
        np.maximum(a.largest, b.largest),
    )
