"""What every estimate is worth while a block runs: its normalised errors, and whether it is a number at all."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import given, inner, kernel
from relnav_sim.kernels.elementary import bits
from relnav_sim.kernels.lanes import LANES

_WITHOUT_SIGN, _INFINITY_BITS = 0x7FFFFFFFFFFFFFFF, 0x7FF0000000000000


@kernel(given(3), given(4))
def normalised_errors(error: Array, covariance: Array) -> tuple[Array, Mask, Mask]:
    """Return e^T P^-1 e of the whole state, its position and its velocity, (3, runs, K).

    The error is one more row of the Cholesky recursion: that row becomes L^-1 e. Position comes first in the state, so
    its part of the row belongs to its marginal covariance; that of the velocity is factored by itself.

    Args:
        error: (runs, K, 6).
        covariance: (K, runs, 6, 6), an epoch after the other.

    Returns:
        The NEES; whether P > 0, and whether P is finite, (runs, K).
    """
    K, runs = covariance.shape[:2]
    nees = np.empty((3, runs, K))
    definite, finite = np.empty((runs, K), dtype=np.bool_), np.empty((runs, K), dtype=np.bool_)
    whole, velocity, positive = np.empty((7, 6, LANES)), np.empty((4, 3, LANES)), np.empty(LANES, dtype=np.bool_)
    epochs, places = np.empty(LANES, dtype=np.int64), np.empty(LANES, dtype=np.int64)
    k, run = 0, -1
    for first in range(0, K * runs, LANES):
        used = min(LANES, K * runs - first)
        for b in range(used):
            run += 1
            if run == runs:
                k, run = k + 1, 0
            epochs[b], places[b], positive[b] = k, run, True
            finite[run, k] = _all_finite(covariance[k, run].reshape(-1))
            for j in range(6):
                for i in range(j, 6):
                    whole[i, j, b] = covariance[k, run, i, j]
                whole[6, j, b] = error[run, k, j]
            for j in range(3):
                for i in range(j, 4):
                    velocity[i, j, b] = whole[3 + i, 3 + j, b]
        _eliminate(whole, used, positive)
        for b in range(used):
            definite[places[b], epochs[b]] = positive[b]
        _eliminate(velocity, used, positive)
        for b in range(used):
            position = _sum_of_squares(whole, 6, 0, b)
            nees[0, places[b], epochs[b]] = position + _sum_of_squares(whole, 6, 3, b)
            nees[1, places[b], epochs[b]] = position
            nees[2, places[b], epochs[b]] = _sum_of_squares(velocity, 3, 0, b)
    return nees, definite, finite


@kernel(given(3))
def covariance_roots(covariance: Array) -> Array:
    """Return the lower-triangular Cholesky factors of covariances (N, n, n), row by row, (N, n (n + 1) / 2).

    Row by row (Golub and Van Loan, Matrix Computations, 2013, section 4.2). The factor of a matrix that is not positive
    definite has NaN from the pivot on that is not positive. Only lower triangles are read.
    """
    N, n = covariance.shape[:2]
    roots, inverse_pivots = np.empty((N, n * (n + 1) // 2)), np.empty(n)
    for p in range(N):
        row = 0
        for i in range(n):
            column = 0
            for j in range(i):
                left = covariance[p, i, j]
                for k in range(j):
                    left -= roots[p, row + k] * roots[p, column + k]
                roots[p, row + j] = left * inverse_pivots[j]
                column += j + 1
            left = covariance[p, i, i]
            for k in range(i):
                left -= roots[p, row + k] * roots[p, row + k]
            pivot = math.sqrt(left) if left > 0 else math.nan
            roots[p, row + i], inverse_pivots[i] = pivot, 1 / pivot
            row += i + 1
    return roots


@kernel(given(3), given(4))
def doubtful(mean: Array, covariance: Array) -> Mask:
    """Return in which runs a mean or covariance is not finite, or a variance negative, at any epoch.

    Args:
        mean: (K, runs, n).
        covariance: (K, runs, n, n).
    """
    K, runs, n = mean.shape
    doubt = np.zeros(runs, dtype=np.bool_)
    means, entries = mean.reshape(K * runs, n), covariance.reshape(K * runs, n * n)
    for k in range(K):
        for run in range(runs):
            place = k * runs + run
            negative = False
            for i in range(n):
                negative |= entries[place, i * (n + 1)] < 0
            doubt[run] |= negative or not (_all_finite(means[place]) and _all_finite(entries[place]))
    return doubt


@inner
def _all_finite(x: Array) -> bool:
    """Return whether all entries of x (n,) are finite; integers are compared, because that vectorises."""
    largest = 0
    for i in range(len(x)):
        largest = max(largest, bits(x[i]) & _WITHOUT_SIGN)
    return largest < _INFINITY_BITS


@inner
def _eliminate(A: Array, used: int, positive: Mask) -> None:
    """Turn the lower triangle of [A; e^T] (n + 1, n) into that of [L; (L^-1 e)^T]."""
    n = A.shape[1]
    for j in range(n):
        for b in range(used):
            positive[b] &= A[j, j, b] > 0
            A[j, j, b] = 1 / math.sqrt(A[j, j, b])
        for i in range(j + 1, n + 1):
            for b in range(used):
                A[i, j, b] *= A[j, j, b]
        for k in range(j + 1, n):
            for i in range(k, n + 1):
                for b in range(used):
                    A[i, k, b] -= A[i, j, b] * A[k, j, b]


@inner
def _sum_of_squares(A: Array, row: int, first: int, b: int) -> float:
    x, y, z = A[row, first, b], A[row, first + 1, b], A[row, first + 2, b]
    return (x * x + y * y) + z * z
