"""Orbits on their way, each at its own time and with its own step, up to `LANES` of them side by side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels import field_forces
from relnav_sim.kernels.compiling import given, inlined, inner, integer, kernel, kernel_like, number, record, written
from relnav_sim.kernels.dop853 import (
    ALL_STAGES,
    STAGES,
    TERMS,
    B,
    error_estimate,
    evaluate,
    interpolant,
    length2,
    stage_state,
    stage_time,
    weighted_sum,
)
from relnav_sim.kernels.field_forces import FIELD_FORCES, FieldForces, set_longest_by_shadow
from relnav_sim.kernels.forces import FORCES, ROOM, Forces, derivative, set_longest
from relnav_sim.kernels.lanes import LANES

FINEST = -24
"""Times are counted in ticks of 2^FINEST base steps; an orbit that needs shorter steps falls into a singularity."""
COARSEST = 16
"""Steps may grow to 2^COARSEST base steps: an escaping orbit needs ever longer ones."""
ERROR_RATIO_OF_DOUBLING = 2.0**7
"""The estimate per unit time grows with the seventh power of the step."""

SHADOW = False
"""Whether steps are to be short in the penumbra; they are in the kernel that takes this name for another value."""
SLACK = 1.5
"""A step is not halved for what is longest where it begins unless it is this many times as long."""

FLIES, EVENT_DUE, NEAR_SURFACE, STUCK, ENDED = range(5)
"""What a flight is doing. Only one that flies goes on; of the others its owner has to decide."""


class Flights(NamedTuple):
    """Where n orbits are, and their last `kept` steps.

    Attributes:
        states: (n, 6) at time `reached`, m and m/s.
        carry: Rounding errors of the states (n, 6), to be added to the next step.
        slope: Derivative of the states (n, 6).
        areas: Areas per mass (n, 2): Cd A / m for the air's drag and Cr A / m for sunlight, m^2/kg.
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
    areas: Array
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


_OF_FLIGHTS = [written(2)] * 5 + [written(1)] * 4
FLIGHTS = record(Flights, *_OF_FLIGHTS, *[written(1, integer)] * 4, written(4), written(3))


_FLY = FLIGHTS, number, number, number, given(1), written(1, integer), written(3)


@kernel(FORCES, *_FLY)
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
    row = np.empty(LANES, dtype=np.int64)
    stage_lanes, at_lanes = np.zeros((ALL_STAGES, 6, LANES)), np.empty((6, LANES))
    stages, at = stage_lanes.reshape(ALL_STAGES, 6 * LANES), at_lanes.reshape(6 * LANES)
    y, carry, h, ends_lanes = np.ones(6 * LANES), np.zeros(6 * LANES), np.zeros(6 * LANES), np.empty((6, LANES))
    ends, terms = ends_lanes.reshape(6 * LANES), np.empty((TERMS, 6 * LANES))
    until, now, error, clock = np.empty(LANES), np.zeros(LANES), np.empty(LANES), np.empty(LANES)
    areas, thrust, room = np.zeros((2, LANES)), np.zeros((3, LANES)), np.empty((ROOM, LANES))
    longest, line = np.empty(LANES), np.zeros((7, LANES))
    used = waiting = 0
    while True:
        used, waiting = seat(flights, row, used, waiting, times, place, line, out)
        if used == 0:
            break
        if SHADOW:
            set_longest_by_shadow(
                forces,  # type: ignore[arg-type]  # those that the kernel of fields is given
                flights.states,
                flights.areas,
                flights.reached,
                row,
                used,
                room,
                longest,
            )
            shorten(flights, row, used, longest)
        set_off(flights, row, used, y, carry, stages[0], h, until, now, areas, thrust)
        for s in range(1, STAGES):
            stage_state(s, y, h, stages, at)
            stage_time(s, now, h, clock)
            derivative(at_lanes, clock, used, forces, areas, thrust, room, stage_lanes[s])
        weighted_sum(B, stages, ends)
        for k in range(6 * LANES):
            step = h[k] * ends[k] + carry[k]
            # The rounded sum and its rounding error (Knuth, TAOCP 2, 4.2.2, theorem B). Carrying that into the next
            # step keeps the rounding of thousands of steps from adding up.
            ends[k] = y[k] + step
            part = ends[k] - y[k]
            carry[k] = (y[k] - (ends[k] - part)) + (step - part)
        error_estimate(y, forces.mu, stages, error)
        good = False
        for b in range(used):
            if not error[b] <= rtol or not finite(ends, b):
                error[b] = math.inf
            else:
                good = True
        if good:
            for k in range(6 * LANES):
                at[k] = ends[k]
            derivative(at_lanes, until, used, forces, areas, thrust, room, stage_lanes[STAGES])
            for s in range(STAGES + 1, ALL_STAGES):
                stage_state(s, y, h, stages, at)
                stage_time(s, now, h, clock)
                derivative(at_lanes, clock, used, forces, areas, thrust, room, stage_lanes[s])
            interpolant(y, ends, h, stages, terms)
        set_longest(forces, aim, ends_lanes, used, longest)
        arrive(flights, row, used, error, rtol, aim, longest, surface, ends, carry, stages[STAGES], until, h, terms)
        look_back(flights, row, used, times, place, line, out)


