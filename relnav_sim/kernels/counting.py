"""Sums over the epochs of each run: moments, counts in bins and in ellipsoids, neighbours, how long errors stay small.

Sums go over a run's epochs in their order. What is summed together lies side by side: the quantities of an epoch.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.kernels.compiling import count as counter
from relnav_sim.kernels.compiling import flag, given, inlined, inner, integer, kernel, number, written
from relnav_sim.kernels.elementary import bits

Counts = NDArray[np.int32]
Bins = tuple[int, int]
"""By how many bits a number is shifted to the right to tell its bin, and what to take off then."""


def _bins(types: Any) -> Any:
    return types.UniTuple(types.int64, 2)


@kernel(given(3), given(2, flag), integer, integer)
def moments(values: Array, counted: Mask, first: int, stop: int) -> tuple[Integers, Array]:
    """Return the number of counted epochs (runs,), and the mean, the squares and the largest size, (3, q, runs).

    Args:
        values: (runs, K, q).
        counted: Epochs that count (runs, K).
        first: First epoch of the span.
        stop: The epoch behind it.
    """
    runs, _, q = values.shape
    count, sums = np.empty(runs, dtype=np.int64), np.empty((3, q, runs))
    for run in range(runs):
        count[run] = _moments(values[run, first:stop], counted[run, first:stop], run, sums)
    return count, sums


@kernel(
    given(3),
    given(3),
    given(2),
    given(2, flag),
    integer,
    integer,
    given(2),
    _bins,
    written(3, counter),
    written(2),
)
def errors(
    error: Array,
    nees: Array,
    log_likelihood: Array,
    counted: Mask,
    first: int,
    stop: int,
    limits: Array,
    bins: Bins,
    places: Counts,
    distance: Array,
) -> tuple[Integers, Array, Array, Integers]:
    """Count the errors of the epochs from `first` up to `stop`.

    Args:
        error: (runs, K, 6).
        nees: Of its parts (parts, runs, K).
        log_likelihood: (runs, K).
        counted: Epochs that count (runs, K).
        first: First epoch of the span.
        stop: The epoch behind it.
        limits: Of the NEES (parts, levels).
        bins: How a bin is told.
        places: Counts of the norms of position and velocity in bins (2, runs, bins), which are added to.
        distance: Set to the position's norm where it counts (runs, K).

    Returns:
        Counted epochs (runs,); mean, squares and largest size of the six components and two norms (3, 8, runs); sums of
        the NEES and, last, of the log-likelihood (parts + 1, runs); epochs within each limit (parts, levels, runs).
    """
    parts, runs, _ = nees.shape
    levels = limits.shape[1]
    count, sums = np.empty(runs, dtype=np.int64), np.empty((3, 8, runs))
    totals, inside = np.zeros((parts + 1, runs)), np.zeros((parts, levels, runs), dtype=np.int64)
    x, within = np.empty((stop - first, 8)), np.empty(levels, dtype=np.int64)
    for run in range(runs):
        for k in range(first, stop):
            for i in range(6):
                x[k - first, i] = error[run, k, i]
            if counted[run, k]:
                r = _norm(error[run, k, 0], error[run, k, 1], error[run, k, 2])
                v = _norm(error[run, k, 3], error[run, k, 4], error[run, k, 5])
                x[k - first, 6], x[k - first, 7] = r, v
                distance[run, k] = r
                places[0, run, _bin(r, bins, places.shape[2])] += 1
                places[1, run, _bin(v, bins, places.shape[2])] += 1
                totals[parts, run] += log_likelihood[run, k]
        count[run] = _moments(x, counted[run, first:stop], run, sums)
        for part in range(parts):
            total = 0.0
            for level in range(levels):
                within[level] = 0
            for k in range(first, stop):
                value = nees[part, run, k]
                total += value if counted[run, k] else 0.0
                for level in range(levels):
                    within[level] += (value <= limits[part, level]) & counted[run, k]
            totals[part, run] = total
            for level in range(levels):
                inside[part, level, run] = within[level]
    return count, sums, totals, inside


@kernel(given(2), given(2, flag), integer, integer)
def successive(x: Array, counted: Mask, first: int, stop: int) -> tuple[Integers, Array]:
    """Return how many finite numbers count (runs,), and their sums over the epochs from `first` up to `stop`.

    Args:
        x: (runs, K).
        counted: Epochs that count (runs, K).
        first: First epoch of the span.
        stop: The epoch behind it.

    Returns:
        The number; mean, squares, largest size, sum of the products of neighbours, first and last of them (6, runs).
    """
    runs = len(x)
    count, sums = np.zeros(runs, dtype=np.int64), np.zeros((6, runs))
    for run in range(runs):
        total, products, largest, last, n = 0.0, 0.0, 0.0, 0.0, 0
        for k in range(first, stop):
            value = x[run, k]
            if counted[run, k] and abs(value) < math.inf:
                if n == 0:
                    sums[4, run] = value
                total += value
                products += value * last
                largest = max(largest, abs(value))
                last = value
                n += 1
        mean, squares = total / max(n, 1), 0.0
        for k in range(first, stop):
            value = x[run, k]
            if counted[run, k] and abs(value) < math.inf:
                squares += (value - mean) * (value - mean)
        count[run] = n
        sums[0, run], sums[1, run], sums[2, run], sums[3, run], sums[5, run] = mean, squares, largest, products, last
    return count, sums


@kernel(given(2), integer, number, _bins, written(1), written(1, integer), written(2, counter))
def staying(
    x: Array, window: int, threshold: float, bins: Bins, smallest: Array, not_below: Integers, places: Counts
) -> None:
    """Count the running minimum of the largest of each `window` successive columns of x (runs, K).

    Within pieces of `window` columns the largest so far from the left and from the right; every window is the end of
    one piece and the beginning of the next (van Herk, Pattern Recognition Letters 13(7), 1992).

    Args:
        x: (runs, K), K >= window.
        window: Columns.
        threshold: What is counted as not below.
        bins: How a bin is told.
        smallest: The minimum so far (runs,), which goes on.
        not_below: Windows at which the minimum was not below the threshold (runs,), which is added to.
        places: Counts of the minimum in bins (runs, bins), which are added to.
    """
    runs, K = x.shape
    from_right = np.empty(K)
    for run in range(runs):
        for piece in range(0, K, window):
            last = min(piece + window, K) - 1
            from_right[last] = x[run, last]
            for k in range(last - 1, piece - 1, -1):
                from_right[k] = max(from_right[k + 1], x[run, k])
        low, from_left, above, count = smallest[run], 0.0, window - 1, 0
        place = _bin(low, bins, places.shape[1])
        for k in range(K):
            above = 0 if above == window - 1 else above + 1
            from_left = x[run, k] if above == 0 else max(from_left, x[run, k])
            if k >= window - 1:
                largest = max(from_right[k - window + 1], from_left)
                if largest < low:
                    low = largest
                    place = _bin(low, bins, places.shape[1])
                count += low >= threshold
                places[run, place] += 1
        smallest[run] = low
        not_below[run] += count


@inner
def _moments(x: Array, counted: Mask, run: int, sums: Array) -> int:
    """Set a run's mean, squares and largest size, sums[:, :, run], of x (K, q); return how many epochs count."""
    q = x.shape[1]
    total, largest, count = np.zeros(q), np.zeros(q), 0
    for k in range(len(x)):
        if counted[k]:
            count += 1
            for i in range(q):
                total[i] += x[k, i]
                largest[i] = max(largest[i], abs(x[k, i]))
    mean, squares = np.empty(q), np.zeros(q)
    for i in range(q):
        mean[i] = total[i] / max(count, 1)
    for k in range(len(x)):
        if counted[k]:
            for i in range(q):
                squares[i] += (x[k, i] - mean[i]) * (x[k, i] - mean[i])
    for i in range(q):
        sums[0, i, run], sums[1, i, run], sums[2, i, run] = mean[i], squares[i], largest[i]
    return count


@inlined
def _norm(x: float, y: float, z: float) -> float:
    return math.sqrt((x * x + y * y) + z * z)


@inlined
def _bin(value: float, bins: Bins, count: int) -> int:
    """Return the bin of a value >= 0 out of so many: exponent and first bits of the fraction."""
    return min(max((bits(value) >> bins[0]) - bins[1], 0), count - 1)
