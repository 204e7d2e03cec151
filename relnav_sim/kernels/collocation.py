"""Gauss collocation of r'' = f over a step, solved by fixed-point iteration, lanes last.

Gauss's implicit Runge-Kutta methods in Nystroem's form (Hairer, Norsett and Wanner, Solving Ordinary Differential
Equations I, 2nd ed., sections II.7 and II.14). A tableau (s + 2, s + 1) has a row for each of the s nodes, its place c
in the step and the weights of f in the position there, and two rows more, whose weights give position and velocity at
the end. Positions r and velocities v are (m, LANES), at the nodes (s, m, LANES).

A sweep of the iteration puts the nodes on the straight line or bends that line by the f of the sweep before, and the
caller evaluates f there; after the last one `finish` moves r and v to the end of the step.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import inlined, inner, short_for
from relnav_sim.kernels.relative_gravity import acceleration, difference


@inlined
def place_nodes(tableau: Array, h: float, r: Array, v: Array, f: Array, sweep: int, used: int, nodes: Array) -> None:
    """Set the nodes (s, m) for a sweep: a straight line in the first one, later with what f (s, m) adds to it."""
    for j in range(len(nodes)):
        ch = h * tableau[j, 0]
        for i in range(len(r)):
            if sweep == 0:
                for b in range(used):
                    nodes[j, i, b] = r[i, b] + ch * v[i, b]
            else:
                weigh(tableau[j], h * h, f, i, used, nodes[j, i])
                for b in range(used):
                    nodes[j, i, b] = r[i, b] + ch * v[i, b] + nodes[j, i, b]


@inner
def finish(tableau: Array, h: float, f: Array, used: int, r: Array, v: Array, nodes: Array) -> None:
    """Move r and v to the end of the step by f at the nodes; the nodes' array serves as room and is lost."""
    s = len(f)
    for i in range(len(r)):
        bend, gain = nodes[0, i], nodes[1, i]
        weigh(tableau[s], h * h, f, i, used, bend)
        weigh(tableau[s + 1], h, f, i, used, gain)
        for b in range(used):
            r[i, b] = r[i, b] + h * v[i, b] + bend[b]
            v[i, b] += gain[b]


@inlined
def weigh(row: Array, factor: float, f: Array, i: int, used: int, total: Array) -> None:
    """Set total (LANES,) to the weighted sum of component i of f over the nodes; the small terms come first."""
    first = factor * row[1]
    for b in range(used):
        total[b] = first * f[0, i, b]
    for k in range(1, len(f)):
        weight = factor * row[1 + k]
        for b in range(used):
            total[b] += weight * f[k, i, b]


@inlined
def orbit_path(
    tableau: Array, sweeps: int, h: float, field: Array, r: Array, v: Array, used: int, nodes: Array, f: Array
) -> None:
    """Set nodes (s, 3) and the acceleration f (s, 3) there to those of an orbit from r, v (3,); `finish` ends it."""
    for sweep in range(sweeps):
        place_nodes(tableau, h, r, v, f, sweep, used, nodes)
        for j in range(len(nodes)):
            acceleration(field, nodes[j], used, f[j])


@inlined
def relative_path(
    tableau: Array,
    sweeps: int,
    h: float,
    field: Array,
    chief: Array,
    r: Array,
    v: Array,
    used: int,
    room: Array,
    nodes: Array,
    f: Array,
) -> None:
    """Set nodes (s, 3) and f (s, 3) to those of a path relative to a chief, whose leg (s, 2, 3) has both at its own."""
    for sweep in range(sweeps):
        place_nodes(tableau, h, r, v, f, sweep, used, nodes)
        for j in range(len(nodes)):
            difference(field, chief[j, 0], chief[j, 1], nodes[j], used, room, f[j])


@inner
def tangent(
    tableau: Array, sweeps: int, h: float, G: Array, used: int, r: Array, v: Array, nodes: Array, f: Array
) -> None:
    """Move r and v (3 p,), p columns of Y'' = G Y side by side, over the step by the gradients G (s, 3, 3)."""
    p = len(r) // 3
    for sweep in range(sweeps):
        place_nodes(tableau, h, r, v, f, sweep, used, nodes)
        for j in range(len(nodes)):
            for i in range(3):
                for c in range(p):
                    for b in range(used):
                        f[j, i * p + c, b] = (
                            G[j, i, 0, b] * nodes[j, c, b]
                            + G[j, i, 1, b] * nodes[j, p + c, b]
                            + G[j, i, 2, b] * nodes[j, 2 * p + c, b]
                        )
    finish(tableau, h, f, used, r, v, nodes)


@short_for(place_nodes)
def _place_nodes(tableau: Array, h: float, r: Array, v: Array, f: Array, sweep: int, used: int, nodes: Array) -> None:
    s, m, lanes = nodes.shape
    nodes[...] = r + h * tableau[:s, 0, None, None] * v
    if sweep > 0:
        nodes += (h * h * tableau[:s, 1:] @ f.reshape(s, m * lanes)).reshape(nodes.shape)


@short_for(finish)
def _finish(tableau: Array, h: float, f: Array, used: int, r: Array, v: Array, nodes: Array) -> None:
    bend, gain = (tableau[len(f) :, 1:] @ f.reshape(len(f), -1)).reshape(2, *r.shape)
    r += h * v + h * h * bend
    v += h * gain


@short_for(tangent)
def _tangent(
    tableau: Array, sweeps: int, h: float, G: Array, used: int, r: Array, v: Array, nodes: Array, f: Array
) -> None:
    s, lanes = len(G), r.shape[-1]
    for sweep in range(sweeps):
        _place_nodes(tableau, h, r, v, f, sweep, used, nodes)
        f[...] = np.einsum("sijb,sjpb->sipb", G, nodes.reshape(s, 3, -1, lanes)).reshape(f.shape)
    _finish(tableau, h, f, used, r, v, nodes)