@kernel_like(
    fly,
    FIELD_FORCES,
    *_FLY,
    derivative=field_forces.derivative,
    set_longest=field_forces.set_longest,
    ROOM=field_forces.ROOM,
    SHADOW=True,
)
def fly_in_field(
    forces: FieldForces,
    flights: Flights,
    rtol: float,
    aim: float,
    surface: float,
    times: Array,
    place: Integers,
    out: Array,
) -> None:
    """Do as `fly` about the Earth as it is."""


@inner
def seat(
    flights: Flights, row: Integers, used: int, waiting: int, times: Array, place: Integers, line: Array, out: Array
) -> tuple[int, int]:
    """Give the lanes of those that have arrived to flights that wait; return how many are in use, and who waits next.

    The lanes in use are the first; `row` (LANES,) says which flight each has.
    """
    n, kept = len(flights.states), flights.terms.shape[1]
    b = 0
    while b < used or (used < LANES and waiting < n):
        if b < used and goes_on(flights, row[b], place, len(times)):
            b += 1
        elif waiting < n:
            recall(flights, waiting, kept, times, place, line, out)
            row[b] = waiting
            used = max(used, b + 1)
            waiting += 1
        else:
            used -= 1
            row[b] = row[used]
    return used, waiting


@inlined
def goes_on(flights: Flights, i: int, place: Integers, T: int) -> bool:
    """Return whether flight i has another step to take, and note where an event is due instead."""
    if place[i] == T or flights.doing[i] != FLIES:
        return False
    if flights.reached[i] >= flights.event[i]:
        flights.doing[i] = EVENT_DUE
    return flights.doing[i] == FLIES


@inner
def shorten(flights: Flights, row: Integers, used: int, longest: Array) -> None:
    """Halve the next steps of the flights in the lanes until they are not longer than `longest` (LANES,), s."""
    for b in range(used):
        i = row[b]
        while math.ldexp(flights.base[i], int(flights.level[i])) > longest[b] and flights.level[i] > FINEST:
            flights.level[i] -= 1


@inner
def set_off(
    flights: Flights,
    row: Integers,
    used: int,
    y: Array,
    carry: Array,
    slope: Array,
    h: Array,
    until: Array,
    now: Array,
    areas: Array,
    thrust: Array,
) -> None:
    """Take to the lanes where the flights' next steps begin, their lengths and ends, and what they need to know."""
    for b in range(used):
        i = row[b]
        until[b], step = next_step(flights, i)
        for c in range(6):
            k = c * LANES + b
            y[k], carry[k], slope[k], h[k] = flights.states[i, c], flights.carry[i, c], flights.slope[i, c], step
        for c in range(3):
            thrust[c, b] = flights.thrust[i, c]
        for c in range(2):
            areas[c, b] = flights.areas[i, c]
        now[b] = flights.reached[i]


@inlined
def next_step(flights: Flights, i: int) -> tuple[float, float]:
    """Return where the next step of flight i ends, and its length, s.

    The product with the ticks is exact: the base has four significant bits, so a double holds it up to 2^49 ticks (3e7
    base steps). A sum with the same origin and ticks rounds alike, so that one step ends where the next begins.
    """
    ticks = flights.ticks[i] + (1 << (flights.level[i] - FINEST))
    until = flights.origin[i] + math.ldexp(flights.base[i], FINEST) * ticks
    if until >= flights.event[i]:
        return flights.event[i], flights.event[i] - flights.reached[i]
    return until, math.ldexp(flights.base[i], int(flights.level[i]))


