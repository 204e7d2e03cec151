"""What errors of a radar and of its host's attitude do to a measurement (see `measurements.radar_errors`).

The errors are E b of the augmented states b: of range, azimuth and elevation, which add to the measurement, and a turn
t of the host, which moves the line of sight s to s + s x t. A measurement that is a position p in RTN is taken to the
radar's axes, M p, and back.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import flag, given, inner, kernel
from relnav_sim.kernels.lanes import LANES, load_vectors, product, store, store_vectors
from relnav_sim.kernels.sight import derivatives, seen, spherical_of


@kernel(given(2), given(2), given(2), given(2), flag)
def readings(predicted: Array, extra: Array, E: Array, M: Array, cartesian: bool) -> Array:
    """Return the measurements (points, 3) that take the place of the error-free ones.

    Args:
        predicted: Error-free measurements (points, 3): range, azimuth and elevation, or positions, RTN.
        extra: Augmented states b (points, e).
        E: The radar's errors by them, (6, e).
        M: Rotation (3, 3) from RTN to the radar's axes; of range and angles without effect.
        cartesian: Whether they are positions.
    """
    points = len(predicted)
    distorted = np.empty((points, 3))
    free, x, s = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((3, LANES))
    errors, by_reading = np.empty((6, LANES)), np.empty((3, 3, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        _free(predicted, first, used, M, cartesian, s, free)
        _errors(extra, first, used, E, errors)
        _sight(free, errors, used, s, by_reading)
        _turn(s, errors, used)
        if cartesian:
            _back(M, s, used, x)
        else:
            spherical_of(s, used, x)
        store_vectors(x, first, used, distorted)
    return distorted


@kernel(given(2), given(2), given(2), given(2), flag)
def by_both(predicted: Array, extra: Array, E: Array, M: Array, cartesian: bool) -> tuple[Array, Array]:
    """Return the derivatives of `readings` by the error-free ones, (points, 3, 3), and by b, (points, 3, e)."""
    points, e = extra.shape
    by_predicted, by_extra = np.empty((points, 3, 3)), np.empty((points, 3, e))
    free, s, errors = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((6, LANES))
    by_free, by_reading, turned = np.empty((3, 3, LANES)), np.empty((3, 3, LANES)), np.empty((3, 6, LANES))
    last, D, left = np.empty((3, 3, LANES)), np.empty((3, 6, LANES)), np.empty((3, 3, LANES))
    by_b, axes = np.empty((3, e, LANES)), np.eye(3)
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        _free(predicted, first, used, M, cartesian, s, free)
        if cartesian:
            derivatives(s, used, M, by_free)
        _errors(extra, first, used, E, errors)
        _sight(free, errors, used, s, by_reading)
        _by_errors(s, errors, by_reading, used, turned)
        _turn(s, errors, used)
        if cartesian:
            for i in range(3):
                for j in range(3):
                    for b in range(used):
                        last[i, j, b] = M[j, i]
        else:
            derivatives(s, used, axes, last)
        product(last, turned, used, D)
        if cartesian:
            product(D[:, :3], by_free, used, left)
            store(left, first, used, by_predicted)
        else:
            store(D[:, :3], first, used, by_predicted)
        for i in range(3):
            for j in range(e):
                for b in range(used):
                    by_b[i, j, b] = 0.0
                for k in range(6):
                    if E[k, j] != 0:
                        for b in range(used):
                            by_b[i, j, b] += D[i, k, b] * E[k, j]
        store(by_b, first, used, by_extra)
    return by_predicted, by_extra


@inner
def _free(predicted: Array, first: int, used: int, M: Array, cartesian: bool, s: Array, free: Array) -> None:
    """Set free to the error-free range, azimuth and elevation, and s to that line of sight if cartesian."""
    if cartesian:
        seen(predicted, first, used, M, s)
        spherical_of(s, used, free)
    else:
        load_vectors(predicted, first, used, free)


@inner
def _errors(extra: Array, first: int, used: int, E: Array, errors: Array) -> None:
    """Set the errors (6, LANES) to E b."""
    for i in range(6):
        for b in range(used):
            errors[i, b] = 0.0
        for j in range(E.shape[1]):
            if E[i, j] != 0:
                for b in range(used):
                    errors[i, b] += E[i, j] * extra[first + b, j]


@inner
def _sight(free: Array, errors: Array, used: int, s: Array, by_reading: Array) -> None:
    """Set s to the biased line of sight (Shi et al. 2025, eq. 33) and (3, 3, LANES) its derivatives."""
    for b in range(used):
        q, azimuth, elevation = free[0, b] + errors[0, b], free[1, b] + errors[1, b], free[2, b] + errors[2, b]
        ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
        s[0, b], s[1, b], s[2, b] = q * ce * ca, q * ce * sa, -q * se
        by_reading[0, 0, b], by_reading[0, 1, b], by_reading[0, 2, b] = ce * ca, -q * ce * sa, -q * se * ca
        by_reading[1, 0, b], by_reading[1, 1, b], by_reading[1, 2, b] = ce * sa, q * ce * ca, -q * se * sa
        by_reading[2, 0, b], by_reading[2, 1, b], by_reading[2, 2, b] = -se, 0.0, -q * ce


@inner
def _turn(s: Array, errors: Array, used: int) -> None:
    """Add s x t to s."""
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        t0, t1, t2 = errors[3, b], errors[4, b], errors[5, b]
        s[0, b], s[1, b], s[2, b] = x + (y * t2 - z * t1), y + (z * t0 - x * t2), z + (x * t1 - y * t0)


@inner
def _by_errors(s: Array, errors: Array, by_reading: Array, used: int, turned: Array) -> None:
    """Set the derivatives (3, 6, LANES) of s + s x t by measurement and turn: (I - [t x]) ds/dz and [s x]."""
    for j in range(3):
        for b in range(used):
            x, y, z = by_reading[0, j, b], by_reading[1, j, b], by_reading[2, j, b]
            t0, t1, t2 = errors[3, b], errors[4, b], errors[5, b]
            turned[0, j, b], turned[1, j, b] = x + (y * t2 - z * t1), y + (z * t0 - x * t2)
            turned[2, j, b] = z + (x * t1 - y * t0)
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        turned[0, 3, b], turned[0, 4, b], turned[0, 5, b] = 0.0, -z, y
        turned[1, 3, b], turned[1, 4, b], turned[1, 5, b] = z, 0.0, -x
        turned[2, 3, b], turned[2, 4, b], turned[2, 5, b] = -y, x, 0.0


@inner
def _back(M: Array, s: Array, used: int, x: Array) -> None:
    """Set x to M^T s, (3, LANES) both."""
    for i in range(3):
        for b in range(used):
            x[i, b] = M[0, i] * s[0, b] + M[1, i] * s[1, b] + M[2, i] * s[2, b]
