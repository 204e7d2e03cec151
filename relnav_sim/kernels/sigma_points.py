"""The unscented transform: sigma points, and the moments of their images (Julier and Uhlmann, Proc. IEEE 92(3), 2004).

Points are pairs m + x_i and m - x_i about a centre m. All sums go over deviations d_i from the image of the centre:
with weights that sum to one the mean is the centre's image plus s = w sum(d_i), and covariances are
w sum(d_i d_i^T) + c s s^T, with c = beta - alpha^2. The centre's own weight, large and negative at small alpha, never
enters. Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, number, single
from relnav_sim.kernels.lanes import LANES, factor, load, load_vectors, store, store_symmetric, store_vectors


@kernel(given(2), given(3), number)
def points(m: Array, P: Array, spread: float) -> tuple[Array, Array, int]:
    """Return the points (runs, 2 n + 1, n), centre first, and their offsets (runs, 2 n, n) from it.

    The offsets are the columns of the Cholesky factor of P times the spread, then the opposite ones. They are not all
    finite in runs without such a factor, of which the last number is the count.

    Args:
        m: Means (runs, n).
        P: Covariances (runs, n, n), symmetric.
        spread: Distance of the points in standard deviations.
    """
    runs, n = m.shape
    about, offsets = np.empty((runs, 2 * n + 1, n), m.dtype), np.zeros((runs, 2 * n, n), m.dtype)
    without_factor = 0
    p, L = np.empty((n, n, LANES), m.dtype), np.zeros((n, n, LANES), m.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        factor(p, used, L)
        for b in range(used):
            run, total = first + b, 0.0
            for i in range(n):
                for j in range(i, n):
                    total += L[j, i, b]
                    offset = spread * L[j, i, b]
                    offsets[run, i, j], offsets[run, n + i, j] = offset, -offset
            without_factor += not math.isfinite(total)
            _place(m, offsets, run, about)
    return about, offsets, without_factor


@kernel(given(2), given(3), number)
def points_of_root(m: Array, L: Array, spread: float) -> tuple[Array, Array]:
    """Return the same points and offsets from a root of the covariance, L (runs, n, n) with L L^T = P."""
    runs, n = m.shape
    about, offsets = np.empty((runs, 2 * n + 1, n), m.dtype), np.empty((runs, 2 * n, n), m.dtype)
    for run in range(runs):
        for i in range(n):
            for j in range(n):
                offset = spread * L[run, j, i]
                offsets[run, i, j], offsets[run, n + i, j] = offset, -offset
        _place(m, offsets, run, about)
    return about, offsets


@inner
def _place(m: Array, offsets: Array, run: int, about: Array) -> None:
    """Set the points of a run, the centre first."""
    for j in range(m.shape[1]):
        about[run, 0, j] = m[run, j]
        for i in range(offsets.shape[1]):
            about[run, i + 1, j] = m[run, j] + offsets[run, i, j]


@kernel(given(2), given(3), given(3), number, number)
def predict(centre: Array, d: Array, Q: Array, weight: float, curvature: float) -> tuple[Array, Array]:
    """Return mean (runs, n) and covariance (runs, n, n) of the propagated points, Q included.

    Args:
        centre: Image of the centre (runs, n).
        d: Deviations of the others from it (runs, 2 n, n).
        Q: Covariance of the process noise, (runs, n, n) or (1, n, n).
        weight: w.
        curvature: c.
    """
    runs, points, n = d.shape
    mean, covariance = np.empty((runs, n), d.dtype), np.empty((runs, n, n), d.dtype)
    x, deviations, P, s = (
        np.empty((n, LANES), d.dtype),
        np.empty((points, n, LANES), d.dtype),
        np.empty((n, n, LANES), d.dtype),
        np.empty((n, LANES), d.dtype),
    )
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(centre, first, used, x)
        load(d, first, used, deviations)
        load(Q, first, used, P)
        _shift(deviations, weight, used, s)
        _add_covariance(deviations, s, weight, curvature, used, P)
        _add(s, used, x)
        store_vectors(x, first, used, mean)
        store_symmetric(P, first, used, covariance)
    return mean, covariance


@kernel(given(3), given(3), given(3), given(3), number, number)
def moments(
    readings: Array, d: Array, offsets: Array, R: Array, weight: float, curvature: float
) -> tuple[Array, Array, Array]:
    """Return the measurement's mean (runs, k), covariance S (runs, k, k) and covariance C (runs, k, n) with the state.

    Args:
        readings: Expected at the points, (runs, 2 n + 1, k), first at the centre.
        d: Their deviations from the first, (runs, 2 n + 1, k).
        offsets: Of the points from the centre (runs, 2 n, n).
        R: Measurement noise (runs, k, k) or (1, k, k), part of S.
        weight: w.
        curvature: c.
    """
    runs, _, k = d.shape
    _, points, n = offsets.shape
    mean, covariance = np.empty((runs, k), d.dtype), np.empty((runs, k, k), d.dtype)
    cross, C = np.empty((runs, k, n), d.dtype), np.empty((k, n, LANES), d.dtype)
    z, both = np.empty((k, LANES), d.dtype), np.empty((points + 1, k, LANES), d.dtype)
    x, S = np.empty((points, n, LANES), d.dtype), np.empty((k, k, LANES), d.dtype)
    deviations = both[1:]
    s, t = np.empty((k, LANES), d.dtype), np.empty((n, LANES), d.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        for i in range(k):
            for b in range(used):
                z[i, b] = readings[first + b, 0, i]
        load(d, first, used, both)
        load(offsets, first, used, x)
        load(R, first, used, S)
        take_moments(deviations, x, weight, curvature, used, s, t, z, S, C)
        store_vectors(z, first, used, mean)
        store_symmetric(S, first, used, covariance)
        store(C, first, used, cross)
    return mean, covariance, cross


@inner
def take_moments(
    d: Array, x: Array, weight: float, curvature: float, used: int, s: Array, t: Array, z: Array, S: Array, C: Array
) -> None:
    """Do as `moments` in lanes.

    Args:
        d: Deviations of the readings from the centre's, (2 n, k, LANES).
        x: Offsets of the points (2 n, n, LANES).
        weight: w.
        curvature: c.
        used: How many lanes there are.
        s: Room (k, LANES).
        t: Room (n, LANES).
        z: Reading expected at the centre, (k, LANES), which the mean takes the place of.
        S: Measurement noise (k, k, LANES), to whose lower triangle the covariance is added.
        C: Gets the covariance with the state (k, n, LANES).
    """
    _shift(d, weight, used, s)
    _shift(x, weight, used, t)
    _add_covariance(d, s, weight, curvature, used, S)
    for i in range(len(s)):
        for j in range(len(t)):
            for b in range(used):
                C[i, j, b] = 0.0
            for point in range(len(d)):
                for b in range(used):
                    C[i, j, b] += d[point, i, b] * x[point, j, b]
            for b in range(used):
                C[i, j, b] = weight * C[i, j, b] + curvature * (s[i, b] * t[j, b])
    _add(s, used, z)


@kernel(given(3), number, number)
def weighted_deviations(d: Array, weight: float, centre_weight: float) -> tuple[Array, Array]:
    """Return the mean less the centre, s (runs, p), and a root D (runs, p, 2 n + 1) of the covariance, D D^T.

    The columns are sqrt(w) (d_i - s), and -sqrt(w_0) s for the centre (van der Merwe and Wan, ICASSP 2001).

    Args:
        d: Deviations from the centre (runs, 2 n, p).
        weight: w.
        centre_weight: w_0, not negative.
    """
    runs, points, p = d.shape
    shift, D = np.empty((runs, p), d.dtype), np.empty((runs, p, points + 1), d.dtype)
    root, centre_root = math.sqrt(weight), math.sqrt(centre_weight)
    for run in range(runs):
        for j in range(p):
            total = d[run, 0, j]
            for point in range(1, points):
                total += d[run, point, j]
            s = weight * total
            shift[run, j], D[run, j, points] = s, -centre_root * s
            for point in range(points):
                D[run, j, point] = root * (d[run, point, j] - s)
    return shift, D


@inner
def _shift(d: Array, weight: float, used: int, s: Array) -> None:
    """Set s (p,) to w times the sum of the deviations (2 n, p)."""
    for j in range(len(s)):
        for b in range(used):
            s[j, b] = 0.0
        for point in range(len(d)):
            for b in range(used):
                s[j, b] += d[point, j, b]
        for b in range(used):
            s[j, b] *= weight


@inner
def _add_covariance(d: Array, s: Array, weight: float, curvature: float, used: int, S: Array) -> None:
    """Add w sum(d_i d_i^T) + c s s^T to the lower triangle of S (p, p)."""
    total = np.empty(LANES, d.dtype)
    for i in range(len(s)):
        for j in range(i + 1):
            for b in range(used):
                total[b] = 0.0
            for point in range(len(d)):
                for b in range(used):
                    total[b] += d[point, i, b] * d[point, j, b]
            for b in range(used):
                S[i, j, b] += weight * total[b] + curvature * (s[i, b] * s[j, b])


@inner
def _add(s: Array, used: int, x: Array) -> None:
    """Add s to x (p,)."""
    for i in range(len(s)):
        for b in range(used):
            x[i, b] += s[i, b]


@kernel_like(points, given(2, single), given(3, single), single)
def points_single(m: Array, P: Array, spread: float) -> tuple[Array, Array, int]:
    """Return the same as `points`."""
    return m, P, 0


@kernel_like(points_of_root, given(2, single), given(3, single), single)
def points_of_root_single(m: Array, L: Array, spread: float) -> tuple[Array, Array]:
    """Return the same as `points_of_root`."""
    return m, L


@kernel_like(predict, given(2, single), given(3, single), given(3, single), single, single)
def predict_single(centre: Array, d: Array, Q: Array, weight: float, curvature: float) -> tuple[Array, Array]:
    """Return the same as `predict`."""
    return centre, d


@kernel_like(moments, given(3, single), given(3, single), given(3, single), given(3, single), single, single)
def moments_single(
    readings: Array, d: Array, offsets: Array, R: Array, weight: float, curvature: float
) -> tuple[Array, Array, Array]:
    """Return the same as `moments`."""
    return readings, d, offsets


@kernel_like(weighted_deviations, given(3, single), single, single)
def weighted_deviations_single(d: Array, weight: float, centre_weight: float) -> tuple[Array, Array]:
    """Return the same as `weighted_deviations`."""
    return d, d
