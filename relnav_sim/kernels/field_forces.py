"""What moves a spacecraft about the Earth as it is: its turning field, Sun and Moon, sunlight, air and thrust."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels import spherical_harmonics
from relnav_sim.kernels.atmosphere import LAYERS, Layers, add_layered_drag
from relnav_sim.kernels.compiling import flag, given, inner, kernel, number, record, written
from relnav_sim.kernels.dop853 import CIRCULAR_ERROR
from relnav_sim.kernels.forces import add_thrust
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors
from relnav_sim.kernels.sky import (
    DAY_S,
    MOON,
    ROWS,
    SKY,
    SUN,
    Sky,
    add_radiation,
    add_third_body,
    add_turned_back,
    longest_by_shadow,
    look_up,
    set_orientation,
    turn,
)
from relnav_sim.kernels.spherical_harmonics import SERIES, Series, sums


class FieldForces(NamedTuple):
    """The environment, alike for all craft.

    Attributes:
        mu: Gravitational parameter, m^3/s^2.
        radius: Of the field, m; the altitude refers to it, and the shadow.
        field: The components of its acceleration in Earth-fixed axes.
        sky: How the Earth is turned, and where Sun and Moon are.
        sun_mu: Gravitational parameter of the Sun, m^3/s^2; 0 without its pull.
        moon_mu: That of the Moon.
        sunlight: Whether its pressure counts.
        air: Layers, none for no drag.
        rotation: Of the air about z, rad/s.
        sense: Of time: 1, or -1 on the way back from the epoch.
        roughness: What the field's degrees 3, 4, ... add to the error of a step, by the squares of R/r to the power of
            the degree; empty for a field so smooth that this does not matter.
    """

    mu: float
    radius: float
    field: Series
    sky: Sky
    sun_mu: float
    moon_mu: float
    sunlight: bool
    air: Layers
    rotation: float
    sense: float
    roughness: Array


FIELD_FORCES = record(
    FieldForces, number, number, SERIES, SKY, number, number, flag, LAYERS, number, number, written(1)
)
_TURN, _FIXED, _TIME, _FIELD = ROWS, ROWS + 9, ROWS + 12, ROWS + 13
ROOM = _FIELD + spherical_harmonics.ROOM
"""Rows of lanes that the forces need to work in."""


@inner
def derivative(
    y: Array, clock: Array, used: int, forces: FieldForces, areas: Array, thrust: Array, room: Array, out: Array
) -> None:
    """Set out (6,) to the derivative of states y (6,): the velocity, and the sum of all forces.

    Args:
        y: Position and velocity, m and m/s.
        clock: Time, s from the epoch, or before it.
        used: How many lanes count.
        forces: The environment.
        areas: Of each lane (2,): Cd A / m and Cr A / m, m^2/kg.
        thrust: Acceleration (3,) in the RTN axes of each craft's own orbit, m/s^2.
        room: (ROOM,) to work in.
        out: Where it goes.
    """
    found, Q = room[:_TURN], room[_TURN:_FIXED].reshape(3, 3, LANES)
    fixed, time, a = room[_FIXED:_TIME], room[_TIME], out[3:]
    for b in range(used):
        time[b] = forces.sense * clock[b]
    for i in range(3):
        for b in range(used):
            out[i, b], a[i, b] = y[3 + i, b], 0.0
    look_up(forces.sky, time, used, found)
    set_orientation(forces.sky, time, found, used, Q)
    turn(Q, y, used, fixed)
    sums(forces.field, fixed, used, room[_FIELD:].reshape(spherical_harmonics.ROOM * LANES), fixed)
    add_turned_back(Q, fixed, used, a)
    if forces.sun_mu > 0:
        add_third_body(y, found[SUN:], forces.sun_mu, used, a)
    if forces.moon_mu > 0:
        add_third_body(y, found[MOON:], forces.moon_mu, used, a)
    if forces.sunlight:
        add_radiation(y, found[SUN:], forces.radius, areas[1], used, a)
    if len(forces.air.bases) > 0:
        add_layered_drag(y, forces.air, forces.radius, forces.rotation, areas[0], used, a)
    add_thrust(y, used, thrust, a)


@inner
def set_longest(forces: FieldForces, aim: float, y: Array, used: int, out: Array) -> None:
    """Set out (LANES,) to how long a step from states y (6, LANES) may be, s, by how rough the field can be there.

    The error estimate alone would double steps over smooth regions and reject them at the next mountains, and
    neighbours would not take the same steps. None is longer than a day.
    """
    for b in range(used):
        x, y_, z, vx, vy, vz = y[0, b], y[1, b], y[2, b], y[3, b], y[4, b], y[5, b]
        r2 = x * x + y_ * y_ + z * z
        q, rough = min(forces.radius * forces.radius / r2, 1.0), 0.0
        for k in range(len(forces.roughness) - 1, -1, -1):
            rough = q * (forces.roughness[k] + rough)
        error = CIRCULAR_ERROR * (1 + q * q * rough)
        hx, hy, hz = y_ * vz - z * vy, z * vx - x * vz, x * vy - y_ * vx
        radian = r2 / math.sqrt(hx * hx + hy * hy + hz * hz)  # s
        out[b] = min(radian * (aim / error) ** (1 / 7), DAY_S)


@inner
def set_longest_by_shadow(
    forces: FieldForces, states: Array, areas: Array, times: Array, rows: Integers, used: int, room: Array, out: Array
) -> None:
    """Set out (LANES,) to how long a step may be, s, by where the Earth's shadow is; infinity without sunlight.

    The penumbra is passed in seconds. The error estimate may miss it in a long step, which then may be wrong by more
    than what sunlight does to one craft relative to another that is alike.

    Args:
        forces: The environment.
        states: Of n orbits (n, 6), m and m/s.
        areas: Cd A / m and Cr A / m (n, 2), m^2/kg.
        times: (n,), s, as the clock of `derivative`.
        rows: Which orbits are in the lanes (LANES,).
        used: How many lanes count.
        room: (ROOM,) to work in.
        out: Where it goes.
    """
    found, time = room[:_TURN], room[_TIME]
    for b in range(used):
        time[b], out[b] = forces.sense * times[rows[b]], math.inf
    if forces.sunlight:
        look_up(forces.sky, time, used, found)
        for b in range(used):
            if areas[rows[b], 1] > 0:
                out[b] = longest_by_shadow(states, rows[b], found[SUN:], b, forces.mu, forces.radius)


@kernel(FIELD_FORCES, given(2), given(2), given(1))
def acceleration(forces: FieldForces, states: Array, areas: Array, times: Array) -> Array:
    """Return the acceleration (n, 3) of craft that do not thrust, m/s^2.

    Args:
        forces: The environment.
        states: (n, 6), m and m/s.
        areas: Cd A / m and Cr A / m (n, 2), m^2/kg.
        times: (n,), s from the epoch.
    """
    n = len(states)
    found = np.empty((n, 3))
    y, room, out, of_lanes = np.ones((6, LANES)), np.empty((ROOM, LANES)), np.empty((6, LANES)), np.zeros((2, LANES))
    clock, idle = np.empty(LANES), np.zeros((3, LANES))
    for first in range(0, n, LANES):
        used = min(LANES, n - first)
        load_vectors(states, first, used, y)
        load_vectors(areas, first, used, of_lanes)
        for b in range(used):
            clock[b] = times[first + b]
        derivative(y, clock, used, forces, of_lanes, idle, room, out)
        store_vectors(out[3:], first, used, found)
    return found
