"""Where the chief stands in the deputy's own orbit frame, at many states (see `measurements.seen_from_deputy`).

With the chief at the radius R, its radial velocity R' (climb) and angular rate n, d = (R + x, y, z),
w = (R' + vx - n y, vy + n (R + x), vz) and h = d x w give the deputy's axes e_R = d / |d|, e_N = h / |h|,
e_T = e_N x e_R, and the sight c = -(e_R, e_T, e_N) . r.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number
from relnav_sim.kernels.lanes import LANES, load_vectors, store, store_vectors


@kernel(given(2), number, number, number)
def chief_seen(states: Array, R: float, climb: float, n: float) -> Array:
    """Return c (points, 3), m, of states (points, 6 or more)."""
    points = len(states)
    seen = np.empty((points, 3))
    x, c, sizes = np.empty((states.shape[1], LANES)), np.empty((3, LANES)), np.empty((3, LANES))
    axes = np.empty((3, 3, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        load_vectors(states, first, used, x)
        _see(x, R, climb, n, used, c, axes, sizes)
        store_vectors(c, first, used, seen)
    return seen


@kernel(given(2), number, number, number)
def chief_seen_with_jacobian(states: Array, R: float, climb: float, n: float) -> tuple[Array, Array]:
    """Return `chief_seen` and its derivatives by the first six states, (points, 3, 6).

    A change of d and w, in the deputy's axes, turns these by phi = ((|d| w_N - w_R d_N) / |h|, -d_N / |d|, d_T / |d|);
    c then changes by -d + c x phi. w changes with the position too: n times the chief's orbit normal x dr.
    """
    points = len(states)
    seen, by_state = np.empty((points, 3)), np.empty((points, 3, 6))
    x, c, sizes = np.empty((states.shape[1], LANES)), np.empty((3, LANES)), np.empty((3, LANES))
    axes, J = np.empty((3, 3, LANES)), np.zeros((3, 6, LANES))
    tilt = np.empty(LANES)  # of the axes by a velocity along e_N
    by_position = np.empty((3, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        load_vectors(states, first, used, x)
        _see(x, R, climb, n, used, c, axes, sizes)
        for b in range(used):
            tilt[b] = sizes[0, b] / sizes[1, b]
            for i in range(3):
                by_position[i, b] = -sizes[2, b] / sizes[1, b] * axes[2, i, b]
            by_position[0, b] += n * (tilt[b] * axes[2, 1, b])
            by_position[1, b] -= n * (tilt[b] * axes[2, 0, b])
        for i in range(3):
            for b in range(used):
                radius, by_velocity = sizes[0, b], tilt[b] * axes[2, i, b]
                shrink = 1 + c[0, b] / radius
                J[0, i, b] = (c[1, b] / radius) * axes[1, i, b] + (c[2, b] / radius) * axes[2, i, b] - axes[0, i, b]
                J[1, i, b] = c[2, b] * by_position[i, b] - shrink * axes[1, i, b]
                J[2, i, b] = -c[1, b] * by_position[i, b] - shrink * axes[2, i, b]
                J[1, 3 + i, b] = c[2, b] * by_velocity
                J[2, 3 + i, b] = -c[1, b] * by_velocity
        store_vectors(c, first, used, seen)
        store(J, first, used, by_state)
    return seen, by_state


@inner
def _see(x: Array, R: float, climb: float, n: float, used: int, c: Array, axes: Array, sizes: Array) -> None:
    """Set c (3, LANES), the deputy's axes e_R, e_T, e_N (3, 3, LANES), and |d|, |h| and w . e_R (3, LANES)."""
    for b in range(used):
        d0, d1, d2 = R + x[0, b], x[1, b], x[2, b]
        w0, w1, w2 = climb + x[3, b] - n * d1, x[4, b] + n * d0, x[5, b]
        h0, h1, h2 = d1 * w2 - d2 * w1, d2 * w0 - d0 * w2, d0 * w1 - d1 * w0
        radius, momentum = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2), math.sqrt(h0 * h0 + h1 * h1 + h2 * h2)
        r0, r1, r2 = d0 / radius, d1 / radius, d2 / radius
        n0, n1, n2 = h0 / momentum, h1 / momentum, h2 / momentum
        t0, t1, t2 = n1 * r2 - n2 * r1, n2 * r0 - n0 * r2, n0 * r1 - n1 * r0
        axes[0, 0, b], axes[0, 1, b], axes[0, 2, b] = r0, r1, r2
        axes[1, 0, b], axes[1, 1, b], axes[1, 2, b] = t0, t1, t2
        axes[2, 0, b], axes[2, 1, b], axes[2, 2, b] = n0, n1, n2
        sizes[0, b], sizes[1, b], sizes[2, b] = radius, momentum, w0 * r0 + w1 * r1 + w2 * r2
        c[0, b] = -(x[0, b] * r0 + x[1, b] * r1 + x[2, b] * r2)
        c[1, b] = -(x[0, b] * t0 + x[1, b] * t1 + x[2, b] * t2)
        c[2, b] = -(x[0, b] * n0 + x[1, b] * n1 + x[2, b] * n2)
