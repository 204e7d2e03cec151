"""A spacecraft's own orbit in inertial axes: step by step, what it is to the motion of another, and its filter.

How a step is integrated (tableau, sweeps, parts, h, field) is said as in `relnav_sim.kernels.relative_flow`.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.collocation import finish, orbit_path, tangent
from relnav_sim.kernels.compiling import flag, given, inner, integer, kernel, kernel_like, number
from relnav_sim.kernels.field_paths import (
    FIELD,
    Field,
    acceleration_in_field,
    field_during,
    field_gradient,
    orbit_path_in_field,
    rest,
    room_for_rest,
)
from relnav_sim.kernels.lanes import (
    LANES,
    back,
    factor,
    forward,
    load,
    load_vectors,
    product,
    product_by_transpose,
    store_symmetric,
    store_vectors,
)
from relnav_sim.kernels.relative_gravity import acceleration, during, gradient, harmonics

_WALK = given(1), integer, given(2), integer, integer, number
_FOLLOW = (
    given(3), given(3), given(3), flag, given(2), given(3), given(2), given(1), given(2), integer, integer, number,
)  # fmt: skip


@kernel(*_WALK, given(1))
def walk(state: Array, steps: int, tableau: Array, sweeps: int, parts: int, h: float, field: Array) -> Array:
    """Return the states (steps + 1, 6) of an orbit from a state (6,) on, step by step."""
    s = len(tableau) - 2
    states = np.empty((steps + 1, 6))
    x, path, f = np.empty((6, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES))
    for i in range(6):
        states[0, i] = x[i, 0] = state[i]
    r, v = x[:3], x[3:]
    for k in range(1, steps + 1):
        for part in range(parts):
            orbit_path(tableau, sweeps, h, during(field, k - 1, part), r, v, 1, path, f)
            finish(tableau, h, f, 1, r, v, path)
        store_vectors(x, k, 1, states)
    return states


@kernel(given(2), given(2), integer, integer, number, given(1))
def legs(chief: Array, tableau: Array, sweeps: int, parts: int, h: float, field: Array) -> tuple[Array, Array]:
    """Return frames (states, 24) and nodes (states, 6 s parts) of the steps from states (states, 6)."""
    count, s = len(chief), len(tableau) - 2
    frames, nodes = np.empty((count, 24)), np.empty((count, 6 * s * parts))
    x, path, f = np.empty((6, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES))
    flat_frames, flat_nodes = np.empty((24, LANES)), np.empty((6 * s * parts, LANES))
    frame, leg = flat_frames.reshape(2, 4, 3, LANES), flat_nodes.reshape(parts, s, 2, 3, LANES)
    for first in range(0, count, LANES):
        used = min(LANES, count - first)
        load_vectors(chief, first, used, x)
        r, v = x[:3], x[3:]
        acceleration(field, r, used, f[0])
        orbit_frame(f[0], r, v, used, frame[0])
        for part in range(parts):
            orbit_path(tableau, sweeps, h, field, r, v, used, path, f)
            for j in range(s):
                for i in range(3):
                    for b in range(used):
                        leg[part, j, 0, i, b] = path[j, i, b]
                harmonics(field, path[j], used, leg[part, j, 1])
            finish(tableau, h, f, used, r, v, path)
        acceleration(field, r, used, f[0])
        orbit_frame(f[0], r, v, used, frame[1])
        store_vectors(flat_frames, first, used, frames)
        store_vectors(flat_nodes, first, used, nodes)
    return frames, nodes


@kernel(*_FOLLOW, given(1))
def follow(
    fixes: Array,
    before: Array,
    after: Array,
    started: bool,
    m: Array,
    P: Array,
    Q: Array,
    R: Array,
    tableau: Array,
    sweeps: int,
    parts: int,
    h: float,
    field: Array,
) -> tuple[Array, Array]:
    """Return the estimates (runs, K, 6) of orbits from fixes, and the covariance (runs, 6, 6) of the last ones.

    An extended Kalman filter whose measurement is the state, so that the covariance P - K P becomes K R, which keeps
    its digits.

    Args:
        fixes: (runs, K, 6), NaN = none.
        before: Kicks where the step to each of the epochs begins, (runs or 1, K, 3), m/s, in the axes R, T and N; (.,
            0, 3): none at all.
        after: The same where it ends.
        started: Whether a step leads to the first of the epochs; else the prior is there.
        m: Estimates before, (runs, 6).
        P: Their covariances (runs, 6, 6).
        Q: Process noise of a step (6, 6).
        R: Variances of a fix (6,).
        tableau: How a step is integrated, as `sweeps`, `parts`, `h` and `field`.
        sweeps: See there.
        parts: See there.
        h: See there.
        field: See there.
    """
    runs, K, n = fixes.shape
    s, kicked = len(tableau) - 2, before.shape[1] > 0
    estimates, covariance = np.empty((runs, K, n)), np.empty((runs, n, n))
    x, path, f = np.empty((6, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES))
    F, Fpath, Ff = np.empty((n, n, LANES)), np.empty((s, 18, LANES)), np.empty((s, 18, LANES))
    G, p, FP = np.empty((s, 3, 3, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES))
    L, W, present = np.zeros((n, n, LANES)), np.empty((n, n, LANES)), np.empty(LANES, dtype=np.bool_)
    axes, Y, r, v = np.empty((3, 3, LANES)), F.reshape(n * n, LANES), x[:3], x[3:]
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(P, first, used, p)
        for k in range(K):
            if started or k:
                if kicked:
                    kick(before, first, k, used, axes, r, v)
                Y[:] = 0.0
                for i in range(n):
                    F[i, i] = 1.0
                for part in range(parts):
                    orbit_path(tableau, sweeps, h, during(field, k, part), r, v, used, path, f)
                    for j in range(s):
                        gradient(field, path[j], used, G[j])
                    finish(tableau, h, f, used, r, v, path)
                    tangent(tableau, sweeps, h, G, used, Y[:18], Y[18:], Fpath, Ff)
                product(F, p, used, FP)
                product_by_transpose(FP, F, used, p)
                for i in range(n):
                    for j in range(i + 1):
                        for b in range(used):
                            p[i, j, b] = p[j, i, b] = (p[i, j, b] + p[j, i, b]) / 2 + Q[i, j]
                if kicked:
                    kick(after, first, k, used, axes, r, v)
            for b in range(used):
                present[b] = True
                for i in range(n):
                    present[b] &= not math.isnan(fixes[first + b, k, i])
            correct(fixes, first, k, R, present, used, x, p, L, W)
            for b in range(used):
                for i in range(n):
                    estimates[first + b, k, i] = x[i, b]
        store_symmetric(p, first, used, covariance)
    return estimates, covariance


@kernel_like(walk, *_WALK, FIELD, during=field_during, orbit_path=orbit_path_in_field)
def walk_in_field(state: Array, steps: int, tableau: Array, sweeps: int, parts: int, h: float, field: Field) -> Array:
    """Return what `walk` does, in a turning field."""
    return state


@kernel(given(3), given(2), integer, integer, number, FIELD, given(4))
def legs_in_field(
    chief: Array, tableau: Array, sweeps: int, parts: int, h: float, field: Field, ends: Array
) -> tuple[Array, Array]:
    """Return what `legs` does, in a turning field, whose nodes have the acceleration by the rest of the field too.

    Args:
        chief: States where steps begin, (K, runs, 6).
        tableau: How a step is integrated, as `sweeps`, `parts` and `h`.
        sweeps: See there.
        parts: See there.
        h: See there.
        field: The field during the K steps.
        ends: How it is turned where they begin and end, (K, 2, 3, 3).

    Returns:
        Frames (K, runs, 24) and nodes (K, runs, 9 s parts), flat of (parts, s, 3, 3).
    """
    K, runs, _ = chief.shape
    s = len(tableau) - 2
    frames, nodes = np.empty((K, runs, 24)), np.empty((K, runs, 9 * s * parts))
    x, path, f, room = np.empty((6, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES)), room_for_rest()
    flat_frames, flat_nodes = np.empty((24, LANES)), np.empty((9 * s * parts, LANES))
    frame, leg = flat_frames.reshape(2, 4, 3, LANES), flat_nodes.reshape(parts, s, 3, 3, LANES)
    for k in range(K):
        for first in range(0, runs, LANES):
            used = min(LANES, runs - first)
            load_vectors(chief[k], first, used, x)
            r, v = x[:3], x[3:]
            acceleration_in_field(field_during(field, k, 0), ends[k, 0], r, used, room, f[0])
            orbit_frame(f[0], r, v, used, frame[0])
            for part in range(parts):
                now = field_during(field, k, part)
                orbit_path_in_field(tableau, sweeps, h, now, r, v, used, path, f)
                for j in range(s):
                    for i in range(3):
                        for b in range(used):
                            leg[part, j, 0, i, b] = path[j, i, b]
                    harmonics(field.zonals, path[j], used, leg[part, j, 1])
                    rest(now, now.turns[j], path[j], used, room, leg[part, j, 2])
                finish(tableau, h, f, used, r, v, path)
            acceleration_in_field(field_during(field, k, 0), ends[k, 1], r, used, room, f[0])
            orbit_frame(f[0], r, v, used, frame[1])
            store_vectors(flat_frames, first, used, frames[k])
            store_vectors(flat_nodes, first, used, nodes[k])
    return frames, nodes


@kernel_like(follow, *_FOLLOW, FIELD, during=field_during, orbit_path=orbit_path_in_field, gradient=field_gradient)
def follow_in_field(
    fixes: Array,
    before: Array,
    after: Array,
    started: bool,
    m: Array,
    P: Array,
    Q: Array,
    R: Array,
    tableau: Array,
    sweeps: int,
    parts: int,
    h: float,
    field: Field,
) -> tuple[Array, Array]:
    """Return what `follow` does, in a turning field; the covariance goes by its zonal harmonics alone."""
    return m, P


@inner
def correct(
    fixes: Array, first: int, k: int, R: Array, present: Mask, used: int, x: Array, P: Array, L: Array, W: Array
) -> None:
    """Correct x (6,) and P (6, 6) by the fixes of epoch k where they are present; W becomes (P + R)^-1 P = K^T."""
    n = len(R)
    for i in range(n):
        for j in range(n):
            for b in range(used):
                W[i, j, b] = P[i, j, b]
        for b in range(used):
            W[i, i, b] += R[i]
    factor(W, used, L)
    for i in range(n):
        for b in range(used):
            W[i, i, b] = P[i, i, b]
    forward(L, used, W)
    back(L, used, W)
    for b in range(used):
        if present[b]:
            for i in range(n):
                move = 0.0
                for j in range(n):
                    move += W[j, i, b] * (fixes[first + b, k, j] - x[j, b])
                L[i, 0, b] = move
            for i in range(n):
                x[i, b] += L[i, 0, b]
                for j in range(i + 1):
                    P[i, j, b] = P[j, i, b] = (W[j, i, b] * R[j] + W[i, j, b] * R[i]) / 2


@inner
def kick(kicks: Array, first: int, k: int, used: int, axes: Array, r: Array, v: Array) -> None:
    """Change v (3,) by the kicks of epoch k; where they are zero not a bit of it changes."""
    orbit_axes(r, v, used, axes)
    shared = len(kicks) == 1
    for b in range(used):
        run = 0 if shared else first + b
        radial, along, normal = kicks[run, k, 0], kicks[run, k, 1], kicks[run, k, 2]
        if radial != 0.0 or along != 0.0 or normal != 0.0:
            for i in range(3):
                v[i, b] += radial * axes[0, i, b] + along * axes[1, i, b] + normal * axes[2, i, b]


@inner
def orbit_axes(r: Array, v: Array, used: int, axes: Array) -> None:
    """Set axes (3, 3) to the unit vectors R, T and N of an orbit."""
    for b in range(used):
        x, y, z = r[0, b], r[1, b], r[2, b]
        hx, hy, hz = y * v[2, b] - z * v[1, b], z * v[0, b] - x * v[2, b], x * v[1, b] - y * v[0, b]
        distance, momentum = math.sqrt(x * x + y * y + z * z), math.sqrt(hx * hx + hy * hy + hz * hz)
        x, y, z, hx, hy, hz = x / distance, y / distance, z / distance, hx / momentum, hy / momentum, hz / momentum
        axes[0, 0, b], axes[0, 1, b], axes[0, 2, b] = x, y, z
        axes[1, 0, b], axes[1, 1, b], axes[1, 2, b] = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        axes[2, 0, b], axes[2, 1, b], axes[2, 2, b] = hx, hy, hz


@inner
def orbit_frame(a: Array, r: Array, v: Array, used: int, frame: Array) -> None:
    """Set frame (4, 3) to the unit vectors R, T, N of an orbit and the frame's rates about them.

    Besides h / r^2 about N the frame turns at r a_N / h about R, a_N being the acceleration a (3,) along the normal.
    """
    orbit_axes(r, v, used, frame[:3])
    N, w = frame[2], frame[3]
    for b in range(used):
        distance = math.sqrt(r[0, b] * r[0, b] + r[1, b] * r[1, b] + r[2, b] * r[2, b])
        hx, hy = r[1, b] * v[2, b] - r[2, b] * v[1, b], r[2, b] * v[0, b] - r[0, b] * v[2, b]
        hz = r[0, b] * v[1, b] - r[1, b] * v[0, b]
        momentum = math.sqrt(hx * hx + hy * hy + hz * hz)
        w[0, b] = distance * (a[0, b] * N[0, b] + a[1, b] * N[1, b] + a[2, b] * N[2, b]) / momentum
        w[1, b] = 0.0
        w[2, b] = momentum / (distance * distance)
