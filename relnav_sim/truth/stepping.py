"""Orbits of a batch on their way, every one at its own time and with its own step.

An orbit's steps follow from its own state, its own error estimate and rtol, so that its bits never depend on which
others share the batch. Steps come from a coarse grid (a base with one of eight mantissas, times a power of two,
starting at multiples of itself), so that neighbours take the same steps and their truncation errors are alike.
With sunlight, steps end before the Earth's shadow and are short in the penumbra, which each orbit meets in its time.

Where an orbit's thrust changes, its step ends: the step is cut there, the velocity changes, and a new grid begins.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers
from relnav_sim.astro.frames import inertial_from_own
from relnav_sim.kernels.dop853 import CIRCULAR_ERROR
from relnav_sim.kernels.sky import DAY_S
from relnav_sim.truth.forces import ForceModel
from relnav_sim.truth.surface import TERMS, first_below
from relnav_sim.truth.thrust import Schedule

AIM = 0.5
"""The share of rtol that a step's error estimate should have."""


class Ending(NamedTuple):
    """The time in s from which on an orbit could not be continued, and why: words that follow *it*."""

    time_s: float
    why: str


class Batch:
    """Some orbits on their way.

    Attributes:
        failures: Where an orbit could not be continued, by its row.
    """

    def __init__(
        self,
        state0: Array,
        force: ForceModel,
        ballistic: Array,
        radiation: Array,
        rtol: float,
        kept_steps: int,
        schedule: Schedule | None = None,
        surface_m: float | None = None,
        sense: float = 1.0,
    ) -> None:
        """Take states (n, 6), Cd A / m and Cr A / m (n,); each orbit's last `kept_steps` can be looked back to.

        Times are seconds after the force's epoch, or before it where `sense` is -1.
        """
        n = len(state0)
        self._state0, self._force, self._rtol, self._schedule = state0, force, rtol, schedule
        self._sense = sense
        self._surface_m = -np.inf if surface_m is None else surface_m
        self.failures: dict[int, Ending] = {}
        self._event = np.zeros(n, dtype=np.int64)
        self._flights = kernels.orbits.Flights(
            states=np.empty((n, 6)),
            carry=np.empty((n, 6)),
            slope=np.empty((n, 6)),
            areas=np.stack([ballistic, radiation], axis=1),
            thrust=np.empty((n, 3)),
            reached=np.empty(n),
            event=np.empty(n),
            origin=np.empty(n),
            base=np.empty(n),
            ticks=np.empty(n, dtype=np.int64),
            level=np.empty(n, dtype=np.int64),
            doing=np.empty(n, dtype=np.int64),
            steps=np.empty(n, dtype=np.int64),
            terms=np.empty((n, kept_steps, TERMS, 6)),
            spans=np.empty((n, kept_steps, 3)),
        )
        self._start(np.arange(n))

    def _start(self, rows: Integers) -> None:
        """Put the rows at their beginning."""
        flights = self._flights
        flights.states[rows] = self._state0[rows]
        for array in (flights.carry, flights.thrust, flights.reached, flights.steps, self._event):
            array[rows] = 0
        flights.doing[rows] = kernels.orbits.FLIES
        flights.event[rows] = self._next_event(rows)
        with np.errstate(all="ignore"):
            self._begin_grid(rows)
            below = rows[_radius(self._state0[rows]) < self._surface_m]
        # A state so large or small that its own scale overflows has no step at all.
        unscaled = rows[~((flights.base[rows] > 0) & np.isfinite(flights.base[rows]))]
        self._end(unscaled, 0.0, "has too large or too small a state to be integrated")
        self._end(below, 0.0, "starts below the surface")

    def write(self, times: Array, states: Array) -> None:
        """Write the states at the times (T,) into `states` (n, T, 6)."""
        flights, orbits = self._flights, kernels.orbits
        kept = flights.spans.shape[1]
        oldest = flights.spans[np.arange(len(flights.steps)), flights.steps % kept, 0]
        self._start(np.flatnonzero((flights.steps > kept) & (times[0] < oldest)))
        fly, place = self._fly_until(times[-1]), np.zeros(len(states), dtype=np.int64)
        flying = True
        while flying:
            fly(flights, self._rtol, AIM * self._rtol, self._surface_m, times, place, states)
            stuck = np.flatnonzero(flights.doing == orbits.STUCK)
            self._end(stuck, flights.reached[stuck], "falls into the centre, or into another singularity")
            near, due = (np.flatnonzero(flights.doing == what) for what in (orbits.NEAR_SURFACE, orbits.EVENT_DUE))
            self._look_at_surface(near)
            self._manoeuvre(due)
            flying = len(near) + len(due) > 0
        for row, ending in self.failures.items():
            states[row, np.searchsorted(times, ending.time_s) :] = np.nan

    def _fly_until(self, last_s: float) -> Callable[..., None]:
        """Return the kernel that lets flights go on, told of the forces until a time and some steps after it."""
        if self._force.is_plain:
            return partial(kernels.orbits.fly, self._force.plain)
        first, last = sorted((0.0, self._sense * last_s))
        return partial(kernels.orbits.fly_in_field, self._force.between(first, last, self._sense))

    def _begin_grid(self, rows: Integers) -> None:
        """Begin a new grid of steps for the rows where they are, from their states."""
        flights = self._flights
        states = flights.states[rows]
        flights.origin[rows], flights.ticks[rows] = flights.reached[rows], 0
        flights.base[rows], flights.level[rows] = base_step(states, self._force, self._rtol)
        ballistic, radiation = flights.areas[rows].T
        pull = self._force.acceleration(states, ballistic, self._sense * flights.reached[rows], radiation)
        slope = np.concatenate([states[:, 3:], pull], axis=1)
        thrust = flights.thrust[rows]
        burns = thrust.any(axis=1)
        slope[burns, 3:] += inertial_from_own(states[burns].T, thrust[burns].T).T
        flights.slope[rows] = slope

    def _next_event(self, rows: Integers) -> Array:
        """Return when the thrust of the rows changes next, s; infinity where it never does."""
        if self._schedule is None:
            return np.full(len(rows), np.inf)
        times = self._schedule.times_s
        left = self._event[rows] < times.shape[1]
        return np.where(left, times[rows, np.where(left, self._event[rows], 0)], np.inf)

    def _manoeuvre(self, rows: Integers) -> None:
        """Change the velocity and the thrust of rows that have reached their next event, and begin a new grid."""
        flights = self._flights
        while len(due := rows[self._next_event(rows) <= flights.reached[rows]]):
            assert self._schedule is not None  # or nothing would be due
            event = self._event[due]
            kicks = self._schedule.kicks[due, event]
            flights.states[due, 3:] += inertial_from_own(flights.states[due].T, kicks.T).T
            flights.thrust[due] = self._schedule.accelerations[due, event]
            self._event[due] += 1
        flights.event[rows] = self._next_event(rows)
        flights.doing[rows] = kernels.orbits.FLIES
        self._begin_grid(rows)

    def _look_at_surface(self, rows: Integers) -> None:
        """End the rows whose last step goes below the surface; the others go on."""
        flights = self._flights
        last = (flights.steps[rows] - 1) % flights.spans.shape[1]
        fraction = first_below(flights.terms[rows, last], self._surface_m)
        flights.doing[rows] = kernels.orbits.FLIES
        down = np.isfinite(fraction)
        start, _, length = flights.spans[rows, last][down].T
        self._end(rows[down], start + fraction[down] * length, "goes below the surface")

    def _end(self, rows: Integers, times_s: Array | float, why: str) -> None:
        """Give the rows up at the times, (rows,) or one for all."""
        self._flights.doing[rows] = kernels.orbits.ENDED
        ends = np.broadcast_to(times_s, rows.shape).tolist()
        self.failures |= {row: Ending(end, why) for row, end in zip(rows.tolist(), ends, strict=True)}