@inner
def finite(ends: Array, b: int) -> bool:
    """Return whether all of lane b is."""
    found = True
    for c in range(6):
        found &= math.isfinite(ends[c * LANES + b])
    return found


@inner
def arrive(
    flights: Flights,
    row: Integers,
    used: int,
    error: Array,
    rtol: float,
    aim: float,
    longest: Array,
    surface: float,
    ends: Array,
    carry: Array,
    slope: Array,
    until: Array,
    h: Array,
    terms: Array,
) -> None:
    """Bring the flights whose step is good to its end and choose the next one's length; the others try half of it."""
    for b in range(used):
        i = row[b]
        if error[b] <= rtol:
            accept(flights, i, b, ends, carry, slope, until[b], h[b], terms)
            resize(flights, i, error[b], aim, longest[b])
            if not clears(terms, b, surface):
                flights.doing[i] = NEAR_SURFACE
        else:
            flights.level[i] -= 1
            if flights.level[i] < FINEST:
                flights.doing[i] = STUCK


@inlined
def accept(
    flights: Flights, i: int, b: int, ends: Array, carry: Array, slope: Array, until: float, h: float, terms: Array
) -> None:
    """Bring flight i to the end of the step that lane b has taken, and keep its dense output."""
    kept = flights.steps[i] % flights.terms.shape[1]
    for c in range(6):
        k = c * LANES + b
        flights.states[i, c], flights.carry[i, c], flights.slope[i, c] = ends[k], carry[k], slope[k]
        for t in range(TERMS):
            flights.terms[i, kept, t, c] = terms[t, k]
    flights.spans[i, kept, 0], flights.spans[i, kept, 1], flights.spans[i, kept, 2] = flights.reached[i], until, h
    flights.reached[i] = until
    flights.steps[i] += 1


@inlined
def resize(flights: Flights, i: int, error: float, aim: float, longest: float) -> None:
    """Count the ticks of the step that flight i has taken, and double the next one if the error allows.

    A double step must start at a multiple of itself, or orbits would drift apart on the grid. None should be longer
    than `longest`, s.
    """
    level = flights.level[i]
    flights.ticks[i] += 1 << (level - FINEST)
    aligned = flights.ticks[i] & ((2 << (level - FINEST)) - 1) == 0
    step = math.ldexp(flights.base[i], int(level))
    if aligned and error * ERROR_RATIO_OF_DOUBLING <= aim and level < COARSEST and 2 * step <= longest:
        flights.level[i] += 1
    elif step > SLACK * longest and level > FINEST:
        flights.level[i] -= 1


@inner
def clears(terms: Array, b: int, surface: float) -> bool:
    """Return whether lane b is above the surface throughout its step, for certain.

    The chord's ends are r0 and r1 from the centre, so that it comes no nearer than sqrt(min(r0, r1)^2 - chord^2 / 4).
    The other terms of the dense output have weights of at most 1/4.
    """
    start2, chord2, bend, end2 = length2(terms[0], b), length2(terms[1], b), 0.0, 0.0
    for c in range(3):
        end2 += (terms[0, c * LANES + b] + terms[1, c * LANES + b]) ** 2
    for t in range(2, TERMS):
        bend += math.sqrt(length2(terms[t], b)) / 4
    return math.sqrt(max(min(start2, end2) - chord2 / 4, 0.0)) - bend >= surface


@inner
def look_back(
    flights: Flights, row: Integers, used: int, times: Array, place: Integers, line: Array, out: Array
) -> None:
    """Write the states of the lanes' flights at the times that lie within their last step, if not written yet."""
    for b in range(used):
        recall(flights, row[b], 1, times, place, line, out)


@inlined
def recall(flights: Flights, i: int, last_steps: int, times: Array, place: Integers, line: Array, out: Array) -> None:
    """Write the states of flight i at the times, from its place on, that lie within its last steps; line is room."""
    T, kept = len(times), flights.terms.shape[1]
    for step in range(max(flights.steps[i] - last_steps, 0), flights.steps[i]):
        first, at = place[i], step % kept
        if first == T:
            break
        if times[first] < flights.spans[i, at, 1]:
            last = first + 1
            while last < T and times[last] < flights.spans[i, at, 1]:
                last += 1
            start, h = flights.spans[i, at, 0], flights.spans[i, at, 2]
            evaluate(flights.terms[i, at], start, h, times, first, last, line, out[i])
            place[i] = last
