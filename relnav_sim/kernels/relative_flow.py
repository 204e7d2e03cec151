"""Relative motion over one step of a filter, and its Jacobian by the variational equations.

What the chief does is given in legs, one for each epoch and for each run, or one that all runs share: `frames` with the
chief's orbit frame at both ends of the step, (epochs, runs, 24), flat of (2, 4, 3), the unit vectors R, T and N and the
frame's rates about them; and `nodes` with the chief at the nodes, flat of (parts, s, 2, 3), its position and the
acceleration there by what is no point mass. Kernels for points take these first and then how a step is integrated:

    tableau: As `relnav_sim.kernels.collocation` has it.
    sweeps: Evaluations of the acceleration at all nodes.
    h: Length of a part, s.
    field: Gravity, as `relnav_sim.kernels.relative_gravity` has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.collocation import finish, relative_path, tangent
from relnav_sim.kernels.compiling import given, inlined, integer, kernel, kernel_like, number
from relnav_sim.kernels.field_paths import FIELD, Field, field_during, field_gradient, relative_path_in_field
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors
from relnav_sim.kernels.relative_gravity import during, gradient

VECTORS = 2
"""What a node of a leg holds: position and acceleration."""
_FLOW = given(2), given(3), given(3), integer, given(2), integer, number


@kernel(*_FLOW, given(1))
def flow(
    points: Array, frames: Array, nodes: Array, epoch: int, tableau: Array, sweeps: int, h: float, field: Array
) -> Array:
    """Return RTN states (points, 6) after the step; as many points of each run follow each other."""
    s = len(tableau) - 2
    moved = np.empty(points.shape)
    x, room, path, f = np.empty((6, LANES)), np.empty((3, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES))
    flat_frames, flat_nodes = np.empty((24, LANES)), np.empty((nodes.shape[2], LANES))
    frame, chief = flat_frames.reshape(2, 4, 3, LANES), flat_nodes.reshape(-1, s, VECTORS, 3, LANES)
    runs, held = np.empty(LANES, dtype=np.int64), -1
    for first in range(0, len(points), LANES):
        used = min(LANES, len(points) - first)
        runs_of_lanes(first, used, len(points) // frames.shape[1], runs)
        if held != runs[0] or held != runs[used - 1]:
            load_rows(frames[epoch], runs, used, flat_frames)
            load_rows(nodes[epoch], runs, used, flat_nodes)
            held = runs[0] if used == LANES and runs[0] == runs[used - 1] else -1
        load_vectors(points, first, used, x)
        r, v = x[:3], x[3:]
        out_of_frame(frame[0], used, r, v)
        for part in range(len(chief)):
            now = during(field, epoch, part)
            relative_path(tableau, sweeps, h, now, chief[part], r, v, used, room, path, f)
            finish(tableau, h, f, used, r, v, path)
        into_frame(frame[1], used, r, v)
        store_vectors(x, first, used, moved)
    return moved


@kernel(*_FLOW, given(1))
def linear_flow(
    mean: Array, frames: Array, nodes: Array, epoch: int, tableau: Array, sweeps: int, h: float, field: Array
) -> tuple[Array, Array]:
    """Return the states of `flow`, bit by bit, and the Jacobian (runs, 6, 6), for one point (runs, 6) of each run."""
    runs, s = len(mean), len(tableau) - 2
    moved, F = np.empty((runs, 6)), np.empty((runs, 6, 6))
    x, room, path, f = np.empty((6, LANES)), np.empty((3, LANES)), np.empty((s, 3, LANES)), np.empty((s, 3, LANES))
    Y, Ypath, Yf = np.empty((36, LANES)), np.empty((s, 18, LANES)), np.empty((s, 18, LANES))
    G = np.empty((s, 3, 3, LANES))
    flat_frames, flat_nodes = np.empty((24, LANES)), np.empty((nodes.shape[2], LANES))
    frame, chief = flat_frames.reshape(2, 4, 3, LANES), flat_nodes.reshape(-1, s, VECTORS, 3, LANES)
    run = np.empty(LANES, dtype=np.int64)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        runs_of_lanes(first, used, runs // frames.shape[1], run)
        load_rows(frames[epoch], run, used, flat_frames)
        load_rows(nodes[epoch], run, used, flat_nodes)
        load_vectors(mean, first, used, x)
        Y[:] = 0.0
        for i in range(6):
            Y[7 * i] = 1.0
        r, v, Yr, Yv = x[:3], x[3:], Y[:18], Y[18:]
        out_of_frame(frame[0], used, r, v)
        out_of_frame(frame[0], used, Yr, Yv)
        for part in range(len(chief)):
            now = during(field, epoch, part)
            relative_path(tableau, sweeps, h, now, chief[part], r, v, used, room, path, f)
            for j in range(s):
                for i in range(3):
                    for b in range(used):
                        room[i, b] = chief[part, j, 0, i, b] + path[j, i, b]
                gradient(field, room, used, G[j])
            finish(tableau, h, f, used, r, v, path)
            tangent(tableau, sweeps, h, G, used, Yr, Yv, Ypath, Yf)
        into_frame(frame[1], used, r, v)
        into_frame(frame[1], used, Yr, Yv)
        store_vectors(x, first, used, moved)
        store_vectors(Y, first, used, F.reshape(runs, 36))
    return moved, F


_IN_FIELD: dict[str, Any] = {
    "VECTORS": 3,
    "during": field_during,
    "relative_path": relative_path_in_field,
    "gradient": field_gradient,
}


@kernel_like(flow, *_FLOW, FIELD, **_IN_FIELD)
def flow_in_field(
    points: Array, frames: Array, nodes: Array, epoch: int, tableau: Array, sweeps: int, h: float, field: Field
) -> Array:
    """Return what `flow` does, in a turning field, whose legs come from `relnav_sim.kernels.chief_orbit`."""
    return points


@kernel_like(linear_flow, *_FLOW, FIELD, **_IN_FIELD)
def linear_flow_in_field(
    mean: Array, frames: Array, nodes: Array, epoch: int, tableau: Array, sweeps: int, h: float, field: Field
) -> tuple[Array, Array]:
    """Return what `linear_flow` does, in a turning field; the Jacobian takes its zonal harmonics alone."""
    return mean, mean


@inlined
def runs_of_lanes(first: int, used: int, each: int, runs: Indices) -> None:
    """Set runs (LANES,) to the run of each point from `first` on, where `each` points of a run follow each other."""
    run, left = first // each, each - first % each
    for b in range(used):
        runs[b] = run
        left -= 1
        if left == 0:
            run, left = run + 1, each


@inlined
def load_rows(A: Array, rows: Indices, used: int, out: Array) -> None:
    """Copy some rows of A (runs, m) to lanes (m, LANES)."""
    for b in range(used):
        for i in range(A.shape[1]):
            out[i, b] = A[rows[b], i]


@inlined
def out_of_frame(frame: Array, used: int, r: Array, v: Array) -> None:
    """Turn r and v (3 p,), p columns side by side, out of a frame (4, 3): A^T r and A^T (v + w x r), in place."""
    p = len(r) // 3
    R, T, N, w = frame[0], frame[1], frame[2], frame[3]
    for c in range(p):
        for b in range(used):
            x, y, z = r[c, b], r[p + c, b], r[2 * p + c, b]
            vx = v[c, b] + w[1, b] * z - w[2, b] * y
            vy = v[p + c, b] + w[2, b] * x - w[0, b] * z
            vz = v[2 * p + c, b] + w[0, b] * y - w[1, b] * x
            r[c, b] = R[0, b] * x + T[0, b] * y + N[0, b] * z
            r[p + c, b] = R[1, b] * x + T[1, b] * y + N[1, b] * z
            r[2 * p + c, b] = R[2, b] * x + T[2, b] * y + N[2, b] * z
            v[c, b] = R[0, b] * vx + T[0, b] * vy + N[0, b] * vz
            v[p + c, b] = R[1, b] * vx + T[1, b] * vy + N[1, b] * vz
            v[2 * p + c, b] = R[2, b] * vx + T[2, b] * vy + N[2, b] * vz


@inlined
def into_frame(frame: Array, used: int, r: Array, v: Array) -> None:
    """Turn r and v (3 p,) into a frame (4, 3): A r and A v - w x A r, in place."""
    p = len(r) // 3
    R, T, N, w = frame[0], frame[1], frame[2], frame[3]
    for c in range(p):
        for b in range(used):
            rx, ry, rz, vx, vy, vz = r[c, b], r[p + c, b], r[2 * p + c, b], v[c, b], v[p + c, b], v[2 * p + c, b]
            x = R[0, b] * rx + R[1, b] * ry + R[2, b] * rz
            y = T[0, b] * rx + T[1, b] * ry + T[2, b] * rz
            z = N[0, b] * rx + N[1, b] * ry + N[2, b] * rz
            r[c, b], r[p + c, b], r[2 * p + c, b] = x, y, z
            v[c, b] = R[0, b] * vx + R[1, b] * vy + R[2, b] * vz - (w[1, b] * z - w[2, b] * y)
            v[p + c, b] = T[0, b] * vx + T[1, b] * vy + T[2, b] * vz - (w[2, b] * x - w[0, b] * z)
            v[2 * p + c, b] = N[0, b] * vx + N[1, b] * vy + N[2, b] * vz - (w[0, b] * y - w[1, b] * x)
