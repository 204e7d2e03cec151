"""A radar's measurement taken by sigma points, in lanes: how `epochs.filtered_by_points` updates.

Each step is what `sigma_points.points`, the sensor, `sigma_points.moments` and `kalman.update_by_moments` do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import inner, number, record
from relnav_sim.kernels.converted_radar import noise_at
from relnav_sim.kernels.elementary import wrapped
from relnav_sim.kernels.kalman import correct_by_moments
from relnav_sim.kernels.lanes import LANES, copy, factor, mirror
from relnav_sim.kernels.scores import loses
from relnav_sim.kernels.sight import noise_along, seen, spherical_of
from relnav_sim.kernels.sigma_points import take_moments


class Transform(NamedTuple):
    """An unscented transform, see `sigma_points`.

    Args:
        spread: Distance of the points in standard deviations.
        weight: w.
        curvature: c.
    """

    spread: float
    weight: float
    curvature: float


TRANSFORM = record(Transform, number, number, number)


@inner
def room(n: int, settings: Transform) -> tuple[Array, ...]:
    """Return room for `update` of n states."""
    L_P, offsets = np.zeros((n, n, LANES)), np.zeros((2 * n, n, LANES))
    point, s, d, z = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((2 * n, 3, LANES)), np.empty((3, LANES))
    r, S, L = np.empty((3, 3, LANES)), np.empty((3, 3, LANES)), np.zeros((3, 3, LANES))
    return L_P, offsets, point, s, d, z, r, S, L, np.empty((3, n, LANES)), np.empty((n, LANES))


@inner
def update(
    x: Array,
    p: Array,
    w: Array,
    converted: bool,
    M: Array,
    A: Array,
    c: Array,
    transform: Transform,
    room: tuple[Array, ...],
    read: Mask,
    before: Array,
    first: int,
    used: int,
    short: Array,
    nis: Array,
    log_likelihood: Array,
    extras: Array,
) -> bool:
    """Update as `linearised_step.update` does; the same is returned, and where a covariance has no Cholesky factor."""
    L_P, offsets, point, s, d, z, r, S, L, W, t = room
    n = len(x)
    factor(p, used, L_P)
    for b in range(used):
        if read[first + b] and _without_factor(p, L_P, b):
            return True
    for i in range(n):
        for j in range(i, n):
            for b in range(used):
                offsets[i, j, b] = transform.spread * L_P[j, i, b]
                offsets[n + i, j, b] = -offsets[i, j, b]
    seen(x.T, 0, used, M, s)
    if converted:
        noise_at(x, s, used, M, A, c[0], r)
    else:
        noise_along(s, used, A, c[0], r)
    _reading(x, s, converted, used, z)
    for i in range(2 * n):
        for j in range(3):
            for b in range(used):
                point[j, b] = x[j, b] + offsets[i, j, b]
        if not converted:
            seen(point.T, 0, used, M, s)
        _reading(point, s, converted, used, d[i])
        _subtract(z, converted, used, d[i])
    copy(r, used, S)
    take_moments(d, offsets, transform.weight, transform.curvature, used, s, t, z, S, W)
    mirror(S, used, S)
    _subtract(z, converted, used, w)
    correct_by_moments(x, p, w, S, used, L, W, short, first, nis, log_likelihood)
    return loses(S, r, L, read, first, used)


@inner
def _without_factor(P: Array, L: Array, b: int) -> bool:
    """Return whether P of lane b, where it has no NaN, has no Cholesky factor L; with NaN a run is lost anyway."""
    total, of_factor = 0.0, 0.0
    for i in range(len(P)):
        for j in range(i + 1):
            total += P[i, j, b]
            of_factor += L[i, j, b]
    return not math.isfinite(of_factor) and not math.isnan(total)


@inner
def _reading(x: Array, s: Array, converted: bool, used: int, z: Array) -> None:
    """Set z (3, LANES) to the reading expected at states x, seen along s."""
    if converted:
        for i in range(3):
            for b in range(used):
                z[i, b] = x[i, b]
    else:
        spherical_of(s, used, z)


@inner
def _subtract(z: Array, converted: bool, used: int, d: Array) -> None:
    """Subtract readings z from others d, (3, LANES) both."""
    for i in range(3):
        for b in range(used):
            d[i, b] -= z[i, b]
    if not converted:
        for i in range(1, 3):
            for b in range(used):
                d[i, b] = wrapped(d[i, b])
