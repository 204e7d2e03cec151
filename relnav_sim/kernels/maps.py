"""Linear and quadratic maps of many vectors, and the chain rule of derivatives."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, kernel
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


@kernel(given(2), given(2))
def linear(H: Array, x: Array) -> Array:
    """Return H x, (points, m), of vectors x (points, n), H (m, n)."""
    points = len(x)
    m, n = H.shape
    y = np.empty((points, m))
    for point in range(points):
        for i in range(m):
            entry = 0.0
            for j in range(n):
                entry += H[i, j] * x[point, j]
            y[point, i] = entry
    return y


@kernel(given(2), given(3), given(2))
def quadratic(F: Array, D: Array, points: Array) -> Array:
    """Return F x + x^T D x, (points, n), of vectors x (points, n), F (n, n), D (n, n, n) symmetric in its last axes."""
    n = len(F)
    moved = np.empty(points.shape)
    x, y, slope = np.empty((n, LANES)), np.empty((n, LANES)), np.empty(LANES)
    for first in range(0, len(points), LANES):
        used = min(LANES, len(points) - first)
        load_vectors(points, first, used, x)
        for m in range(n):
            for b in range(used):
                y[m, b] = 0.0
            for i in range(n):  # F x + x^T D x = sum x_i (F_i + D_ii x_i + 2 sum_(j > i) D_ij x_j)
                for b in range(used):
                    slope[b] = F[m, i] + D[m, i, i] * x[i, b]
                for j in range(i + 1, n):
                    twice = 2 * D[m, i, j]
                    for b in range(used):
                        slope[b] += twice * x[j, b]
                for b in range(used):
                    y[m, b] += slope[b] * x[i, b]
        store_vectors(y, first, used, moved)
    return moved


@kernel(given(2), given(3), given(2))
def quadratic_jacobians(F: Array, D: Array, points: Array) -> Array:
    """Return F + 2 D x, (points, n, n), at vectors x (points, n)."""
    n = len(F)
    slopes = np.empty((len(points), n, n))
    for point in range(len(points)):
        for m in range(n):
            for i in range(n):
                bend = 0.0
                for j in range(n):
                    bend += D[m, i, j] * points[point, j]
                slopes[point, m, i] = F[m, i] + 2 * bend
    return slopes


@kernel(given(3), given(3), given(3))
def chained(A: Array, B: Array, C: Array) -> Array:
    """Return [A B, C], (points, m, n + e): derivatives by x of what depends on x through others, and by e more states.

    Args:
        A: Derivatives by the others (points, m, k).
        B: Derivatives of the others by x (points, k, n), or (1, k, n) for all points.
        C: Derivatives by the rest (points, m, e), or (1, m, e) for all points.
    """
    points, m, _ = A.shape
    n, e = B.shape[2], C.shape[2]
    whole = np.empty((points, m, n + e))
    for point in range(points):
        a, b = A[point], B[0 if len(B) == 1 else point]
        c = C[0 if len(C) == 1 else point]
        for i in range(m):
            for j in range(n):
                entry = 0.0
                for k in range(a.shape[1]):
                    entry += a[i, k] * b[k, j]
                whole[point, i, j] = entry
            for j in range(e):
                whole[point, i, n + j] = c[i, j]
    return whole
