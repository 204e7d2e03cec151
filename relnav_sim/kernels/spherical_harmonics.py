"""The pull of a body of any shape: series of normalised spherical harmonics, lanes last.

With the radius R, the harmonics V_nm + i W_nm = (R/r)^(n+1) P_nm(sin phi) exp(i m lambda), fully normalised, are
products of two factors (Cunningham 1970; Montenbruck and Gill 2000, eq. 3.29 to 3.31, there without norms):

    V_nm + i W_nm = p_nm e_m,    e_m = k_m (u + i v) e_(m-1),    e_0 = k_0 R / r,
    p_nm = alpha_nm w p_(n-1)m - beta_nm q p_(n-2)m,    p_mm = 1,

where (u, v, w) = R (x, y, z) / r^2 and q = (R / r)^2. Nothing here is singular at a pole. The derivative of a harmonic
by a coordinate is a sum of harmonics of the next degree, so that each component of the acceleration is a series itself:
three series are summed up at once. Their coefficients come from `relnav_sim.astro.harmonic_series`.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number, record, short_for, written
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


class Series(NamedTuple):
    """Three series of harmonics of degrees up to the same n and orders up to the same m.

    Attributes:
        radius: R, m.
        sectoral: The factors k_0 to k_m; the first has the unit of the sums.
        rows: For order 0, then 1, up to m: a row of alpha, beta, and real and imaginary parts of the coefficients of
            the first, second and third series, for every degree from the order to n, and a row of zeros where it takes
            one to have an even number. A series is the real part of the sum of its coefficients times V + i W.
        degree: n, at least m.
    """

    radius: float
    sectoral: Array
    rows: Array
    degree: float


SERIES = record(Series, number, written(1), written(2), number)
ROOM = 14
"""Rows of lanes that the sums need to work in."""


@inner
def sums(series: Series, r: Array, used: int, room: Array, out: Array) -> None:
    """Set out (3,) to the three series at positions r (3,).

    Two degrees are taken at once, as sums that are kept in memory cost more than the products.

    Args:
        series: What is summed up.
        r: Positions in the body's axes, m; rows after the third are not looked at.
        used: How many lanes count.
        room: (ROOM LANES,) to work in.
        out: Where the sums go; may be r.
    """
    # Rows of one flat array, so that the compiler knows that they don't overlap.
    u, v, w, q, real, imaginary, before, last = (
        0, LANES, 2 * LANES, 3 * LANES, 4 * LANES, 5 * LANES, 6 * LANES, 7 * LANES,
    )  # fmt: skip
    x_real, x_imaginary, y_real, y_imaginary, z_real, z_imaginary = (
        8 * LANES, 9 * LANES, 10 * LANES, 11 * LANES, 12 * LANES, 13 * LANES,
    )  # fmt: skip
    R, rows = series.radius, series.rows
    for b in range(used):
        x, y, z = r[0, b], r[1, b], r[2, b]
        inverse = 1 / (x * x + y * y + z * z)
        room[u + b], room[v + b], room[w + b] = R * x * inverse, R * y * inverse, R * z * inverse
        room[q + b] = R * R * inverse
        room[real + b], room[imaginary + b] = series.sectoral[0] * (R * math.sqrt(inverse)), 0.0
        out[0, b], out[1, b], out[2, b] = 0.0, 0.0, 0.0
    row = 0
    for m in range(len(series.sectoral)):
        if m > 0:
            k = series.sectoral[m]
            for b in range(used):
                e, f = room[real + b], room[imaginary + b]
                room[real + b] = k * (e * room[u + b] - f * room[v + b])
                room[imaginary + b] = k * (e * room[v + b] + f * room[u + b])
        alpha = rows[row + 1, 0]
        c0, c1, c2, c3, c4, c5 = (
            rows[row, 2], rows[row, 3], rows[row, 4], rows[row, 5], rows[row, 6], rows[row, 7],
        )  # fmt: skip
        d0, d1, d2, d3, d4, d5 = (
            rows[row + 1, 2], rows[row + 1, 3], rows[row + 1, 4], rows[row + 1, 5], rows[row + 1, 6], rows[row + 1, 7],
        )  # fmt: skip
        row += 2
        for b in range(used):
            p = alpha * room[w + b]
            room[before + b], room[last + b] = 1.0, p
            room[x_real + b], room[x_imaginary + b] = c0 + d0 * p, c1 + d1 * p
            room[y_real + b], room[y_imaginary + b] = c2 + d2 * p, c3 + d3 * p
            room[z_real + b], room[z_imaginary + b] = c4 + d4 * p, c5 + d5 * p
        for _ in range((int(series.degree) - m) // 2):
            alpha, beta, alpha_next, beta_next = rows[row, 0], rows[row, 1], rows[row + 1, 0], rows[row + 1, 1]
            c0, c1, c2, c3, c4, c5 = (
                rows[row, 2], rows[row, 3], rows[row, 4], rows[row, 5], rows[row, 6], rows[row, 7],
            )  # fmt: skip
            d0, d1, d2, d3, d4, d5 = (
                rows[row + 1, 2], rows[row + 1, 3], rows[row + 1, 4], rows[row + 1, 5], rows[row + 1, 6],
                rows[row + 1, 7],
            )  # fmt: skip
            row += 2
            for b in range(used):
                p = alpha * room[w + b] * room[last + b] - beta * room[q + b] * room[before + b]
                s = alpha_next * room[w + b] * p - beta_next * room[q + b] * room[last + b]
                room[before + b], room[last + b] = p, s
                room[x_real + b] += c0 * p + d0 * s
                room[x_imaginary + b] += c1 * p + d1 * s
                room[y_real + b] += c2 * p + d2 * s
                room[y_imaginary + b] += c3 * p + d3 * s
                room[z_real + b] += c4 * p + d4 * s
                room[z_imaginary + b] += c5 * p + d5 * s
        for b in range(used):
            e, f = room[real + b], room[imaginary + b]
            out[0, b] += e * room[x_real + b] - f * room[x_imaginary + b]
            out[1, b] += e * room[y_real + b] - f * room[y_imaginary + b]
            out[2, b] += e * room[z_real + b] - f * room[z_imaginary + b]


@short_for(sums)
def _sums(series: Series, r: Array, used: int, room: Array, out: Array) -> None:
    orders, (x, y, z) = len(series.sectoral), r[:3, 0].tolist()
    r2 = x * x + y * y + z * z
    w, q = series.radius * z / r2, series.radius * series.radius / r2
    table = series.rows[_places(int(series.degree), orders)]
    P = np.zeros((len(table) + 2, orders))  # two rows of zeros before degree 0
    for n in range(len(table)):
        P[n + 2] = table[n, :, 0] * w * P[n + 1] - table[n, :, 1] * q * P[n]
        if n < orders:
            P[n + 2, n] = 1.0
    factors = series.sectoral * (series.radius / r2) * complex(x, y)
    factors[0] = series.sectoral[0] * series.radius / math.sqrt(r2)
    e, found = np.cumprod(factors), np.einsum("nm,nmk->mk", P[2:], table[..., 2:])
    out[:3, 0] = (e.real[:, None] * found[:, ::2] - e.imag[:, None] * found[:, 1::2]).sum(axis=0)


@cache
def _places(degree: int, orders: int) -> NDArray[np.int64]:
    """Return which row has each degree and order, (degree + 1, orders); the first where there is none."""
    places, first = np.empty((degree + 1, orders), dtype=np.int64), 0
    for m in range(orders):
        rows = degree + 1 - m
        places[m:, m] = first + np.arange(rows)
        first += rows + rows % 2
    return np.where(np.tri(degree + 1, orders, dtype=bool), places, 0)


@kernel(SERIES, given(2))
def at_points(series: Series, positions: Array) -> Array:
    """Return the three series (points, 3) at positions (points, 3), m, in the body's axes."""
    points = len(positions)
    found = np.empty((points, 3))
    r, out, room = np.empty((3, LANES)), np.empty((3, LANES)), np.empty(ROOM * LANES)
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        load_vectors(positions, first, used, r)
        sums(series, r, used, room, out)
        store_vectors(out, first, used, found)
    return found
