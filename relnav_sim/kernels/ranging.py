"""Range and range rate of many relative states, and their derivatives (Montenbruck and Gill 2000, section 6.1)."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, integer, kernel, number


@kernel(given(2), integer)
def readings(states: Array, m: int) -> Array:
    """Return rho = |r|, and with m = 2 rho' = r . v / rho, (points, m), of states (points, n): r, v, and others."""
    points = len(states)
    z = np.empty((points, m))
    for point in range(points):
        x = states[point]
        z[point, 0] = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        if m == 2:
            z[point, 1] = (x[0] * x[3] + x[1] * x[4] + x[2] * x[5]) / z[point, 0]
    return z


@kernel(given(2), integer)
def jacobian(states: Array, m: int) -> Array:
    """Return the derivatives (points, m, n): with u = r / rho, u by r; (v - rho' u) / rho by r and u by v."""
    points, n = states.shape
    H = np.zeros((points, m, n))
    for point in range(points):
        x, h = states[point], H[point]
        rho = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        for i in range(3):
            h[0, i] = x[i] / rho
        if m == 2:
            rate = h[0, 0] * x[3] + h[0, 1] * x[4] + h[0, 2] * x[5]
            for i in range(3):
                h[1, i] = (x[3 + i] - rate * h[0, i]) / rho
                h[1, 3 + i] = h[0, i]
    return H


@kernel(given(3), given(2), number)
def grown(covariances: Array, states: Array, growth: float) -> Array:
    """Return covariances with their first entry times (1 + growth rho)^2, (runs, q, q).

    Args:
        covariances: (runs, q, q), or (1, q, q) for all runs.
        states: (runs, n), the position first.
        growth: 1/m.
    """
    runs, q = len(states), covariances.shape[1]
    R = np.empty((runs, q, q))
    for run in range(runs):
        x = states[run]
        factor = 1 + growth * math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        given_one = covariances[0 if len(covariances) == 1 else run]
        for i in range(q):
            for j in range(q):
                R[run, i, j] = given_one[i, j]
        R[run, 0, 0] *= factor * factor
    return R
