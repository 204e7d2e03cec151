"""Where an orbit first goes below the surface within a step, from the step's dense output."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from relnav_sim.arrays import Array

TERMS = 8
"""Of the dense output of a step: the state at its start, the change over it and six more."""


def first_below(terms: Array, radius_m: float) -> Array:
    """Return the fraction of the step at which each orbit first goes below a radius, (n,); infinity where it does not.

    The squared radius is a polynomial over the step, of degree 14. It is monotonic between its stationary points, so
    that a look at these and at the step's ends misses no dip, however long the step and however short the dip.

    Args:
        terms: Dense output of one step of each orbit (n, 8, 6), as the kernels keep it; none of them starts below the
            radius.
        radius_m: The surface, m from the centre.
    """
    return np.array([_first_below(each[:, :3], radius_m) for each in terms])


def _first_below(position: Array, radius_m: float) -> float:
    """Return the same of one orbit, from its terms (8, 3)."""
    scaled = _WEIGHTS.T @ (position / radius_m)  # coefficients of powers, in radii
    height = polynomial.polysub(sum(polynomial.polymul(axis, axis) for axis in scaled.T), [1.0])
    if not np.isfinite(height).all():
        return 0.0  # air so dense that the step's own output overflows
    stationary = polynomial.polyroots(polynomial.polyder(np.trim_zeros(height, "b"))).real
    looked_at = np.unique([0.0, *stationary[(stationary > 0) & (stationary < 1)], 1.0])
    heights = polynomial.polyval(looked_at, height)
    below = np.flatnonzero(heights[1:] < 0) + 1
    if not len(below):
        return np.inf
    before = looked_at[below[0] - 1]
    if heights[below[0] - 1] <= 0:  # it starts on the surface, and goes down
        return float(before)
    from scipy.optimize import brentq  # here, because it takes a tenth of a second to import and few orbits end

    return float(brentq(polynomial.polyval, before, looked_at[below[0]], args=(height,), xtol=1e-15))


def _powers_of_weights() -> Array:
    """Return the coefficients (8, 8) of the terms' weights as polynomials of the fraction, lowest power first."""
    coefficients = np.zeros((TERMS, TERMS))
    weight: Array = np.ones(1)
    for i in range(TERMS):
        if i:
            weight = np.convolve(weight, [1.0, -1.0] if i % 2 == 0 else [0.0, 1.0])
        coefficients[i, : len(weight)] = weight
    return coefficients


_WEIGHTS = _powers_of_weights()