def base_step(states: Array, force: ForceModel, rtol: float) -> tuple[Array, Integers]:
    """Return the base step (n,) in s of states (n, 6), and by how many doublings (n,) to start above it.

    The base guesses the longest step at perigee, rounded down to four significant bits. There the error is made, so
    there the step must follow rtol closely; elsewhere doubling and halving are fine enough.
    """
    mu = force.mu_m3_s2
    x, y, z, vx, vy, vz = states.T
    r = _radius(states)
    speed2 = vx * vx + vy * vy + vz * vz
    radial = x * vx + y * vy + z * vz
    momentum2 = np.maximum(r * r * speed2 - radial * radial, 0.0)
    eccentricity = np.sqrt(np.maximum(1 + (speed2 - 2 * mu / r) * momentum2 / (mu * mu), 0.0))
    # A fall straight to the centre has its perigee there; an orbit's step must start from something.
    perigee = np.maximum(momentum2 / (mu * (1 + eccentricity)), r / 64)
    radian_s = np.sqrt(perigee * perigee * perigee / (mu * (1 + eccentricity)))
    most = AIM * rtol / CIRCULAR_ERROR
    if force.is_plain:
        guess, here = radian_s * most ** (1 / 7), np.sqrt(r * r * r / mu) / radian_s
    else:
        # The last step may begin when the sky is still known, and must not end more than a day later.
        guess = np.minimum(radian_s * (most / (1 + force.roughness(perigee))) ** (1 / 7), DAY_S)
        radian_here_s = r * r / np.sqrt(np.maximum(momentum2, np.finfo(float).tiny))
        here = np.minimum(radian_here_s * (most / (1 + force.roughness(r))) ** (1 / 7), DAY_S) / guess
    mantissa, exponent = np.frexp(guess)
    base_s = np.ldexp(np.floor(16 * mantissa) / 16, exponent)
    _, doublings = np.frexp(here)
    return base_s, np.maximum(doublings.astype(np.int64) - 1, 0)


def _radius(states: Array) -> Array:
    x, y, z = states.T[:3]
    radius: Array = np.sqrt(x * x + y * y + z * z)
    return radius
