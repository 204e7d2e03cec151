"""How far lines of sight lie from where they were read, as two angles across them (see `astro.tangent_plane`).

About the direction u that was read, with axes e_a and e_b across it, a line of sight s has the components a = e_a . s,
b = e_b . s and c = u . s. It lies the angles (theta / p) (a, b) from u, p = (a^2 + b^2)^1/2, theta = atan2(p, c).
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import flag, given, inner, kernel
from relnav_sim.kernels.elementary import atan2
from relnav_sim.kernels.lanes import LANES, store, store_vectors
from relnav_sim.kernels.sight import seen

_TINY = 1e-280
_ROOT_OF_TINY = math.sqrt(_TINY)
_BESIDE = 1e-12
"""What stands straight behind the centre is moved this far, in units of its distance, to have a bearing."""


@kernel(given(2), given(2), given(2), flag)
def readings(positions: Array, M: Array, centres: Array, ranged: bool) -> Array:
    """Return both angles, and before them the range if wanted, (points, 2 or 3).

    Args:
        positions: Where the other craft is (points, 3 or more), the points of a run one after the other.
        M: Rotation (3, 3) from their axes to the sensor's.
        centres: Directions read, unit vectors (runs, 3); of a run where it is NaN, that of its first point.
        ranged: Whether the range is wanted.
    """
    points, more = len(positions), int(ranged)
    z = np.empty((points, 2 + more))
    s, h = np.empty((3, LANES)), np.empty((2 + more, LANES))
    u, axes, c = np.empty((3, LANES)), np.empty((2, 3, LANES)), np.empty((6, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        _look(positions, first, used, M, centres, s, u, axes, c, h)
        store_vectors(h, first, used, z)
    return z


@kernel(given(2), given(2), given(2), flag)
def linearised(positions: Array, M: Array, centres: Array, ranged: bool) -> tuple[Array, Array]:
    """Return `readings` and their derivatives by what the rows of positions hold, (points, 2 or 3, columns).

    With the bearing q = (a, b) / p, d(theta q) = q (c q . d(a, b) - p dc) / (p^2 + c^2)
    + (theta / p) (d(a, b) - q q . d(a, b)).
    """
    points, columns = positions.shape
    more = int(ranged)
    z, H = np.empty((points, 2 + more)), np.empty((points, 2 + more, columns))
    s, h, g = np.empty((3, LANES)), np.empty((2 + more, LANES)), np.empty((2 + more, 3, LANES))
    u, axes, c = np.empty((3, LANES)), np.empty((2, 3, LANES)), np.empty((6, LANES))
    by_position = np.zeros((2 + more, columns, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        _look(positions, first, used, M, centres, s, u, axes, c, h)
        store_vectors(h, first, used, z)
        if ranged:
            for i in range(3):
                for b in range(used):
                    g[0, i, b] = s[i, b] / h[0, b]
        for i in range(3):
            for b in range(used):
                p, ahead, stretch, qa, qb = c[3, b], c[2, b], c[4, b], c[0, b] / c[5, b], c[1, b] / c[5, b]
                squared = p * p + ahead * ahead
                excess, back = ahead / squared - stretch, p / squared
                ea, eb, mixed = axes[0, i, b], axes[1, i, b], excess * qa * qb
                g[more, i, b] = (stretch + excess * qa * qa) * ea + mixed * eb - back * qa * u[i, b]
                g[more + 1, i, b] = (stretch + excess * qb * qb) * eb + mixed * ea - back * qb * u[i, b]
        for i in range(2 + more):
            for j in range(3):
                for b in range(used):
                    by_position[i, j, b] = g[i, 0, b] * M[0, j] + g[i, 1, b] * M[1, j] + g[i, 2, b] * M[2, j]
        store(by_position, first, used, H)
    return z, H


@kernel(given(2), given(2), given(2))
def by_turn(positions: Array, M: Array, centres: Array) -> Array:
    """Return the derivatives G of both angles by a small turn that takes u to u + u x dtheta, (runs, 2, 3).

    Its rows are e_a x u and e_b x u. Arguments as above, with one point a run.
    """
    runs = len(positions)
    G = np.empty((runs, 2, 3))
    u, axes, g = np.empty((3, LANES)), np.empty((2, 3, LANES)), np.empty((2, 3, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        _centres(positions, first, used, M, centres, u, axes)
        _turns(u, axes, used, g)
        store(g, first, used, G)
    return G


@kernel(given(2), given(2), given(2), given(2), given(3))
def noise(positions: Array, M: Array, centres: Array, P: Array, own: Array) -> Array:
    """Return own + G P G^T in the last two channels, (runs, k, m, m), symmetric to the bit.

    Args:
        positions: As above, with one point a run, as M and the centres.
        M: As above.
        centres: As above.
        P: Covariance of the turn, (3, 3), rad^2.
        own: Covariances of the sensor's own noise, (k, m, m).
    """
    runs = len(positions)
    k, m, _ = own.shape
    R = np.empty((runs, k, m, m))
    u, axes, g = np.empty((3, LANES)), np.empty((2, 3, LANES)), np.empty((2, 3, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        _centres(positions, first, used, M, centres, u, axes)
        _turns(u, axes, used, g)
        for b in range(used):
            for component in range(k):
                for i in range(m):
                    for j in range(m):
                        R[first + b, component, i, j] = own[component, i, j]
            for i in range(2):
                for j in range(i + 1):
                    added = 0.0
                    for o in range(3):
                        added += g[i, o, b] * (P[o, 0] * g[j, 0, b] + P[o, 1] * g[j, 1, b] + P[o, 2] * g[j, 2, b])
                    for component in range(k):
                        R[first + b, component, m - 2 + i, m - 2 + j] += added
                        if i != j:
                            R[first + b, component, m - 2 + j, m - 2 + i] += added
    return R


@inner
def across(u: Array, used: int, axes: Array) -> None:
    """Set the axes e_a and e_b (2, 3, LANES) across the directions u (3, LANES), as `astro.tangent_plane.across`."""
    for b in range(used):
        x, y, z = u[0, b], u[1, b], u[2, b]
        behind = x < 0 and y * y + z * z < _TINY  # every way round is as good; this one is about z
        y = _ROOT_OF_TINY if behind else y
        z = 0.0 if behind else z
        # 1 / (1 + x), without loss of digits where x is near -1.
        inverse = (1 - x) / max(y * y + z * z, _TINY) if x < 0 else 1 / (1 + abs(x))
        yz = y * z * inverse
        axes[0, 0, b], axes[0, 1, b], axes[0, 2, b] = -y, 1 - y * y * inverse, -yz
        axes[1, 0, b], axes[1, 1, b], axes[1, 2, b] = z, yz, z * z * inverse - 1


@inner
def _look(
    positions: Array,
    first: int,
    used: int,
    M: Array,
    centres: Array,
    s: Array,
    u: Array,
    axes: Array,
    c: Array,
    h: Array,
) -> None:
    """Set lines of sight s (3, LANES), what `_centres` and `_from_centre` set, and measurements h (2 or 3, LANES)."""
    seen(positions, first, used, M, s)
    _centres(positions, first, used, M, centres, u, axes)
    _from_centre(s, u, axes, used, c)
    _read(s, c, used, h)


@inner
def _centres(positions: Array, first: int, used: int, M: Array, centres: Array, u: Array, axes: Array) -> None:
    """Set u (3, LANES) to the direction of each point's measurement, or of its run's first point where there is none.

    Set the axes across it too.
    """
    each = len(positions) // len(centres)
    for b in range(used):
        run = (first + b) // each
        for i in range(3):
            u[i, b] = centres[run, i]
        if math.isnan(u[0, b]):
            own = run * each
            squared = 0.0
            for i in range(3):
                u[i, b] = M[i, 0] * positions[own, 0] + M[i, 1] * positions[own, 1] + M[i, 2] * positions[own, 2]
                squared += u[i, b] * u[i, b]
            for i in range(3):
                u[i, b] /= math.sqrt(squared)
    across(u, used, axes)


@inner
def _from_centre(s: Array, u: Array, axes: Array, used: int, c: Array) -> None:
    """Set c (6, LANES) to a, b, c, p, theta / p, and p or 1 where it is 0; one straight behind gets a bearing."""
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        first = axes[0, 0, b] * x + axes[0, 1, b] * y + axes[0, 2, b] * z
        second = axes[1, 0, b] * x + axes[1, 1, b] * y + axes[1, 2, b] * z
        ahead = u[0, b] * x + u[1, b] * y + u[2, b] * z
        first = -_BESIDE * ahead if first == 0 and second == 0 and ahead < 0 else first
        p = math.sqrt(first * first + second * second)
        c[0, b], c[1, b], c[2, b], c[3, b] = first, second, ahead, p
        c[5, b] = 1.0 if p == 0 else p
    for b in range(used):
        theta = atan2(c[3, b], c[2, b])
        c[4, b] = 1 / c[2, b] if c[3, b] == 0 else theta / c[3, b]


@inner
def _read(s: Array, c: Array, used: int, h: Array) -> None:
    """Set h (2 or 3, LANES) to both angles, behind the range where there is a place for it."""
    more = len(h) - 2
    for b in range(used):
        if more:
            h[0, b] = math.sqrt(s[0, b] * s[0, b] + s[1, b] * s[1, b] + s[2, b] * s[2, b])
        h[more, b], h[more + 1, b] = c[4, b] * c[0, b], c[4, b] * c[1, b]


@inner
def _turns(u: Array, axes: Array, used: int, g: Array) -> None:
    """Set the rows of g (2, 3, LANES) to e_a x u and e_b x u."""
    for i in range(2):
        for b in range(used):
            g[i, 0, b] = axes[i, 1, b] * u[2, b] - axes[i, 2, b] * u[1, b]
            g[i, 1, b] = axes[i, 2, b] * u[0, b] - axes[i, 0, b] * u[2, b]
            g[i, 2, b] = axes[i, 0, b] * u[1, b] - axes[i, 1, b] * u[0, b]
