"""A spacecraft's own orbit over one step, in inertial axes, and the orbit frame it carries."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.collocation import integrate
from relnav_sim.dynamics.relative_flow import Division, tangent


def advance_orbit(state: Array, division: Division, gravity: Gravity) -> tuple[Array, Array]:
    """Return the state (6, b) after one step, and the positions at the nodes on the way, (parts, s, 3, b)."""
    position, velocity = state[:3], state[3:]
    nodes = []
    for _ in range(division.parts):
        path = integrate(division.rule, gravity.acceleration, position, velocity, division.part_s)
        position, velocity = path.position, path.velocity
        nodes.append(path.nodes)
    return np.concatenate([position, velocity]), np.stack(nodes)


def orbit_transition(nodes: Array, division: Division, gravity: Gravity) -> Array:
    """Return the derivatives of `advance_orbit` by its state, (6, 6, b), from the positions at the nodes."""
    Y = np.broadcast_to(np.eye(6)[..., None], (6, 6, nodes.shape[-1]))
    for part in nodes:
        Y = tangent(Y, gravity.gradient(part), division)
    return Y


def orbit_frame(state: Array, gravity: Gravity) -> tuple[Array, Array]:
    """Return the unit vectors R, T, N as rows (3, 3, b) and the frame's rates about them (3, b), rad/s.

    Besides h / r^2 about N the frame turns at r a_N / h about R, a_N being the acceleration along the normal.
    """
    r, v = state[:3], state[3:]
    h = _cross(r, v)
    distance, momentum = np.sqrt(_dot(r, r)), np.sqrt(_dot(h, h))
    R, N = r / distance, h / momentum
    tilt = distance * _dot(gravity.acceleration(r[None])[0], N) / momentum
    axes = np.stack([R, _cross(N, R), N])
    return axes, np.stack([tilt, np.zeros_like(tilt), momentum / (distance * distance)])


def _dot(a: Array, b: Array) -> Array:
    total: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return total


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
