"""Exact relative motion over one step: out of the chief's turning frame, along both orbits, and back into it.

Between the epochs the relative motion is integrated in axes that do not turn, where nothing but the difference of
gravity acts: no Coriolis terms, no derivatives of the frame's rate, and an acceleration that depends on the position
alone. The frame enters at the ends of the step only.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.gravity import Anchor, Gravity
from relnav_sim.dynamics.collocation import Path, Rule, integrate, rule_for
from relnav_sim.linalg import product, runs_first, runs_last

LONGEST_TURN = 0.5
"""Step times the fastest rate of relative motion, rad, beyond which a step is divided."""


@dataclass(frozen=True)
class Division:
    """How a filter's step is integrated.

    Attributes:
        rule: The collocation rule of each part.
        parts: Number of equal parts.
        part_s: Length of a part, s.
    """

    rule: Rule
    parts: int
    part_s: float

    @property
    def node_times_s(self) -> Array:
        """Times of all nodes since the start of the step, (parts, s)."""
        times: Array = (np.arange(self.parts)[:, None] + self.rule.nodes) * self.part_s
        return times


def divide(orbit: ChiefOrbit, step_s: float) -> Division:
    """Return a division with a truncation of 1e-15 of the relative state, decided by the perigee of the nominal orbit.

    Relative motion grows at most at sqrt(2 mu / r^3), the rate of the gravity gradient along the radius.
    """
    perigee = orbit.semi_major_axis_m * (1 - orbit.eccentricity)
    rate = sqrt(2 * orbit.mu_m3_s2 / perigee**3)
    parts = ceil(rate * step_s / LONGEST_TURN)
    return Division(rule_for(rate * step_s / parts), parts, step_s / parts)


@dataclass(frozen=True)
class Segment:
    """What the chief does during one step; b is the number of runs, or 1 where they share it.

    Attributes:
        enter: From RTN at the start to relative states in the axes that do not turn, (6, 6, b).
        leave: From there to RTN at the end, (6, 6, b).
        nodes: The chief at the nodes, (parts, s, 3, b), in the same axes.

    Several segments are stacked along a leading axis of every array.
    """

    enter: Array
    leave: Array
    nodes: Anchor

    def __getitem__(self, place: int) -> Segment:
        """Return one of several segments."""
        return Segment(self.enter[place], self.leave[place], self.nodes[place])


def turning_frame(axes: Array, rates: Array) -> tuple[Array, Array]:
    """Return the matrices out of and into an orbit frame, both (6, 6, b).

    Args:
        axes: Its unit vectors R, T and N as rows, (3, 3, b).
        rates: Its angular velocity about R, T and N, (3, b), rad/s.
    """
    spin = np.zeros((3, 3, rates.shape[-1]))
    spin[0, 1], spin[0, 2], spin[1, 2] = -rates[2], rates[1], -rates[0]
    spin[1, 0], spin[2, 0], spin[2, 1] = rates[2], -rates[1], rates[0]
    out, into = np.zeros((6, 6, axes.shape[-1])), np.zeros((6, 6, axes.shape[-1]))
    back = axes.swapaxes(0, 1)
    out[:3, :3], out[3:, 3:] = back, back
    out[3:, :3] = product(back, spin)
    into[:3, :3], into[3:, 3:] = axes, axes
    into[3:, :3] = -product(spin, axes)
    return out, into


def flow(states: Array, segment: Segment, division: Division, gravity: Gravity) -> Array:
    """Return RTN states (runs, ..., 6) after one step."""
    X = product(segment.enter, runs_last(states.reshape(len(states), -1, 6).swapaxes(1, 2)))
    position, velocity = X[:3], X[3:]
    for part in range(division.parts):
        path = _offset_path(segment.nodes[part].for_columns(), position, velocity, division, gravity)
        position, velocity = path.position, path.velocity
    end = product(segment.leave, np.concatenate([position, velocity]))
    return runs_first(end).swapaxes(1, 2).reshape(states.shape)


def linear_flow(mean: Array, segment: Segment, division: Division, gravity: Gravity) -> tuple[Array, Array]:
    """Return `flow` at `mean` (runs, 6), bit by bit, and its Jacobian (runs, 6, 6) by the variational equations."""
    X = product(segment.enter, runs_last(mean)[:, None])
    position, velocity = X[:3, 0], X[3:, 0]
    Y = np.broadcast_to(segment.enter, (6, 6, len(mean)))
    for part in range(division.parts):
        chief = segment.nodes[part]
        path = _offset_path(chief, position, velocity, division, gravity)
        Y = tangent(Y, gravity.gradient(chief.position + path.nodes), division)
        position, velocity = path.position, path.velocity
    end = product(segment.leave, np.concatenate([position, velocity])[:, None])
    return runs_first(end[:, 0]), runs_first(product(segment.leave, Y))


def _offset_path(chief: Anchor, position: Array, velocity: Array, division: Division, gravity: Gravity) -> Path:
    """Return how the deputy moves relative to the chief in one part of a step, in axes that do not turn."""
    return integrate(
        division.rule, lambda offset: gravity.difference(chief, offset), position, velocity, division.part_s
    )


def tangent(Y: Array, gradient: Array, division: Division) -> Array:
    """Return Y (6, p, runs) after one part of a step, Y'' = G Y with G (3, 3, s, runs) at the nodes."""
    s, runs = gradient.shape[2:]
    G = gradient.reshape(3, 3, -1)

    def slope(nodes: Array) -> Array:
        columns = nodes.transpose(1, 2, 0, 3).reshape(3, -1, s * runs)
        return product(G, columns).reshape(3, -1, s, runs).transpose(2, 0, 1, 3)

    path = integrate(division.rule, slope, Y[:3], Y[3:], division.part_s)
    return np.concatenate([path.position, path.velocity])
