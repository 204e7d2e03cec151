"""How orbits and relative motion move over the steps of a filter, by the gravity that it believes in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.relative_flow import Division, Legs, Segment, divide, flow, linear_flow


@dataclass(frozen=True)
class Fixes:
    """What an orbit filter sees in K steps.

    Attributes:
        readings: Position and velocity (runs, K, 6), ECI, m and m/s, NaN = none.
        before: Kicks where the steps begin, (runs or 1, K, 3), m/s, RTN; or K = 0: none at all.
        after: The same where they end.
        started: Whether a step leads to the first of them; else the prior is there.
    """

    readings: Array
    before: Array
    after: Array
    started: bool


class Motion(Protocol):
    """Moves states over the steps of a filter; the step to epoch k begins at epoch k - 1.

    Attributes:
        division: How a step is integrated.
    """

    division: Division

    def walk(self, state: Array, epoch: int, steps: int) -> Array:
        """Return an orbit's states (|steps| + 1, 6) from one (6,) at an epoch on; steps < 0 lead back from it."""
        ...

    def legs(self, chief: Array, epoch: int) -> Legs:
        """Return what the chief does in the steps from its states (runs, K, 6), ECI, the first of them at an epoch."""
        ...

    def follow(self, fixes: Fixes, epoch: int, mean: Array, P: Array, Q: Array, R: Array) -> tuple[Array, Array]:
        """Return the estimates (runs, K, 6) of an orbit by fixes, and the covariance (runs, 6, 6) of the last ones.

        Args:
            fixes: What is seen.
            epoch: Of the first fix.
            mean: The estimate before, (runs, 6).
            P: Its covariance (runs, 6, 6).
            Q: Process noise of a step (6, 6).
            R: Variances of a fix (6,).
        """
        ...

    def flow(self, states: Array, segment: Segment) -> Array:
        """Return RTN states (runs, ..., 6) after one step."""
        ...

    def linear_flow(self, mean: Array, segment: Segment) -> tuple[Array, Array]:
        """Return `flow` at `mean` (runs, 6), bit by bit, and its Jacobian (runs, 6, 6)."""
        ...


class ZonalMotion:
    """Under a point mass and zonal harmonics, which are the same at any time.

    Args:
        orbit: The chief's nominal orbit about the body; it decides how steps are integrated.
        step_s: Time between epochs, s.
    """

    def __init__(self, orbit: ChiefOrbit, step_s: float) -> None:
        self.division = divide(orbit, step_s)
        self._gravity = Gravity.of(orbit)

    def walk(self, state: Array, epoch: int, steps: int) -> Array:
        """Return an orbit's states (|steps| + 1, 6) from one (6,) at an epoch on; steps < 0 lead back from it."""
        part_s = self.division.part_s if steps > 0 else -self.division.part_s
        return kernels.chief_orbit.walk(state, abs(steps), *self._rule, part_s, self._gravity.field)

    def legs(self, chief: Array, epoch: int) -> Legs:
        """Return what the chief does in the steps from its states (runs, K, 6), ECI, the first of them at an epoch."""
        runs, K, _ = chief.shape
        states = np.ascontiguousarray(chief.swapaxes(0, 1), dtype=float).reshape(-1, 6)
        frames, nodes = kernels.chief_orbit.legs(states, *self._rule, self.division.part_s, self._gravity.field)
        return Legs(frames.reshape(K, runs, -1), nodes.reshape(K, runs, -1))

    def follow(self, fixes: Fixes, epoch: int, mean: Array, P: Array, Q: Array, R: Array) -> tuple[Array, Array]:
        """Return the estimates (runs, K, 6) of an orbit by fixes, and the covariance (runs, 6, 6) of the last ones."""
        seen = fixes.readings, fixes.before, fixes.after, fixes.started
        return kernels.chief_orbit.follow(*seen, mean, P, Q, R, *self._rule, self.division.part_s, self._gravity.field)

    def flow(self, states: Array, segment: Segment) -> Array:
        """Return RTN states (runs, ..., 6) after one step."""
        return flow(states, segment, self.division, self._gravity)

    def linear_flow(self, mean: Array, segment: Segment) -> tuple[Array, Array]:
        """Return `flow` at `mean` (runs, 6), bit by bit, and its Jacobian (runs, 6, 6) by the variational equations."""
        return linear_flow(mean, segment, self.division, self._gravity)

    @cached_property
    def _rule(self) -> tuple[Array, int, int]:
        rule = self.division.rule
        return rule.tableau, rule.sweeps, self.division.parts
