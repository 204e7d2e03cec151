"""Damped Gauss-Newton search for every run of a block: the engine of the iterated and the two-step filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array, Mask
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.filters.square_root import Whitener
from relnav_sim.linalg import SINGLE
from relnav_sim.measurements.interface import Measurement

# Armijo's condition: accept a step that brings this part of the decrease which its slope promises
# (Nocedal and Wright, Numerical Optimization, 2006, section 3.1).
_SUFFICIENT = 1e-4
_HALVINGS = 12
# Near the minimum a step changes the cost by less than its rounding, which the scale of z / sigma sets; a rise
# that small is accepted, as it is worth less than 1e-4 of a standard deviation.
_COST_ROUNDING = 1e-9


class IterationOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the filters that search the maximum of the posterior."""

    max_iterations: int = Field(
        default=20,
        ge=1,
        description="Most Gauss-Newton steps of an update; default 20: tracking takes 1 or 2, a prior as wide as the "
        "range 4 to 8; 1 gives the extended Kalman filter's mean wherever that lowers the cost",
    )
    tolerance: float = Field(
        default=1e-8,
        gt=0,
        description="A run stops when its next step is, or will be at the rate of the last two, shorter than this, in "
        "standard deviations of the posterior; in float32 3.5e-4, the root of its unit of rounding, or what the "
        "rounding of measurements is worth, where that is more",
    )


@dataclass(frozen=True)
class CostDigits:
    """What rounding leaves of a cost |W d|^2 + |U r|^2 and of its steps.

    In a vicinity of the minimum that is s standard deviations of the posterior wide, the cost rises by s^2. A cost that
    is rounded by eps of itself therefore tells nothing nearer than sqrt(eps), however the steps go on.

    Attributes:
        tolerance: Length of a step, in those standard deviations, at which a run stops, (runs,) or one for all.
        readings: Rounding of U r in all, (runs,): what the measurements of a state jitter by.
        deviations: The same of W d, as a share of its own length.
    """

    tolerance: float | Array
    readings: float | Array = 0.0
    deviations: float | Array = 0.0

    def rise(self, cost: Array) -> Array:
        """Return by how much a cost (runs,) may seem to rise and be lower."""
        rise: Array = _COST_ROUNDING * (1 + cost)
        if isinstance(self.readings, float):
            return rise
        off = self.readings + self.deviations * np.sqrt(1 + cost)
        return off * (2 * np.sqrt(cost) + off)


def digits_in_single(tolerance: float, W: Whitener, variances: Array, U: Whitener, reading: Array) -> CostDigits:
    """Return what float32 leaves of the cost of a search.

    Args:
        tolerance: The option.
        W: Whitener of the deviations.
        variances: Of the deviations, (runs, n).
        U: Whitener of the residuals.
        reading: How large the measurements and what makes them up are, (runs, m): they are rounded by a share of that.
    """
    eps = float(np.finfo(SINGLE).eps)
    readings = eps * np.linalg.norm(times(np.abs(U.root), reading), axis=1)
    deviations = eps * np.linalg.norm(times(np.abs(W.root), np.sqrt(variances)), axis=1)
    return CostDigits(np.maximum(max(tolerance, eps**0.5), readings + deviations), readings, deviations)


def gauss_newton(
    evaluate: Callable[[Array], tuple[Array, Array]],
    find_step: Callable[[Array, Array], tuple[Array, Array]],
    start: Array,
    options: IterationOptions,
    digits: CostDigits | None = None,
) -> tuple[Array, Array]:
    """Minimise a sum of squares for every run by Gauss-Newton steps with halving; return where, and the steps taken.

    A run that has converged, or that no step takes lower, is frozen, so that its bits do not depend on how long the
    others take.

    Args:
        evaluate: Deviation (runs, n) -> cost (runs,) and whatever array (runs, ...) the step needs again.
        find_step: Deviation and that array -> the full step (runs, n), and its squared length in the metric of the
            normal matrix (runs,), which is half the rate at which the cost falls along it.
        start: Deviation to start from, (runs, n).
        options: When to stop.
        digits: What rounding leaves of the cost; None: that of float64.

    Returns:
        The deviation (runs, n) and the number of steps (runs,).
    """
    x, digits = start, CostDigits(options.tolerance) if digits is None else digits
    tolerance = digits.tolerance
    cost, kept = evaluate(x)
    active, iterations = np.ones(len(x), dtype=bool), np.zeros(len(x))
    previous = np.zeros(len(x))
    for _ in range(options.max_iterations):
        dx, length = find_step(x, kept)
        active = active & (length > tolerance**2)
        # The steps shrink geometrically or faster: the next is shorter by the factor of the last, at least.
        ahead = length * length > tolerance**2 * previous
        previous = length
        if not active.any():
            break
        origin, before, pending = x, cost, active
        most = before + digits.rise(before)
        for halving in range(_HALVINGS):
            t = 0.5**halving
            tried = origin + t * dx
            cost_t, kept_t = evaluate(tried)
            lower = cost_t <= most - 2 * _SUFFICIENT * t * length
            taken = pending & lower
            x, kept = _where(taken, tried, x), _where(taken, kept_t, kept)
            cost = np.where(taken, cost_t, cost)
            iterations += taken
            pending = pending & ~lower
            if not pending.any():
                break
        active = active & ~pending & ahead
        if not active.any():
            break
    return x, iterations


def jacobian_of_runs(measurement: Measurement, x: Array, epoch: int) -> Array:
    """Return dh/dx at x (runs, n) as (runs, m, n) in C order, also where the measurement gives one matrix for all."""
    H = measurement.jacobian(x, epoch)
    return np.ascontiguousarray(H if H.ndim == 3 else np.broadcast_to(H, (len(x), *H.shape)))


def times(A: Array, v: Array) -> Array:
    """Return A v, (runs, p), for A (runs, p, q) and v (runs, q)."""
    return np.einsum("bij,bj->bi", A, v)


def _where(condition: Mask, chosen: Array, other: Array) -> Array:
    return np.where(condition.reshape(-1, *[1] * (chosen.ndim - 1)), chosen, other)
