"""Thrust as it happens: manoeuvres with their execution errors, and what they do in each step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.streams import RandomSource
from relnav_sim.truth.manoeuvres import ExecutionErrors, ManoeuvreOptions

CRAFT = ("chief", "deputy")
EARLIEST_S = 1e-3
"""No timing error brings a manoeuvre before this: at the start the state is the given one."""


@dataclass(frozen=True)
class Thrust:
    """One manoeuvre in b runs, or in the plan (b = 1).

    Attributes:
        craft: 0 the chief, 1 the deputy.
        start_s: When it begins, (b,), s.
        duration_s: How long it lasts, s; 0 for an impulse.
        delta_v: Change of velocity (b, 3), m/s, in the craft's own RTN axes, which turn during a burn.
    """

    craft: int
    start_s: Array
    duration_s: float
    delta_v: Array

    @property
    def end_s(self) -> Array:
        """When it ends, (b,), s."""
        return self.start_s + self.duration_s


@dataclass(frozen=True)
class Schedule:
    """When the thrust of some orbits changes; each row in order of time, padded with infinity.

    Attributes:
        times_s: (rows, events).
        kicks: Change of velocity at that instant, (rows, events, 3), own RTN, m/s.
        accelerations: Acceleration from then on until the next, (rows, events, 3), own RTN, m/s^2.
    """

    times_s: Array
    kicks: Array
    accelerations: Array

    def rows(self, which: slice) -> Schedule:
        """Return the schedule of some of the orbits."""
        return Schedule(self.times_s[which], self.kicks[which], self.accelerations[which])


def planned(options: ManoeuvreOptions) -> Thrust:
    """Return a manoeuvre as planned."""
    return Thrust(
        CRAFT.index(options.craft), np.array([options.time_s]), options.duration_s or 0.0, options.delta_v[None]
    )


def executed(name: str, options: ManoeuvreOptions, errors: ExecutionErrors, source: RandomSource, runs: int) -> Thrust:
    """Return a manoeuvre as carried out in each run; magnitude, direction and timing have a stream each."""
    plan, stream = planned(options), f"truth.manoeuvre.{name}"
    start_s, delta_v = np.repeat(plan.start_s, runs), np.repeat(plan.delta_v, runs, axis=0)
    if errors.direction_sigma_deg:
        angles = radians(errors.direction_sigma_deg) * source.streams(f"{stream}.direction").normal(2)
        delta_v = _turned(plan.delta_v[0], angles)
    if errors.magnitude_sigma_percent:
        draws = source.streams(f"{stream}.magnitude").normal(1)
        delta_v = delta_v * np.maximum(1 + errors.magnitude_sigma_percent / 100 * draws, 0.0)
    if errors.timing_sigma_s:
        late = errors.timing_sigma_s * source.streams(f"{stream}.timing").normal(1)[:, 0]
        start_s = np.maximum(start_s + late, EARLIEST_S)
    return Thrust(plan.craft, start_s, plan.duration_s, delta_v)


def _turned(vector: Array, angles: Array) -> Array:
    """Return the vector (3,) turned by angles (runs, 2), rad, about two axes across it, (runs, 3)."""
    size = np.linalg.norm(vector)
    along = vector / size
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    a, b = angles[:, :1], angles[:, 1:]
    angle = np.sqrt(a * a + b * b)
    turned: Array = size * (np.cos(angle) * along + np.sinc(angle / np.pi) * (a * first + b * second))
    return turned


def schedule(thrusts: Sequence[Thrust], runs: int) -> Schedule:
    """Return what happens to 2 x `runs` orbits, the chiefs first, then the deputies."""
    counts = [sum(2 if thrust.duration_s else 1 for thrust in thrusts if thrust.craft == craft) for craft in (0, 1)]
    shape = (2, runs, max(counts))
    times, kicks, accelerations = np.full(shape, np.inf), np.zeros((*shape, 3)), np.zeros((*shape, 3))
    place = [0, 0]
    for thrust in thrusts:
        own, k = thrust.craft, place[thrust.craft]
        times[own, :, k] = thrust.start_s
        if thrust.duration_s:
            times[own, :, k + 1] = thrust.end_s
        else:
            kicks[own, :, k] = thrust.delta_v
        place[own] += 2 if thrust.duration_s else 1
    order = np.argsort(times, axis=-1, kind="stable")
    times, kicks = np.take_along_axis(times, order, -1), np.take_along_axis(kicks, order[..., None], -2)
    for thrust in thrusts:
        if thrust.duration_s:
            event = times[thrust.craft]
            burning = (event >= thrust.start_s[:, None]) & (event < thrust.end_s[:, None])
            accelerations[thrust.craft] += np.where(
                burning[..., None], thrust.delta_v[:, None] / thrust.duration_s, 0.0
            )
    rows = 2 * runs
    return Schedule(times.reshape(rows, -1), kicks.reshape(rows, -1, 3), accelerations.reshape(rows, -1, 3))


def step_forces(thrust: Thrust, times_s: Array, step_s: float) -> Array:
    """Return what a manoeuvre does in the steps that end at some epochs, (b, K, 2, 3), m/s^2, own RTN.

    Two means of the specific force f over the step: the plain one, which times the step is the change of velocity; and
    the one weighted with the time that is left, 2 / step^2 times the integral of (end - t) f, which times step^2 / 2
    is the change of position. A constant force has both alike. What happens at an epoch belongs to the step before.

    Args:
        thrust: The manoeuvre in b runs.
        times_s: Epochs (K,), s.
        step_s: Time between epochs, s.
    """
    start, end = thrust.start_s[:, None], thrust.end_s[:, None]
    if thrust.duration_s:
        left_first = np.clip(times_s - start, 0.0, step_s)
        left_last = np.clip(times_s - end, 0.0, step_s)
        plain = (left_first - left_last) / (thrust.duration_s * step_s)
        weighted = (left_first**2 - left_last**2) / (thrust.duration_s * step_s**2)
    else:
        left = times_s - start
        inside = (left >= 0) & (left < step_s)
        plain = np.where(inside, 1 / step_s, 0.0)
        weighted = np.where(inside, 2 * left / step_s**2, 0.0)
    shares = np.stack([plain, weighted], axis=-1)
    forces: Array = shares[..., None] * thrust.delta_v[:, None, None]
    return forces


def thrusts_of(
    manoeuvres: Mapping[str, ManoeuvreOptions], common: ExecutionErrors, source: RandomSource, runs: int
) -> list[Thrust]:
    """Return all manoeuvres as carried out in the runs of `source`, or as planned alike in all where nothing varies."""
    return [executed(name, each, each.errors or common, source, runs) for name, each in manoeuvres.items()]
