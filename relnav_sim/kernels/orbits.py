"""Orbits on their way, each at its own time and with its own step, up to `LANES` of them side by side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels.compiling import given, inner, integer, kernel, number, written
from relnav_sim.kernels.dop853 import (
    ALL_STAGES,
    STAGES,
    TERMS,
    B,
    error_estimate,
    evaluate,
    interpolant,
    stage,
    weighted_sum,
)
from relnav_sim.kernels.forces import FORCES, Forces, derivative
from relnav_sim.kernels.lanes import LANES

FINEST = -24
"""Times are counted in ticks of 2^FINEST base steps; an orbit that needs shorter steps falls into a singularity."""
COARSEST = 16
"""Steps may grow to 2^COARSEST base steps: an escaping orbit needs ever longer ones."""
ERROR_RATIO_OF_DOUBLING = 2.0**7
"""The estimate per unit time grows with the seventh power of the step."""

FLIES, EVENT_DUE, NEAR_SURFACE, STUCK, ENDED = range(5)
"""What a flight is doing. Only one that flies goes on; of the others its owner has to decide."""


class Flights(NamedTuple):
    """Where n orbits are, and their last `kept` steps.

    Attributes:
        states: (n, 6) at time `reached`, m and m/s.
        carry: Rounding errors of the states (n, 6), to be added to the next step.
        slope: Derivative of the states (n, 6).
        ballistic: Cd A / m, (n,), m^2/kg.
        thrust: Acceleration (n, 3) in the RTN axes of each craft's own orbit, m/s^2.
        reached: Time (n,), s.
        event: Time (n,) at which the thrust changes next, s; infinity for never.
        origin: Time (n,) at which the grid of steps begins, s.
        base: Base step of the grid (n,), s, with few significant bits.
        ticks: Ticks (n,) since the origin.
        level: The next step is 2^level (n,) base steps.
        doing: (n,), one of `FLIES` to `ENDED`.
        steps: Number of steps taken, (n,).
        terms: Dense output of the last steps (n, kept, 8, 6); step i is in place i modulo kept.
        spans: Their starts, ends and lengths, (n, kept, 3), s.
    """

    states: Array
    carry: Array
    slope: Array
    ballistic: Array
    thrust: Array
    reached: Array
    event: Array
    origin: Array
    base: Array
    ticks: Integers
    level: Integers
    doing: Integers
    steps: Integers
    terms: Array
    spans: Array


_OF_FLIGHTS = [written(2), written(2), written(2), written(1), written(2)] + [written(1)] * 4
FLIGHTS = types.NamedTuple([*_OF_FLIGHTS, *[written(1, integer)] * 4, written(4), written(3)], Flights)


@kernel(FORCES, FLIGHTS, number, number, number, given(1), written(1, integer), written(3))
def fly(
    forces: Forces,
    flights: Flights,
    rtol: float,
    aim: float,
    surface: float,
    times: Array,
    place: Integers,
    out: Array,
) -> None:
    """Let the flights go on until they are past the last of the times, or something else than a step is due.

    Args:
        forces: The environment.
        flights: n orbits; brought up to date.
        rtol: Largest error of a step, as `error_estimate` counts it.
        aim: The next step may be longer if its error is expected to stay below this.
        surface: A flight stops after a step that may have come nearer to the centre than this, m.
        times: (T,), s, increasing.
        place: For each flight, the first time that is not written yet, (n,); brought up to date.
        out: States (n, T, 6) at the times.
    """
    n, T = len(flights.states), len(times)
    row = np.empty(LANES, dtype=np.int64)
    y, carry, ends, thrust = np.empty((6, LANES)), np.empty((6, LANES)), np.empty((6, LANES)), np.empty((3, LANES))
    h, until, ballistic, error = np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    stages, terms, room = np.empty((ALL_STAGES, 6, LANES)), np.empty((TERMS, 6, LANES)), np.empty((12, LANES))
    used = waiting = 0
    while True:
        # Whoever has arrived makes room for the next.
        b = 0
        while b < used or (used < LANES and waiting < n):
            if b < used and goes_on(flights, row[b], place, T):
                b += 1
            elif waiting < n:
                recall(flights, waiting, flights.terms.shape[1], times, place, room, out)
                row[b] = waiting
                used = max(used, b + 1)
                waiting += 1
            else:
                used -= 1
                row[b] = row[used]
        if used == 0:
            break
        for b in range(used):
            i = row[b]
            for c in range(6):
                y[c, b], carry[c, b], stages[0, c, b] = flights.states[i, c], flights.carry[i, c], flights.slope[i, c]
            for c in range(3):
                thrust[c, b] = flights.thrust[i, c]
            ballistic[b] = flights.ballistic[i]
            until[b], h[b] = next_step(flights, i)
        for s in range(1, STAGES):
            stage(s, y, h, used, forces, ballistic, thrust, room, stages)
        weighted_sum(B, stages, used, ends)
        for c in range(6):
            for b in range(used):
                step = h[b] * ends[c, b] + carry[c, b]
                # The rounded sum and its rounding error (Knuth, TAOCP 2, 4.2.2, theorem B). Carrying that into the
                # next step keeps the rounding of thousands of steps from adding up.
                total = y[c, b] + step
                part = total - y[c, b]
                carry[c, b] = (y[c, b] - (total - part)) + (step - part)
                ends[c, b] = total
        error_estimate(y, used, forces.mu, stages, room, error)
        good = False
        for b in range(used):
            if not error[b] <= rtol or not finite(ends, b):
                error[b] = math.inf
            else:
                good = True
        if good:
            derivative(ends, used, forces, ballistic, thrust, room, stages[STAGES])
            for s in range(STAGES + 1, ALL_STAGES):
                stage(s, y, h, used, forces, ballistic, thrust, room, stages)
            interpolant(y, ends, h, used, stages, terms)
        for b in range(used):
            i = row[b]
            if error[b] <= rtol:
                accept(flights, i, b, ends, carry, stages[STAGES], until[b], h[b], terms)
                resize(flights, i, error[b], aim)
                if not clears(terms, b, surface):
                    flights.doing[i] = NEAR_SURFACE
                recall(flights, i, 1, times, place, room, out)
            else:
                flights.level[i] -= 1
                if flights.level[i] < FINEST:
                    flights.doing[i] = STUCK


@inner
def goes_on(flights: Flights, i: int, place: Integers, T: int) -> bool:
    """Return whether flight i has another step to take, and note where an event is due instead."""
    if place[i] == T or flights.doing[i] != FLIES:
        return False
    if flights.reached[i] >= flights.event[i]:
        flights.doing[i] = EVENT_DUE
    return flights.doing[i] == FLIES


@inner
def next_step(flights: Flights, i: int) -> tuple[float, float]:
    """Return where the next step of flight i ends, and its length, s.

    The product with the ticks is exact: the base has four significant bits, so a double holds it up to 2^49 ticks (3e7
    base steps). A sum with the same origin and ticks rounds alike, so that one step ends where the next begins.
    """
    ticks = flights.ticks[i] + (1 << (flights.level[i] - FINEST))
    until = flights.origin[i] + math.ldexp(flights.base[i], FINEST) * ticks
    if until >= flights.event[i]:
        return flights.event[i], flights.event[i] - flights.reached[i]
    return until, math.ldexp(flights.base[i], flights.level[i])


@inner
def finite(ends: Array, b: int) -> bool:
    """Return whether all of lane b is."""
    found = True
    for c in range(6):
        found &= math.isfinite(ends[c, b])
    return found


@inner
def accept(
    flights: Flights, i: int, b: int, ends: Array, carry: Array, slope: Array, until: float, h: float, terms: Array
) -> None:
    """Bring flight i to the end of the step that lane b has taken, and keep its dense output."""
    kept = flights.steps[i] % flights.terms.shape[1]
    for c in range(6):
        flights.states[i, c], flights.carry[i, c], flights.slope[i, c] = ends[c, b], carry[c, b], slope[c, b]
    for t in range(TERMS):
        for c in range(6):
            flights.terms[i, kept, t, c] = terms[t, c, b]
    flights.spans[i, kept, 0], flights.spans[i, kept, 1], flights.spans[i, kept, 2] = flights.reached[i], until, h
    flights.reached[i] = until
    flights.steps[i] += 1


@inner
def resize(flights: Flights, i: int, error: float, aim: float) -> None:
    """Count the ticks of the step that flight i has taken, and double the next one if the error allows.

    A double step must start at a multiple of itself, or orbits would drift apart on the grid.
    """
    level = flights.level[i]
    flights.ticks[i] += 1 << (level - FINEST)
    aligned = flights.ticks[i] & ((2 << (level - FINEST)) - 1) == 0
    if aligned and error * ERROR_RATIO_OF_DOUBLING <= aim and level < COARSEST:
        flights.level[i] += 1


@inner
def clears(terms: Array, b: int, surface: float) -> bool:
    """Return whether lane b is above the surface throughout its step, for certain.

    The chord's ends are r0 and r1 from the centre, so that it comes no nearer than sqrt(min(r0, r1)^2 - chord^2 / 4).
    The other terms of the dense output have weights of at most 1/4.
    """
    start2 = end2 = chord2 = bend = 0.0
    for c in range(3):
        start, chord = terms[0, c, b], terms[1, c, b]
        start2 += start * start
        chord2 += chord * chord
        end2 += (start + chord) * (start + chord)
    for t in range(2, TERMS):
        bend += math.sqrt(terms[t, 0, b] ** 2 + terms[t, 1, b] ** 2 + terms[t, 2, b] ** 2) / 4
    return math.sqrt(max(min(start2, end2) - chord2 / 4, 0.0)) - bend >= surface


@inner
def recall(flights: Flights, i: int, last_steps: int, times: Array, place: Integers, room: Array, out: Array) -> None:
    """Write the states of flight i at the times, from its place on, that lie within its last steps."""
    T = len(times)
    for step in range(max(flights.steps[i] - last_steps, 0), flights.steps[i]):
        first, at = place[i], step % flights.terms.shape[1]
        if first == T:
            break
        if times[first] < flights.spans[i, at, 1]:
            last = first + 1
            while last < T and times[last] < flights.spans[i, at, 1]:
                last += 1
            start, h = flights.spans[i, at, 0], flights.spans[i, at, 2]
            evaluate(flights.terms[i, at], start, h, times, first, last, room, out[i])
            place[i] = last
