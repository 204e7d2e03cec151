"""Orbits of a batch on their way, every one at its own time and with its own step.

An orbit's steps follow from its own state, its own error estimate and rtol, so that its bits never depend on which
others share the batch. Speed comes from sharing nonetheless. All orbits advance in the same array expressions, and
steps come from a coarse grid (a base with one of eight mantissas, times a power of two, starting at multiples of
itself), so that similar orbits take the same steps and their output is one stacked matrix product.

Where an orbit's thrust changes, its step ends: the step is cut there, the velocity changes, and a new grid begins.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.astro.frames import inertial_from_own
from relnav_sim.truth import dop853
from relnav_sim.truth.dop853 import Craft
from relnav_sim.truth.forces import ForceModel
from relnav_sim.truth.surface import first_below
from relnav_sim.truth.thrust import Schedule

# Times are counted in ticks of 2^-24 base steps; an orbit that needs shorter steps is falling into a singularity.
FINEST = 24
# Steps may grow to 2^16 base steps: an escaping orbit needs ever longer ones.
COARSEST = FINEST + 16
# The error estimate of a step of s seconds on a circular orbit is (s n)^7 times this, measured; aim at half of rtol.
CIRCULAR_ERROR = 9.5e-6
AIM = 0.5
# The estimate per unit time grows with the seventh power of the step.
ERROR_RATIO_OF_DOUBLING = 2.0**7

# OpenBLAS rounds the rows of an incomplete tile differently on some processors (measured on its Haswell, Nehalem and
# Prescott kernels): with rows in multiples of 8, a time's bits do not depend on its neighbours. Up to 512 rows a
# product never goes to several threads.
TILE = 8
LONGEST_PRODUCT = 512


class Ending(NamedTuple):
    """The time in s from which on an orbit could not be continued, and why: words that follow *it*."""

    time_s: float
    why: str


@dataclass(frozen=True)
class Segments:
    """One accepted step of some orbits: rows (n,) of the batch; start, end, length (n,) in s; terms (n, 8, 6)."""

    rows: Integers
    start_s: Array
    end_s: Array
    step_s: Array
    terms: Array

    @cached_property
    def until_s(self) -> float:
        """The time that the last of them reaches, s."""
        return float(self.end_s.max())

    def write(self, times: Array, states: Array) -> None:
        """Write the states at the times within the segments into `states` (rows, T, 6).

        Up to seven later times of the same rows are overwritten, so segments must be written in order of time.
        """
        key = np.stack([self.start_s, self.end_s, self.step_s])
        if (key == key[:, :1]).all():
            self._write_group(slice(None), key[:, 0], times, states)
            return
        groups, member = np.unique(key, axis=1, return_inverse=True)
        for i, group in enumerate(groups.T):
            self._write_group(np.flatnonzero(member == i), group, times, states)

    def _write_group(self, which: slice | Integers, group: Array, times: Array, states: Array) -> None:
        """Write the segments `which`, which all have the same start and length."""
        start, end, step = group
        first, last = np.searchsorted(times, [start, end])
        rows, terms = self.rows[which], self.terms[which]
        together = rows[-1] - rows[0] == len(rows) - 1
        for begin in range(first, last, LONGEST_PRODUCT):
            count = min(last - begin, LONGEST_PRODUCT)
            padded = -(-count // TILE) * TILE
            weights = np.zeros((padded, dop853.COEFFICIENTS))
            weights[:count] = dop853.weights((times[begin : begin + count] - start) / step)
            if together and begin + padded <= len(times):
                np.matmul(weights, terms, out=states[rows[0] : rows[-1] + 1, begin : begin + padded])
            else:
                states[rows, begin : begin + count] = np.matmul(weights, terms)[:, :count]


class Batch:
    """Some orbits on their way: components first (6, n), every orbit at its own time.

    Attributes:
        failures: Where an orbit could not be continued, by its row.
    """

    def __init__(
        self,
        state0: Array,
        force: ForceModel,
        ballistic: Array,
        rtol: float,
        kept_bytes: int,
        schedule: Schedule | None = None,
        surface_m: float | None = None,
    ) -> None:
        self._surface_m = surface_m
        self._state0 = np.ascontiguousarray(state0.T)
        self._force = force
        self._ballistic = np.ascontiguousarray(ballistic)
        self._rtol = rtol
        self._everyone = np.arange(len(state0))
        self._kept_bytes = kept_bytes
        self._schedule = schedule
        self._restart()

    def _restart(self) -> None:
        n = len(self._everyone)
        self._states = self._state0.copy()
        self._carry = np.zeros_like(self._states)
        self._slope = np.empty_like(self._states)
        self._thrust = np.zeros((3, n))
        self._origin_s, self._base_s = np.zeros(n), np.empty(n)
        self._ticks, self._level = np.zeros((2, n), dtype=np.int64)
        self._event = np.zeros(n, dtype=np.int64)
        with np.errstate(all="ignore"):
            self._begin_grid(self._everyone)
            below = _radius(self._states) < (0.0 if self._surface_m is None else self._surface_m)
        self._failed = np.zeros(n, dtype=bool)
        self.failures: dict[int, Ending] = {}
        # A state so large or small that its own scale overflows has no step at all.
        unscaled = ~((self._base_s > 0) & np.isfinite(self._base_s))
        self._end(np.flatnonzero(unscaled), 0.0, "has too large or too small a state to be integrated")
        self._end(np.flatnonzero(below), 0.0, "starts below the surface")
        self._segments: deque[Segments] = deque()
        self._kept = 0
        self._forgotten_s = 0.0

    def write(self, times: Array, states: Array) -> None:
        """Write the states at the times into `states` (n, T, 6)."""
        if times[0] < self._forgotten_s:
            self._restart()
        for segments in self._segments:
            if segments.until_s > times[0]:
                segments.write(times, states)
        workspace = np.empty(dop853.ALL_STAGES * self._state0.size)
        while len(rows := self._behind(times[-1])):
            # A step into a singularity overflows; its error is then no number, and it is rejected.
            with np.errstate(all="ignore"):
                advanced = self._advance(rows, workspace)
            if advanced is not None:
                advanced.write(times, states)
                self._segments.append(advanced)
                self._kept += advanced.terms.nbytes
                self._forget(times[-1])
        for row, ending in self.failures.items():
            states[row, np.searchsorted(times, ending.time_s) :] = np.nan

    def _behind(self, time_s: float) -> Integers:
        """Return the rows to advance: those whose segments do not cover the time yet, the hindmost first.

        Waiting for the others keeps the segments in order of time, so that old ones can be forgotten.
        """
        reached = self._time(self._ticks, self._everyone)
        behind = np.flatnonzero((reached <= time_s) & ~self._failed)
        if not len(behind):
            return behind
        next_end = (reached[behind] + np.ldexp(self._base_s[behind], self._level[behind] - FINEST)).min()
        hindmost: Integers = behind[reached[behind] <= next_end]
        return hindmost

    def _time(self, ticks: Integers, rows: Integers) -> Array:
        # The product is exact: the base has four significant bits, so a double holds it up to 2^49 ticks (3e7 base
        # steps). A sum with the same origin and ticks rounds alike, so that one step ends where the next begins.
        time_s: Array = self._origin_s[rows] + np.ldexp(self._base_s[rows], -FINEST) * ticks
        return time_s

    def _craft(self, rows: Integers) -> Craft:
        thrust = _take(self._thrust, rows)
        return Craft(self._ballistic[rows], thrust if thrust.any() else None)

    def _begin_grid(self, rows: Integers) -> None:
        """Begin a new grid of steps for the rows where their origins are, from their states."""
        states = _take(self._states, rows)
        base_s, doublings = base_step(states, self._force.mu_m3_s2, self._rtol)
        self._base_s[rows], self._level[rows], self._ticks[rows] = base_s, doublings + FINEST, 0
        slope = np.empty_like(states)
        dop853.derivative(self._force, states, self._craft(rows), slope)
        self._slope[:, rows] = slope

    def _next_event(self, rows: Integers) -> Array:
        """Return when the thrust of the rows changes next, s; infinity where it never does."""
        assert self._schedule is not None  # or no one would ask
        times = self._schedule.times_s
        left = self._event[rows] < times.shape[1]
        return np.where(left, times[rows, np.where(left, self._event[rows], 0)], np.inf)

    def _manoeuvre(self, rows: Integers) -> None:
        """Change the velocity and the thrust of rows that have reached their next event, and begin a new grid."""
        assert self._schedule is not None  # as above
        now = self._next_event(rows)
        self._origin_s[rows] = now
        while len(due := rows[self._next_event(rows) <= self._origin_s[rows]]):
            event = self._event[due]
            states = _take(self._states, due)
            kicks = np.ascontiguousarray(self._schedule.kicks[due, event].T)
            self._states[3:, due] += inertial_from_own(states, kicks)
            self._thrust[:, due] = self._schedule.accelerations[due, event].T
            self._event[due] += 1
        self._begin_grid(rows)

    def _advance(self, rows: Integers, workspace: Array) -> Segments | None:
        """Attempt one step of the rows; return the segments of those for which it succeeds.

        Args:
            rows: (n,) rows of the batch, in order.
            workspace: Room for the stages of all rows.
        """
        states, carry, slope = (_take(a, rows) for a in (self._states, self._carry, self._slope))
        craft, ticks, level = self._craft(rows), self._ticks[rows], self._level[rows]
        step_s = np.ldexp(self._base_s[rows], level - FINEST)
        start_s, end_s = self._time(ticks, rows), self._time(ticks + (np.int64(1) << level), rows)
        cut = np.zeros(len(rows), dtype=bool)
        if self._schedule is not None:
            event_s = self._next_event(rows)
            cut = end_s >= event_s
            step_s, end_s = np.where(cut, event_s - start_s, step_s), np.where(cut, event_s, end_s)
        stages = workspace[: dop853.ALL_STAGES * states.size].reshape(dop853.ALL_STAGES, *states.shape)
        stages[0] = slope
        increment, error = dop853.attempt(self._force, states, craft, step_s, stages)
        ends, carry = _add(states, increment + carry)
        good = np.flatnonzero((error <= self._rtol) & np.isfinite(ends).all(axis=0))
        if len(good) < len(rows):
            self._halve(np.delete(rows, good))
            if not len(good):
                return None
            states, ends, carry, stages = (_take(a, good) for a in (states, ends, carry, stages))
            rows, start_s, end_s, step_s = rows[good], start_s[good], end_s[good], step_s[good]
            ticks, level, error, cut = ticks[good], level[good], error[good], cut[good]
            craft = self._craft(rows)
        terms = dop853.interpolant(self._force, states, ends, craft, step_s, stages)
        self._states[:, rows], self._carry[:, rows] = ends, carry
        self._slope[:, rows] = stages[dop853.STAGES]
        ticks = ticks + (np.int64(1) << level)
        # A double step must start at a multiple of itself, or orbits would drift apart on the grid.
        aligned = ticks & ((np.int64(2) << level) - 1) == 0
        grows = aligned & (error * ERROR_RATIO_OF_DOUBLING <= AIM * self._rtol) & (level < COARSEST)
        self._ticks[rows], self._level[rows] = ticks, level + grows
        if cut.any():
            self._manoeuvre(rows[cut])
        if self._surface_m is not None:
            fraction = first_below(terms, self._surface_m)
            down = np.flatnonzero(np.isfinite(fraction))
            self._end(rows[down], (start_s + fraction * step_s)[down], "goes below the surface")
        return Segments(rows, start_s, end_s, step_s, terms)

    def _halve(self, rows: Integers) -> None:
        self._level[rows] -= 1
        stuck = rows[self._level[rows] < 0]
        self._end(stuck, self._time(self._ticks[stuck], stuck), "falls into the centre, or into another singularity")

    def _end(self, rows: Integers, times_s: Array | float, why: str) -> None:
        """Give the rows up at the times, (rows,) or one for all."""
        self._failed[rows] = True
        ends = np.broadcast_to(times_s, rows.shape).tolist()
        self.failures |= {row: Ending(end, why) for row, end in zip(rows.tolist(), ends, strict=True)}

    def _forget(self, time_s: float) -> None:
        """Drop the oldest segments that end before the time while there are more than the kept bytes."""
        while self._kept > self._kept_bytes and (oldest := self._segments[0]).until_s <= time_s:
            self._forgotten_s = max(self._forgotten_s, oldest.until_s)
            self._kept -= oldest.terms.nbytes
            self._segments.popleft()


def base_step(states: Array, mu: float, rtol: float) -> tuple[Array, Integers]:
    """Return the base step (n,) in s of states (6, n), and by how many doublings (n,) to start above it.

    The base guesses the longest step at perigee, rounded down to four significant bits. There the error is made, so
    there the step must follow rtol closely; elsewhere doubling and halving are fine enough.
    """
    x, y, z, vx, vy, vz = states
    r = _radius(states)
    speed2 = vx * vx + vy * vy + vz * vz
    radial = x * vx + y * vy + z * vz
    momentum2 = np.maximum(r * r * speed2 - radial * radial, 0.0)
    eccentricity = np.sqrt(np.maximum(1 + (speed2 - 2 * mu / r) * momentum2 / (mu * mu), 0.0))
    # A fall straight to the centre has its perigee there; an orbit's step must start from something.
    perigee = np.maximum(momentum2 / (mu * (1 + eccentricity)), r / 64)
    radian_s = np.sqrt(perigee * perigee * perigee / (mu * (1 + eccentricity)))
    guess = radian_s * (AIM * rtol / CIRCULAR_ERROR) ** (1 / 7)
    mantissa, exponent = np.frexp(guess)
    base_s = np.ldexp(np.floor(16 * mantissa) / 16, exponent)
    _, doublings = np.frexp(np.sqrt(r * r * r / mu) / radian_s)
    return base_s, np.maximum(doublings.astype(np.int64) - 1, 0)


def _radius(states: Array) -> Array:
    x, y, z = states[:3]
    radius: Array = np.sqrt(x * x + y * y + z * z)
    return radius


def _take(array: Array, rows: Integers) -> Array:
    """Return the rows of the last axis in C order, which fancy indexing would not give.

    The loop that einsum picks depends on the order in memory, and may round differently.
    """
    return array if len(rows) == array.shape[-1] else np.take(array, rows, axis=-1)


def _add(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the rounded sum and its rounding error (Knuth, TAOCP 2, 4.2.2, theorem B).

    Carrying the error into the next step keeps the rounding of thousands of steps from adding up.
    """
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)
