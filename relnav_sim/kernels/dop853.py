"""One step of the Dormand-Prince 8(5,3) pair for up to `LANES` orbits, each with its own step size.

Method and dense output: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.5,
II.6 and II.10.

States, slopes and steps are flat here, the six components of all lanes one after the other, as most of the work is the
same for every component: component c of lane b is in place c LANES + b. What is in lanes that nobody uses doesn't
matter, and is computed all the same.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels import dop853_tableau as tableau
from relnav_sim.kernels.compiling import inner, short_for
from relnav_sim.kernels.lanes import LANES

STAGES = 12
ALL_STAGES = 16
"""The 12, the derivative at the end of the step, and three that only the dense output needs."""
TERMS = 8
"""Of the dense output: the state and seven more."""

CIRCULAR_ERROR = 9.5e-6
"""The estimate of a step of s seconds on a circular orbit is (s n)^7 times this, measured."""


def _weights(rows: list[tableau.Row]) -> Array:
    weights = np.zeros((len(rows), ALL_STAGES))
    for full, row in zip(weights, rows, strict=True):
        full[list(row)] = list(row.values())
    return weights


A = _weights([tableau.STAGE_ROWS.get(stage, {}) for stage in range(ALL_STAGES)])
NODES = A.sum(axis=1)
"""Where in the step each stage is."""
# The weights of the end derivative are zero in these, so a rejected step never evaluates it.
B, E5, E3 = _weights([tableau.END_ROW, tableau.ERROR5_ROW, tableau.ERROR3_ROW])
D = _weights(list(tableau.DENSE_ROWS))


@inner
def weighted_sum(weights: Array, stages: Array, out: Array) -> None:
    """Set out (6 LANES,) to weights (16,) times stages (16, 6 LANES); those of weight zero are not looked at."""
    for k in range(6 * LANES):
        out[k] = weights[0] * stages[0, k]
    for i in range(1, ALL_STAGES):
        if weights[i] != 0:
            for k in range(6 * LANES):
                out[k] += weights[i] * stages[i, k]


@short_for(weighted_sum)
def _weighted_sum(weights: Array, stages: Array, out: Array) -> None:
    known = np.flatnonzero(weights)
    np.matmul(weights[known], stages[known], out=out)


@inner
def stage_state(i: int, y: Array, h: Array, stages: Array, at: Array) -> None:
    """Set at (6 LANES,) to where stage i of stages (16, 6 LANES) is taken, from those before it, y and steps h."""
    weighted_sum(A[i], stages, at)
    for k in range(6 * LANES):
        at[k] = y[k] + h[k] * at[k]


@inner
def stage_time(i: int, start: Array, h: Array, clock: Array) -> None:
    """Set clock (LANES,) to when stage i is taken of steps that begin at the times `start` (LANES,), s."""
    for b in range(LANES):
        clock[b] = start[b] + NODES[i] * h[b]


@inner
def error_estimate(y: Array, mu: float, stages: Array, error: Array) -> None:
    """Set the estimated error of a step, in units of the orbit's own size, per radian of a circular orbit.

    Position counts against |r|, velocity against the circular speed at |r|, time against sqrt(|r|^3 / mu). An error
    per unit time adds up to the same total whatever the step. The combination of both orders is that of Hairer et al.,
    section II.10.
    """
    fifth, third = np.empty(6 * LANES), np.empty(6 * LANES)
    weighted_sum(E5, stages, fifth)
    weighted_sum(E3, stages, third)
    for b in range(LANES):
        r2 = length2(y, b)
        speed2 = mu / math.sqrt(r2)
        e5 = length2(fifth, b) / r2 + length2(fifth, 3 * LANES + b) / speed2
        e3 = length2(third, b) / r2 + length2(third, 3 * LANES + b) / speed2
        estimate = e5 / math.sqrt(e5 + 0.01 * e3)  # an exact step has 0 / 0
        error[b] = (0.0 if e5 == 0 else estimate) * math.sqrt(r2 / speed2)


@inner
def length2(vectors: Array, k: int) -> float:
    """Return the squared length of the vector that begins at place k."""
    x, y, z = vectors[k], vectors[LANES + k], vectors[2 * LANES + k]
    return x * x + y * y + z * z


@inner
def interpolant(y: Array, ends: Array, h: Array, stages: Array, terms: Array) -> None:
    """Set terms (8, 6 LANES) to the dense output of order 7 over a step from y to ends (6 LANES,), from all its stages.

    `evaluate` says what they mean.
    """
    for i in range(4, TERMS):
        weighted_sum(D[i - 4], stages, terms[i])
        for k in range(6 * LANES):
            terms[i, k] *= h[k]
    for k in range(6 * LANES):
        change, begins = ends[k] - y[k], h[k] * stages[0, k]
        terms[0, k], terms[1, k] = y[k], change
        terms[2, k] = begins - change
        terms[3, k] = 2 * change - (h[k] * stages[STAGES, k] + begins)


@inner
def evaluate(
    terms: Array, start: float, h: float, times: Array, first: int, last: int, room: Array, out: Array
) -> None:
    """Write the states at times first to last, within a step of h from `start` on, into out (T, 6); terms (8, 6).

    Side by side lie times here, in room (7, LANES), so that one orbit alone is as fast.
    """
    states, s = room[:6], room[6]
    for begin in range(first, last, LANES):
        used = min(LANES, last - begin)
        when, part = times[begin : begin + used], out[begin : begin + used]
        for k in range(used):
            s[k] = (when[k] - start) / h
        for c in range(6):
            t0, t1, t2, t3 = terms[0, c], terms[1, c], terms[2, c], terms[3, c]
            t4, t5, t6, t7 = terms[4, c], terms[5, c], terms[6, c], terms[7, c]
            for k in range(LANES):
                q = 1 - s[k]
                high = t4 + s[k] * (t5 + q * (t6 + s[k] * t7))
                states[c, k] = t0 + s[k] * (t1 + q * (t2 + s[k] * (t3 + q * high)))
        for k in range(used):
            for c in range(6):
                part[k, c] = states[c, k]


@short_for(evaluate)
def _evaluate(
    terms: Array, start: float, h: float, times: Array, first: int, last: int, room: Array, out: Array
) -> None:
    s = (times[first:last, None] - start) / h
    q = 1 - s
    high = terms[4] + s * (terms[5] + q * (terms[6] + s * terms[7]))
    out[first:last] = terms[0] + s * (terms[1] + q * (terms[2] + s * (terms[3] + q * high)))
