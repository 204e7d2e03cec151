"""Exact relative motion over one step: out of the chief's turning frame, along both orbits, and back into it.

Between the epochs the relative motion is integrated in axes that do not turn, where nothing but the difference of
gravity acts: no Coriolis terms, no derivatives of the frame's rate, and an acceleration that depends on the position
alone. The frame enters at the ends of the step only.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.collocation import Rule, rule_for

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


def divide(orbit: ChiefOrbit, step_s: float, degree: int = 0) -> Division:
    """Return a division with a truncation of 1e-15 of the relative state, decided by the perigee of the nominal orbit.

    Relative motion grows at most at sqrt(2 mu / r^3), the rate of the gravity gradient along the radius. What
    harmonics of a degree n add to it changes n times a revolution.

    Args:
        orbit: The nominal orbit.
        step_s: Length of a step, s.
        degree: Of the gravity field, where it has more than zonal harmonics.
    """
    perigee = orbit.semi_major_axis_m * (1 - orbit.eccentricity)
    rate = sqrt(2 * orbit.mu_m3_s2 / perigee**3)
    parts = ceil(rate * step_s / LONGEST_TURN)
    return Division(rule_for(rate * step_s / parts, degree * rate * step_s / parts / sqrt(2)), parts, step_s / parts)


@dataclass(frozen=True)
class Legs:
    """What the chief does during K steps, each for b runs, or b = 1 where they share it.

    Attributes:
        frames: Its orbit frame at start and end, (K, b, 24), flat of (2, 4, 3): the unit vectors R, T and N in axes
            that do not turn, and the frame's rates about them, rad/s.
        nodes: The chief at the nodes in the same axes, (K, b, 6 s parts), flat of (parts, s, 2, 3): its position, m,
            and the acceleration there by what is no point mass, m/s^2. In a field that turns, (K, b, 9 s parts), flat
            of (parts, s, 3, 3): the last two are those by J2 to J4 and by the rest.
        turns: How such a field is turned at the nodes, (K, s parts, 3, 3).
    """

    frames: Array
    nodes: Array
    turns: Array | None = None


Segment = tuple[Legs, int]
"""One step among several: the legs, and its place in them."""


def flow(states: Array, segment: Segment, division: Division, gravity: Gravity) -> Array:
    """Return RTN states (runs, ..., 6) after one step."""
    points = np.ascontiguousarray(states, dtype=float).reshape(-1, 6)
    return kernels.relative_flow.flow(points, *_step(len(states), segment, division, gravity)).reshape(states.shape)


def linear_flow(mean: Array, segment: Segment, division: Division, gravity: Gravity) -> tuple[Array, Array]:
    """Return `flow` at `mean` (runs, 6), bit by bit, and its Jacobian (runs, 6, 6) by the variational equations."""
    points = np.ascontiguousarray(mean, dtype=float)
    return kernels.relative_flow.linear_flow(points, *_step(len(mean), segment, division, gravity))


def legs_for(runs: int, segment: Segment) -> Segment:
    """Return a step for states of so many runs.

    Raises:
        ValueError: It is of another number of runs.
    """
    legs, place = segment
    if legs.frames.shape[1] not in (1, runs):
        raise ValueError(f"there are states of {runs} runs, but the chief's of {legs.frames.shape[1]}")
    return legs, place


def _step(
    runs: int, segment: Segment, division: Division, gravity: Gravity
) -> tuple[Array, Array, int, Array, int, float, Array]:
    """Return what the kernels take of a step."""
    legs, place = legs_for(runs, segment)
    rule = division.rule
    return legs.frames, legs.nodes, place, rule.tableau, rule.sweeps, division.part_s, gravity.field
