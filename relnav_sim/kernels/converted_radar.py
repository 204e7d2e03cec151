"""Covariance of a radar measurement converted to a position, at many states.

See `measurements.converted_radar` and, of tangent angles, `measurements.converted_tangent_radar`.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel
from relnav_sim.kernels.lanes import LANES, load_vectors
from relnav_sim.kernels.sight import seen
from relnav_sim.kernels.tangent import across

W, U, V, D, E = 0, 4, 6, 8, 12
"""Where the coefficients of w, u, v, d and e begin in a row of `covariances`."""
ROWS, COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
"""A symmetric 3 x 3 matrix is carried as six entries in this order."""


@kernel(given(2), given(2), given(2), given(2))
def covariances(states: Array, M: Array, coefficients: Array, T: Array) -> Array:
    """Return w r r^T + f (r a^T + a r^T) + g a a^T + d I + [r x] P [r x]^T, (runs, k, 3, 3), symmetric to the bit.

    That is the second moment [[w x^2 + d, w x y, u x z], [., w y^2 + d, u y z], [., ., v z^2 + e]] of the radar's own
    axes, turned to RTN: r is the position there, (x, y, z) = M r, a the radar's z axis, f = z (u - w) and
    g = z^2 (w - 2 u + v) + e - d.

    Args:
        states: (runs, n), the position r first, m.
        M: Rotation (3, 3) from RTN to the radar's axes.
        coefficients: (k, 14), a row for each component of the noise, with q^2 = x^2 + y^2 + z^2, p^2 = x^2 + y^2: w of
            1, 1 / q^2, q^2 / p^2 and 1 / p^2; u and v of 1 and 1 / q^2; d of p^2, p^2 / q^2, q^2 and 1; e of q^2 and 1.
        T: (6, 6), takes the products of r's components to the entries of [r x] P [r x]^T.
    """
    (runs, n), k = states.shape, len(coefficients)
    R = np.empty((runs, k, 3, 3))
    r, s, products = np.empty((n, LANES)), np.empty((3, LANES)), np.empty((6, LANES))
    a, attitude, entries = M[2], np.empty((6, LANES)), np.empty((6, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(states, first, used, r)
        seen(states, first, used, M, s)
        _of_attitude(r, T, used, products, attitude)
        for component in range(k):
            _of_component(r, s, a, coefficients[component], used, entries)
            for b in range(used):
                _unfold(entries, attitude, b, R[first + b, component])
    return R


@kernel(given(2), given(2), given(2), given(2))
def tangent_covariances(states: Array, M: Array, coefficients: Array, T: Array) -> Array:
    """Return w r r^T + p e_a e_a^T + q e_b e_b^T + [r x] P [r x]^T, (runs, k, 3, 3), symmetric to the bit.

    e_a and e_b are the axes across the line of sight (`kernels.tangent.across`). Arguments as above, but for the
    coefficients (k, 6): w of 1 and 1 / r^2, p and q of r^2 and 1 each.
    """
    (runs, n), k = states.shape, len(coefficients)
    R = np.empty((runs, k, 3, 3))
    r, u, axes = np.empty((n, LANES)), np.empty((3, LANES)), np.empty((2, 3, LANES))
    squared, products, attitude = np.empty(LANES), np.empty((6, LANES)), np.empty((6, LANES))
    entries, e = np.empty((6, LANES)), np.empty((2, 3))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(states, first, used, r)
        seen(states, first, used, M, u)
        for b in range(used):
            squared[b] = r[0, b] * r[0, b] + r[1, b] * r[1, b] + r[2, b] * r[2, b]
            length = math.sqrt(u[0, b] * u[0, b] + u[1, b] * u[1, b] + u[2, b] * u[2, b])
            u[0, b], u[1, b], u[2, b] = u[0, b] / length, u[1, b] / length, u[2, b] / length
        across(u, used, axes)
        _of_attitude(r, T, used, products, attitude)
        for b in range(used):
            for i in range(2):
                for j in range(3):
                    e[i, j] = M[0, j] * axes[i, 0, b] + M[1, j] * axes[i, 1, b] + M[2, j] * axes[i, 2, b]
            for component in range(k):
                c = coefficients[component]
                w = c[0] + c[1] / squared[b]
                p, q = c[2] * squared[b] + c[3], c[4] * squared[b] + c[5]
                for entry in range(6):
                    i, j = ROWS[entry], COLUMNS[entry]
                    entries[entry, b] = w * r[i, b] * r[j, b] + p * e[0, i] * e[0, j] + q * e[1, i] * e[1, j]
                _unfold(entries, attitude, b, R[first + b, component])
    return R


@inner
def linearise(x: Array, used: int, M: Array, T: Array, coefficients: Array, w: Array, h: Array, r: Array) -> None:
    """Set residual, Jacobian and noise of one component at the means x, in lanes; as `sight.linearise`."""
    s = np.empty((3, LANES))
    seen(x.T, 0, used, M, s)
    noise_at(x, s, used, M, T, coefficients, r)
    for i in range(3):
        for b in range(used):
            w[i, b] -= x[i, b]
            h[i, i, b] = 1.0


@inner
def noise_at(x: Array, s: Array, used: int, M: Array, T: Array, coefficients: Array, r: Array) -> None:
    """Set r (3, 3, LANES) to the noise of one component at the means x (n, LANES), seen along s = M x."""
    products, attitude, entries = np.empty((6, LANES)), np.empty((6, LANES)), np.empty((6, LANES))
    _of_attitude(x, T, used, products, attitude)
    _of_component(x, s, M[2], coefficients, used, entries)
    for n in range(6):
        for b in range(used):
            r[ROWS[n], COLUMNS[n], b] = r[COLUMNS[n], ROWS[n], b] = entries[n, b] + attitude[n, b]


@inner
def _of_component(r: Array, s: Array, a: Array, c: Array, used: int, entries: Array) -> None:
    """Set the six entries of the covariance without the attitude's share."""
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        in_plane = x * x + y * y
        squared = in_plane + z * z
        inverse = 1 / squared
        w = c[W] + c[W + 1] * inverse + (c[W + 2] * squared + c[W + 3]) / in_plane
        u = c[U] + c[U + 1] * inverse
        v = c[V] + c[V + 1] * inverse
        d = (c[D] + c[D + 1] * inverse) * in_plane + (c[D + 2] * squared + c[D + 3])
        e = c[E] * squared + c[E + 1]
        f = z * (u - w)
        g = (z * z) * (w - 2 * u + v) + (e - d)
        r0, r1, r2 = r[0, b], r[1, b], r[2, b]
        # w r + f a and f r + g a, so that an entry is r_i (w r + f a)_j + a_i (f r + g a)_j.
        p0, p1, p2 = w * r0 + f * a[0], w * r1 + f * a[1], w * r2 + f * a[2]
        q0, q1, q2 = f * r0 + g * a[0], f * r1 + g * a[1], f * r2 + g * a[2]
        entries[0, b] = r0 * p0 + a[0] * q0 + d
        entries[1, b] = r1 * p1 + a[1] * q1 + d
        entries[2, b] = r2 * p2 + a[2] * q2 + d
        entries[3, b] = r0 * p1 + a[0] * q1
        entries[4, b] = r0 * p2 + a[0] * q2
        entries[5, b] = r1 * p2 + a[1] * q2


@inner
def _of_attitude(r: Array, T: Array, used: int, products: Array, entries: Array) -> None:
    """Set the six entries of [r x] P [r x]^T, T times those of r r^T."""
    for n in range(6):
        for b in range(used):
            products[n, b] = r[ROWS[n], b] * r[COLUMNS[n], b]
            entries[n, b] = 0.0
    for n in range(6):
        for o in range(6):
            if T[n, o] != 0:
                for b in range(used):
                    entries[n, b] += T[n, o] * products[o, b]


@inner
def _unfold(entries: Array, added: Array, b: int, R: Array) -> None:
    """Set R (3, 3) to the symmetric matrix of these entries of lane b."""
    for n in range(6):
        R[ROWS[n], COLUMNS[n]] = R[COLUMNS[n], ROWS[n]] = entries[n, b] + added[n, b]
