"""Covariance of a radar reading converted to a position, at many states (see `measurements.converted_radar`)."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel
from relnav_sim.kernels.lanes import LANES

W, U, V, D, E = 0, 4, 6, 8, 12
"""Where the coefficients of w, u, v, d and e begin in a row of `covariances`."""
COEFFICIENTS = 14


@kernel(given(2), given(2), given(2), given(2))
def covariances(states: Array, M: Array, coefficients: Array, T: Array) -> Array:
    """Return w r r^T + f (r a^T + a r^T) + g a a^T + d I + [r x] P [r x]^T, (runs, k, 3, 3), symmetric to the bit.

    That is the second moment [[w x^2 + d, w x y, u x z], [., w y^2 + d, u y z], [., ., v z^2 + e]] of the radar's own
    axes, turned to RTN: r is the position there, (x, y, z) = M r, a the radar's z axis, f = z (u - w) and
    g = z^2 (w - 2 u + v) + e - d.

    Args:
        states: (runs, n), the position r first, m.
        M: Rotation (3, 3) from RTN to the radar's axes.
        coefficients: (k, 14), a row for each component of the noise: w and d of 1, 1 / q^2, q^2 / p^2 and 1 / p^2 (d of
            p^2, p^2 / q^2, q^2 and 1), u and v of 1 and 1 / q^2, e of q^2 and 1; q^2 = x^2 + y^2 + z^2, p^2 = x^2 + y^2.
        T: (6, 6), takes the products of r's components to the entries of [r x] P [r x]^T.
    """
    runs, k = len(states), len(coefficients)
    R = np.empty((runs, k, 3, 3))
    turned = T.any()
    r, s, products = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((6, LANES))
    a, attitude, entries = M[2], np.zeros((6, LANES)), np.empty((6, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        for b in range(used):
            for i in range(3):
                r[i, b] = states[first + b, i]
        for i in range(3):
            for b in range(used):
                s[i, b] = M[i, 0] * r[0, b] + M[i, 1] * r[1, b] + M[i, 2] * r[2, b]
        if turned:
            _entries_of_square(r, used, products)
            for n in range(6):
                for b in range(used):
                    attitude[n, b] = 0.0
                for o in range(6):
                    for b in range(used):
                        attitude[n, b] += T[n, o] * products[o, b]
        for component in range(k):
            _of_component(r, s, a, coefficients[component], used, entries)
            for b in range(used):
                _unfold(entries, attitude, b, R[first + b, component])
    return R


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
def _entries_of_square(r: Array, used: int, products: Array) -> None:
    """Set the six entries of r r^T: (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)."""
    for b in range(used):
        products[0, b], products[1, b], products[2, b] = r[0, b] * r[0, b], r[1, b] * r[1, b], r[2, b] * r[2, b]
        products[3, b], products[4, b], products[5, b] = r[0, b] * r[1, b], r[0, b] * r[2, b], r[1, b] * r[2, b]


@inner
def _unfold(entries: Array, added: Array, b: int, R: Array) -> None:
    """Set R (3, 3) to the symmetric matrix of these entries of lane b."""
    for i in range(3):
        R[i, i] = entries[i, b] + added[i, b]
    R[0, 1] = R[1, 0] = entries[3, b] + added[3, b]
    R[0, 2] = R[2, 0] = entries[4, b] + added[4, b]
    R[1, 2] = R[2, 1] = entries[5, b] + added[5, b]
