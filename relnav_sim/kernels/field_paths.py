"""Orbits and relative paths under a real field, which turns with the Earth; lanes last.

The field is taken apart: a point mass and J2 to J4 about the z axis of the frame, whose difference between two craft
loses no digits, as `relnav_sim.kernels.relative_gravity` has them, and the rest: the other harmonics, and what the tilt
of the Earth's axis against that z axis makes of J2 to J4. The rest is below 1e-3 m/s^2, its gradient g at most 2e-9
1/s^2, and its sum over all harmonics costs far more than the other. So it is evaluated at nodes that the iteration has
already found without it, `rounds` times, and is constant in between: each round leaves g h^2 / 2 times what the one
before has left, h being the length of a part.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.collocation import place_nodes
from relnav_sim.kernels.compiling import inlined, inner, integer, record, written
from relnav_sim.kernels.lanes import LANES
from relnav_sim.kernels.relative_gravity import acceleration, difference, gradient, harmonics
from relnav_sim.kernels.spherical_harmonics import ROOM, SERIES, Series, sums


class Field(NamedTuple):
    """A field over K steps.

    Attributes:
        zonals: Point mass and J2 to J4, (5,), as `relnav_sim.kernels.relative_gravity` has them.
        others: The acceleration by all other harmonics in the field's own axes.
        turns: Rotations from the frame's axes to the field's at the nodes, (K, parts s, 3, 3).
        nodes: s.
        rounds: How often the rest is evaluated in a part.
    """

    zonals: Array
    others: Series
    turns: Array
    nodes: int
    rounds: int


class FieldDuring(NamedTuple):
    """A field in a part of a step: as `Field`, with the turns at its nodes, (s, 3, 3)."""

    zonals: Array
    others: Series
    turns: Array
    rounds: int


FIELD = record(Field, written(1), SERIES, written(4), integer, integer)


@inlined
def field_during(field: Field, step: int, part: int) -> FieldDuring:
    """Return the field as it is in a part of a step."""
    first = part * field.nodes
    return FieldDuring(field.zonals, field.others, field.turns[step, first : first + field.nodes], field.rounds)


@inlined
def field_gradient(field: Field, r: Array, used: int, G: Array) -> None:
    """Set G (3, 3) to the derivatives of the acceleration at r (3,) by point mass and J2 to J4."""
    gradient(field.zonals, r, used, G)


@inlined
def room_for_rest() -> Array:
    """Return what `rest` works in."""
    return np.empty((ROOM + 6, LANES))


@inner
def rest(field: FieldDuring, turn: Array, r: Array, used: int, room: Array, a: Array) -> None:
    """Set a (3,) to the acceleration at r (3,) by all but the point mass and J2 to J4 about the frame's z axis.

    Args:
        field: The field.
        turn: Rotation from the frame's axes to the field's, (3, 3).
        r: Positions, m.
        used: How many lanes count.
        room: Of `room_for_rest`.
        a: The result, m/s^2; not r.
    """
    fixed, pull, work = room[:3], room[3:6], room[6:].reshape(ROOM * LANES)
    for i in range(3):
        for b in range(used):
            fixed[i, b] = turn[i, 0] * r[0, b] + turn[i, 1] * r[1, b] + turn[i, 2] * r[2, b]
    sums(field.others, fixed, used, work, pull)
    harmonics(field.zonals, fixed, used, a)
    for i in range(3):
        for b in range(used):
            fixed[i, b] = pull[i, b] + a[i, b]
    harmonics(field.zonals, r, used, a)
    for i in range(3):
        for b in range(used):
            a[i, b] = turn[0, i] * fixed[0, b] + turn[1, i] * fixed[1, b] + turn[2, i] * fixed[2, b] - a[i, b]


@inner
def acceleration_in_field(field: FieldDuring, turn: Array, r: Array, used: int, room: Array, a: Array) -> None:
    """Set a (3,) to the whole acceleration at r (3,); the arguments are those of `rest`."""
    rest(field, turn, r, used, room, a)
    without = room[:3]
    acceleration(field.zonals, r, used, without)
    for i in range(3):
        for b in range(used):
            a[i, b] += without[i, b]


@inner
def orbit_path_in_field(
    tableau: Array, sweeps: int, h: float, field: FieldDuring, r: Array, v: Array, used: int, nodes: Array, f: Array
) -> None:
    """Set nodes (s, 3) and the acceleration f (s, 3) there to those of an orbit from r, v (3,); `finish` ends it."""
    beside, room = np.zeros((len(nodes), 3, LANES)), room_for_rest()
    for again in range(field.rounds + 1):
        for sweep in range(sweeps):
            place_nodes(tableau, h, r, v, f, sweep, used, nodes)
            for j in range(len(nodes)):
                acceleration(field.zonals, nodes[j], used, f[j])
                add(beside[j], used, f[j])
        if again < field.rounds:
            for j in range(len(nodes)):
                rest(field, field.turns[j], nodes[j], used, room, beside[j])


@inner
def relative_path_in_field(
    tableau: Array,
    sweeps: int,
    h: float,
    field: FieldDuring,
    chief: Array,
    r: Array,
    v: Array,
    used: int,
    moved: Array,
    nodes: Array,
    f: Array,
) -> None:
    """Set nodes (s, 3) and f (s, 3) to those of a path relative to a chief, whose leg is (s, 3, 3).

    The leg has the chief's position at the nodes, and the accelerations there by J2 to J4 and by the rest.
    """
    beside, room = np.zeros((len(nodes), 3, LANES)), room_for_rest()
    for again in range(field.rounds + 1):
        for sweep in range(sweeps):
            place_nodes(tableau, h, r, v, f, sweep, used, nodes)
            for j in range(len(nodes)):
                difference(field.zonals, chief[j, 0], chief[j, 1], nodes[j], used, moved, f[j])
                add(beside[j], used, f[j])
        if again < field.rounds:
            for j in range(len(nodes)):
                for i in range(3):
                    for b in range(used):
                        moved[i, b] = chief[j, 0, i, b] + nodes[j, i, b]
                rest(field, field.turns[j], moved, used, room, beside[j])
                for i in range(3):
                    for b in range(used):
                        beside[j, i, b] -= chief[j, 2, i, b]


@inlined
def add(more: Array, used: int, a: Array) -> None:
    """Add more (3,) to a (3,)."""
    for i in range(3):
        for b in range(used):
            a[i, b] += more[i, b]
