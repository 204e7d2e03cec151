"""How orbits and relative motion move over the steps of a filter that believes in a real gravity field."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.gravity_field import GravityField
from relnav_sim.astro.harmonic_series import derivatives, packed
from relnav_sim.dynamics.motion import Fixes
from relnav_sim.dynamics.relative_flow import Legs, Segment, divide, legs_for
from relnav_sim.kernels.field_paths import Field
from relnav_sim.kernels.spherical_harmonics import Series

REST_GRADIENT = 2e-9
"""Bound of the gradient of all but the point mass and J2 to J4, from 200 km altitude on and to degree 60, 1/s^2."""
REST_PRECISION = 2e-14
"""What the rest, held constant in the iteration, may leave of a relative state in a step, as a share of it."""


def about(field: GravityField, orbit: ChiefOrbit) -> ChiefOrbit:
    """Return an orbit with the constants of a field: its own mu and radius, and J2 to J4 as far as it has them."""
    J = {f"j{n}": -sqrt(2 * n + 1) * float(field.C[n, 0]) if n <= field.degree else 0.0 for n in (2, 3, 4)}
    return replace(orbit, mu_m3_s2=field.mu_m3_s2, equatorial_radius_m=field.radius_m, **J)


def others_than_zonals(field: GravityField) -> Series:
    """Return the acceleration by all harmonics but the point mass and J2 to J4, as kernels take it."""
    coefficients = field.C - 1j * field.S
    coefficients[[0, *range(2, min(field.degree, 4) + 1)], 0] = 0.0
    return packed(derivatives(coefficients), field.order + 1, field.mu_m3_s2 / field.radius_m**2, field.radius_m)


class FieldMotion:
    """Under a field that turns with the Earth as theory tells: UT1 - UTC and polar motion are taken as 0.

    Args:
        field: The field.
        orbit: The chief's nominal orbit with the field's constants (`about`).
        step_s: Time between epochs, s.
        epoch: Calendar time of epoch 0.
    """

    def __init__(self, field: GravityField, orbit: ChiefOrbit, step_s: float, epoch: Epoch) -> None:
        self.division = divide(orbit, step_s, field.degree)
        self._zonals = Gravity.of(orbit).field
        self._others = others_than_zonals(field)
        self._rounds = rounds_for(self.division.part_s)
        self._step_s, self._epoch, self._orientation = step_s, epoch, EarthOrientation()

    def walk(self, state: Array, epoch: int, steps: int) -> Array:
        """Return an orbit's states (|steps| + 1, 6) from one (6,) at an epoch on; steps < 0 lead back from it."""
        way = 1 if steps > 0 else -1
        begins = self._times(epoch + way * np.arange(abs(steps)))
        field = self._during(begins, way)
        return kernels.chief_orbit.walk_in_field(state, abs(steps), *self._rule, way * self.division.part_s, field)

    def legs(self, chief: Array, epoch: int) -> Legs:
        """Return what the chief does in the steps from its states (runs, K, 6), ECI, the first of them at an epoch."""
        begins = self._times(epoch + np.arange(chief.shape[1]))
        field, ends = self._during(begins), self._turns(begins[:, None] + np.array([0.0, self._step_s]))
        states = np.ascontiguousarray(chief.swapaxes(0, 1), dtype=float)
        frames, nodes = kernels.chief_orbit.legs_in_field(states, *self._rule, self.division.part_s, field, ends)
        return Legs(frames, nodes, field.turns)

    def follow(self, fixes: Fixes, epoch: int, mean: Array, P: Array, Q: Array, R: Array) -> tuple[Array, Array]:
        """Return the estimates (runs, K, 6) of an orbit by fixes, and the covariance (runs, 6, 6) of the last ones."""
        begins = self._times(epoch - 1 + np.arange(fixes.readings.shape[1]))
        seen = fixes.readings, fixes.before, fixes.after, fixes.started
        return kernels.chief_orbit.follow_in_field(
            *seen, mean, P, Q, R, *self._rule, self.division.part_s, self._during(begins)
        )

    def flow(self, states: Array, segment: Segment) -> Array:
        """Return RTN states (runs, ..., 6) after one step."""
        points = np.ascontiguousarray(states, dtype=float).reshape(-1, 6)
        return kernels.relative_flow.flow_in_field(points, *self._step(len(states), segment)).reshape(states.shape)

    def linear_flow(self, mean: Array, segment: Segment) -> tuple[Array, Array]:
        """Return `flow` at `mean` (runs, 6), bit by bit, and its Jacobian (runs, 6, 6) under point mass and J2 to J4.

        The gradients of the other harmonics are left out of the Jacobian: up to 2e-10 1/s^2 to degree 20 at 500 km, and
        `REST_GRADIENT` at worst, beside 2.4e-6 of the point mass.
        """
        points = np.ascontiguousarray(mean, dtype=float)
        return kernels.relative_flow.linear_flow_in_field(points, *self._step(len(mean), segment))

    def _step(self, runs: int, segment: Segment) -> tuple[Array, Array, int, Array, int, float, Field]:
        legs, place = legs_for(runs, segment)
        assert legs.turns is not None  # they come from `legs`
        rule = self.division.rule
        return legs.frames, legs.nodes, place, rule.tableau, rule.sweeps, self.division.part_s, self._field(legs.turns)

    def _during(self, begins_s: Array, way: int = 1) -> Field:
        """Return the field during the steps that begin at times (K,), and go on or, way -1, back from there."""
        return self._field(self._turns(begins_s[:, None] + way * self.division.node_times_s.ravel()))

    def _field(self, turns: Array) -> Field:
        return Field(self._zonals, self._others, turns, len(self.division.rule.nodes), self._rounds)

    def _times(self, epochs: Indices) -> Array:
        return np.asarray(epochs * self._step_s, dtype=np.float64)

    def _turns(self, times_s: Array) -> Array:
        """Return the rotations from ECI to the field's axes at times (...), (..., 3, 3)."""
        matrices, _ = self._orientation.matrices(times_s.ravel(), self._epoch)
        return matrices.reshape(*times_s.shape, 3, 3)

    @property
    def _rule(self) -> tuple[Array, int, int]:
        rule = self.division.rule
        return rule.tableau, rule.sweeps, self.division.parts


def rounds_for(part_s: float) -> int:
    """Return how often the rest of the field is evaluated in a part of a step.

    What is left in the relative state is h^2 / 2 times the rest's gradient, and that share of itself with each round.
    """
    left = REST_GRADIENT * part_s**2 / 2
    rounds = 1
    while left ** (rounds + 1) > REST_PRECISION:
        rounds += 1
    return rounds
