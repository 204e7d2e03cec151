"""A quadratic map of many vectors, x -> F x + x^T D x, and its Jacobian."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, kernel
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


@kernel(given(2), given(3), given(2))
def images(F: Array, D: Array, points: Array) -> Array:
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
def jacobians(F: Array, D: Array, points: Array) -> Array:
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
