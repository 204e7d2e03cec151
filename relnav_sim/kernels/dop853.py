"""One step of the Dormand-Prince 8(5,3) pair for up to `LANES` orbits, each with its own step size.

Method and dense output: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.5,
II.6 and II.10.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels import dop853_tableau as tableau
from relnav_sim.kernels.compiling import inner
from relnav_sim.kernels.forces import Forces, derivative
from relnav_sim.kernels.lanes import LANES

STAGES = 12
ALL_STAGES = 16
"""The 12, the derivative at the end of the step, and three that only the dense output needs."""
TERMS = 8
"""Of the dense output: the state and seven more."""


def _weights(rows: list[tableau.Row]) -> Array:
    weights = np.zeros((len(rows), ALL_STAGES))
    for full, row in zip(weights, rows, strict=True):
        full[list(row)] = list(row.values())
    return weights


A = _weights([tableau.STAGE_ROWS.get(stage, {}) for stage in range(ALL_STAGES)])
# The weights of the end derivative are zero in these, so a rejected step never evaluates it.
B, E5, E3 = _weights([tableau.END_ROW, tableau.ERROR5_ROW, tableau.ERROR3_ROW])
D = _weights(list(tableau.DENSE_ROWS))


@inner
def weighted_sum(weights: Array, stages: Array, used: int, out: Array) -> None:
    """Set out (6,) to the sum of weights (16,) times stages (16, 6); those of weight zero are not looked at."""
    for c in range(6):
        for b in range(used):
            out[c, b] = weights[0] * stages[0, c, b]
    for s in range(1, ALL_STAGES):
        if weights[s] != 0:
            for c in range(6):
                for b in range(used):
                    out[c, b] += weights[s] * stages[s, c, b]


@inner
def stage(
    i: int, y: Array, h: Array, used: int, forces: Forces, ballistic: Array, thrust: Array, room: Array, stages: Array
) -> None:
    """Set stage i of stages (16, 6) from those before it, y (6,) being the states and h the steps."""
    at = room[6:]
    weighted_sum(A[i], stages, used, at)
    for c in range(6):
        for b in range(used):
            at[c, b] = y[c, b] + h[b] * at[c, b]
    derivative(at, used, forces, ballistic, thrust, room, stages[i])


@inner
def error_estimate(y: Array, used: int, mu: float, stages: Array, room: Array, error: Array) -> None:
    """Set the estimated error of a step, in units of the orbit's own size, per radian of a circular orbit.

    Position counts against |r|, velocity against the circular speed at |r|, time against sqrt(|r|^3 / mu). An error
    per unit time adds up to the same total whatever the step. The combination of both orders is that of Hairer et al.,
    section II.10.
    """
    fifth, third = room[:6], room[6:]
    weighted_sum(E5, stages, used, fifth)
    weighted_sum(E3, stages, used, third)
    for b in range(used):
        r2 = y[0, b] * y[0, b] + y[1, b] * y[1, b] + y[2, b] * y[2, b]
        speed2 = mu / math.sqrt(r2)
        e5 = (fifth[0, b] * fifth[0, b] + fifth[1, b] * fifth[1, b] + fifth[2, b] * fifth[2, b]) / r2
        e5 += (fifth[3, b] * fifth[3, b] + fifth[4, b] * fifth[4, b] + fifth[5, b] * fifth[5, b]) / speed2
        e3 = (third[0, b] * third[0, b] + third[1, b] * third[1, b] + third[2, b] * third[2, b]) / r2
        e3 += (third[3, b] * third[3, b] + third[4, b] * third[4, b] + third[5, b] * third[5, b]) / speed2
        estimate = e5 / math.sqrt(e5 + 0.01 * e3)
        error[b] = (0.0 if e5 == 0 else estimate) * math.sqrt(r2 / speed2)


@inner
def interpolant(y: Array, ends: Array, h: Array, used: int, stages: Array, terms: Array) -> None:
    """Set terms (8, 6) to the dense output of order 7 over a step from y to ends (6,), from all its stages.

    `evaluate` says what they mean.
    """
    for i in range(4, TERMS):
        weighted_sum(D[i - 4], stages, used, terms[i])
    for c in range(6):
        for b in range(used):
            change, begins = ends[c, b] - y[c, b], h[b] * stages[0, c, b]
            terms[0, c, b], terms[1, c, b] = y[c, b], change
            terms[2, c, b] = begins - change
            terms[3, c, b] = 2 * change - (h[b] * stages[STAGES, c, b] + begins)
            for i in range(4, TERMS):
                terms[i, c, b] *= h[b]


@inner
def evaluate(terms: Array, start: float, h: float, times: Array, first: int, last: int, room: Array, out: Array) -> None:
    """Write the states at times first to last, within a step of h from `start` on, into out (T, 6); terms (8, 6).

    Side by side lie times here, so that one orbit alone is as fast.
    """
    for begin in range(first, last, LANES):
        used = min(LANES, last - begin)
        s = room[6]
        for k in range(used):
            s[k] = (times[begin + k] - start) / h
        for c in range(6):
            t0, t1, t2, t3 = terms[0, c], terms[1, c], terms[2, c], terms[3, c]
            t4, t5, t6, t7 = terms[4, c], terms[5, c], terms[6, c], terms[7, c]
            for k in range(used):
                q = 1 - s[k]
                high = t4 + s[k] * (t5 + q * (t6 + s[k] * t7))
                room[c, k] = t0 + s[k] * (t1 + q * (t2 + s[k] * (t3 + q * high)))
        for k in range(used):
            for c in range(6):
                out[begin + k, c] = room[c, k]
