"""One step of the Dormand-Prince 8(5,3) pair for a batch of orbits, each with its own step size.

Method and dense output: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.5,
II.6 and II.10. Arrays have components first and orbits last, (6, n); sums over stages go through plain einsum, whose
inner loop runs along components and orbits. Each orbit is then computed by the same roundings whatever the batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import inertial_from_own
from relnav_sim.truth import tableau
from relnav_sim.truth.forces import ForceModel

STAGES = 12
ALL_STAGES = 16  # the 12, the derivative at the end of the step, and three that only the dense output needs
COEFFICIENTS = 8  # of the dense output: the state and seven terms


def _dense_row(row: tableau.Row, length: int) -> Array:
    weights = np.zeros(length)
    weights[list(row)] = list(row.values())
    return weights


STAGE_WEIGHTS = {stage: _dense_row(row, stage) for stage, row in tableau.STAGE_ROWS.items()}
END_WEIGHTS = _dense_row(tableau.END_ROW, STAGES)
# The weights of the end derivative are zero, so a rejected step never evaluates it.
ERROR_WEIGHTS = np.array([_dense_row(row, STAGES) for row in (tableau.ERROR5_ROW, tableau.ERROR3_ROW)])
DENSE_WEIGHTS = np.array([_dense_row(row, ALL_STAGES) for row in tableau.DENSE_ROWS])


@dataclass(frozen=True)
class Craft:
    """What moves n craft besides gravity.

    Attributes:
        ballistic: Cd A / m, (n,), m^2/kg.
        thrust: Acceleration (3, n) in the RTN axes of each craft's own orbit, m/s^2; None where no one thrusts.
    """

    ballistic: Array
    thrust: Array | None = None


def derivative(force: ForceModel, states: Array, craft: Craft, out: Array) -> None:
    """Write d/dt of states (6, n) into `out` (6, n)."""
    out[:3] = states[3:]
    force.accelerate(states, craft.ballistic, out[3:])
    if craft.thrust is not None:
        out[3:] += inertial_from_own(states, craft.thrust)


def attempt(force: ForceModel, states: Array, craft: Craft, step_s: Array, stages: Array) -> tuple[Array, Array]:
    """Take one step of each orbit and estimate its error.

    Args:
        force: The force model.
        states: (6, n) at the start of the step.
        craft: What moves them besides gravity.
        step_s: (n,) step of each orbit, s.
        stages: (16, 6, n); stage 0 holds the derivative at the start, the stages up to 11 are written.

    Returns:
        The increments of the states (6, n), and the estimated error (n,) in units of the orbit's own size: position
        against |r|, velocity against the circular speed at |r|, per sqrt(|r|^3 / mu) of time (a radian of a circular
        orbit). An error per unit time adds up to the same total whatever the step.
    """
    for i in range(1, STAGES):
        at_stage = states + step_s * _sum(STAGE_WEIGHTS[i], stages[:i])
        derivative(force, at_stage, craft, stages[i])
    increment = step_s * _sum(END_WEIGHTS, stages[:STAGES])

    errors = np.einsum("es,scn->ecn", ERROR_WEIGHTS, stages[:STAGES])
    r2 = states[0] * states[0] + states[1] * states[1] + states[2] * states[2]
    speed2 = force.mu_m3_s2 / np.sqrt(r2)
    fifth, third = (
        (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) / r2 + (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]) / speed2
        for e in errors
    )
    # The combination of Hairer et al., section II.10; an exact step has 0 / 0.
    estimate = np.where(fifth == 0, 0.0, fifth / np.sqrt(fifth + 0.01 * third))
    return increment, estimate * np.sqrt(r2 / speed2)


def interpolant(force: ForceModel, states: Array, ends: Array, craft: Craft, step_s: Array, stages: Array) -> Array:
    """Return the dense output of order 7 over an accepted step, (n, 8, 6); `weights` says how to evaluate it.

    Args:
        force: The force model.
        states: (6, n) at the start of the step.
        ends: (6, n) at its end.
        craft: What moves them besides gravity.
        step_s: (n,) step of each orbit, s.
        stages: (16, 6, n) as `attempt` left them; the rest is written, stage 12 with the derivative at the end.
    """
    derivative(force, ends, craft, stages[STAGES])
    for i in range(STAGES + 1, ALL_STAGES):
        at_stage = states + step_s * _sum(STAGE_WEIGHTS[i], stages[:i])
        derivative(force, at_stage, craft, stages[i])
    terms = np.empty((COEFFICIENTS, *states.shape))
    change = ends - states
    start_slope = step_s * stages[0]
    terms[0] = states
    terms[1] = change
    terms[2] = start_slope - change
    terms[3] = 2 * change - (step_s * stages[STAGES] + start_slope)
    terms[4:] = step_s * np.einsum("ds,scn->dcn", DENSE_WEIGHTS, stages)
    return np.ascontiguousarray(terms.transpose(2, 0, 1))


def weights(fraction: Array) -> Array:
    """Return the weights (k, 8) of an interpolant's terms at fractions (k,) of the step, 0 at its start."""
    powers = np.empty((len(fraction), COEFFICIENTS))
    powers[:, 0] = 1.0
    powers[:, 1] = fraction
    rest = 1 - fraction
    for i in range(2, COEFFICIENTS):
        powers[:, i] = powers[:, i - 1] * (rest if i % 2 == 0 else fraction)
    return powers


def _sum(coefficients: Array, stages: Array) -> Array:
    total: Array = np.einsum("s,scn->cn", coefficients, stages)
    return total
