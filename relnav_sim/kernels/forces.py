"""What moves a spacecraft, each force a function over lanes that sets or adds to an acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number, record, written
from relnav_sim.kernels.elementary import exp
from relnav_sim.kernels.gravity import pull
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


class Forces(NamedTuple):
    """The environment, alike for all craft.

    Attributes:
        mu: Gravitational parameter, m^3/s^2.
        radius: Equatorial radius, m; the zonal harmonics and the altitude refer to it.
        J: Unnormalised J_2, J_3, ..., (k,).
        density: Of the air at the base altitude, kg/m^3; 0 for no drag.
        base: Base altitude, m.
        scale_height: Altitude over which the density falls by the factor e, m.
        rotation: Of the body and its air about z, rad/s.
    """

    mu: float
    radius: float
    J: Array
    density: float
    base: float
    scale_height: float
    rotation: float


FORCES = record(Forces, number, number, written(1), number, number, number, number)
ROOM = 6
"""Rows of lanes that the forces need to work in."""


@inner
def derivative(
    y: Array, clock: Array, used: int, forces: Forces, areas: Array, thrust: Array, room: Array, out: Array
) -> None:
    """Set out (6,) to the derivative of states y (6,): the velocity, and the sum of all forces.

    Args:
        y: Position and velocity, m and m/s.
        clock: Time, s; these forces don't change with it.
        used: How many lanes count.
        forces: The environment.
        areas: Of each lane (1,) or more: Cd A / m, m^2/kg.
        thrust: Acceleration (3,) in the RTN axes of each craft's own orbit, m/s^2.
        room: (ROOM,) to work in.
        out: Where it goes.
    """
    for i in range(3):
        for b in range(LANES):
            out[i, b] = y[3 + i, b]
    a = out[3:]
    pull(y, forces.mu, forces.radius, forces.J, room, a)
    if forces.density > 0:
        add_drag(y, forces, areas[0], a)
    add_thrust(y, used, thrust, a)


@inner
def set_longest(forces: Forces, aim: float, y: Array, used: int, out: Array) -> None:
    """Set out (LANES,) to how long a step from states y (6, LANES) may be, s: the error estimate alone decides."""
    for b in range(used):
        out[b] = math.inf


@inner
def add_drag(y: Array, forces: Forces, ballistic: Array, a: Array) -> None:
    """Add -1/2 Cd A/m rho |u| u, u being the velocity past air that turns with the body (Vallado, section 8.6)."""
    for b in range(LANES):
        r = math.sqrt(y[0, b] * y[0, b] + y[1, b] * y[1, b] + y[2, b] * y[2, b])
        density = forces.density * exp((forces.base - (r - forces.radius)) / forces.scale_height)
        x, y_, vx, vy, vz = y[0, b], y[1, b], y[3, b], y[4, b], y[5, b]
        ux, uy = vx + forces.rotation * y_, vy - forces.rotation * x
        k = -0.5 * ballistic[b] * density * math.sqrt(ux * ux + uy * uy + vz * vz)
        a[0, b] += k * ux
        a[1, b] += k * uy
        a[2, b] += k * vz


@inner
def add_thrust(y: Array, used: int, thrust: Array, a: Array) -> None:
    """Add the thrust of each lane, turned from the craft's own RTN axes: R along r, N along r x v, T = N x R."""
    # Most often there is none. Asked in the second loop alone, it would be worked out and then left.
    burns = False
    for b in range(used):
        burns |= thrust[0, b] != 0 or thrust[1, b] != 0 or thrust[2, b] != 0
    if not burns:
        return
    for b in range(used):
        if thrust[0, b] != 0 or thrust[1, b] != 0 or thrust[2, b] != 0:
            x, y_, z, vx, vy, vz = y[0, b], y[1, b], y[2, b], y[3, b], y[4, b], y[5, b]
            nx, ny, nz = y_ * vz - z * vy, z * vx - x * vz, x * vy - y_ * vx
            tx, ty, tz = ny * z - nz * y_, nz * x - nx * z, nx * y_ - ny * x
            radial = thrust[0, b] / math.sqrt(x * x + y_ * y_ + z * z)
            along = thrust[1, b] / math.sqrt(tx * tx + ty * ty + tz * tz)
            normal = thrust[2, b] / math.sqrt(nx * nx + ny * ny + nz * nz)
            a[0, b] += radial * x + along * tx + normal * nx
            a[1, b] += radial * y_ + along * ty + normal * ny
            a[2, b] += radial * z + along * tz + normal * nz


@kernel(FORCES, given(2), given(1))
def acceleration(forces: Forces, states: Array, ballistic: Array) -> Array:
    """Return the acceleration (n, 3) of craft that do not thrust, m/s^2, from states (n, 6) and Cd A / m (n,)."""
    n = len(states)
    found = np.empty((n, 3))
    y, room, out, areas = np.empty((6, LANES)), np.empty((ROOM, LANES)), np.empty((6, LANES)), np.empty((1, LANES))
    clock, idle = np.empty(LANES), np.zeros((3, LANES))
    for first in range(0, n, LANES):
        used = min(LANES, n - first)
        load_vectors(states, first, used, y)
        for b in range(used):
            areas[0, b] = ballistic[first + b]
        derivative(y, clock, used, forces, areas, idle, room, out)
        store_vectors(out[3:], first, used, found)
    return found
