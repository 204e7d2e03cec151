"""A constant matrix times many vectors."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, kernel


@kernel(given(2), given(2))
def images(H: Array, x: Array) -> Array:
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
