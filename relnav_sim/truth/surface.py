"""Where an orbit first goes below the surface within a step, from the step's dense output."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from relnav_sim.arrays import Array
from relnav_sim.truth import dop853


def first_below(terms: Array, radius_m: float) -> Array:
    """Return the fraction of the step at which each orbit first goes below a radius, (n,); infinity where it does not.

    The squared radius is a polynomial over the step, of degree 14. It is monotonic between its stationary points, so
    that a look at these and at the step's ends misses no dip, however long the step and however short the dip.

    Args:
        terms: Dense output of one step of each orbit (n, 8, 6), as `dop853.interpolant` returns it; none of them
            starts below the radius.
        radius_m: The surface, m from the centre.
    """
    found = np.full(len(terms), np.inf)
    for row in np.flatnonzero(~(_least_radius2(terms) >= radius_m * radius_m)):
        found[row] = _first_below(terms[row, :, :3], radius_m)
    return found


def _least_radius2(terms: Array) -> Array:
    """Return a lower bound (n,) of the squared radius over the step, cheap and sharp enough for orbits well above.

    The chord's ends are r0 and r1 from the centre, so that it comes no nearer than sqrt(min(r0, r1)^2 - chord^2 / 4).
    The other terms of the dense output have weights of at most 1/4.
    """
    position = terms[:, :, :3]
    ends = position[:, 0] + position[:, 1]
    start2, chord2, *rest = np.einsum("nkc,nkc->kn", position, position)
    nearer2 = np.minimum(start2, np.einsum("nc,nc->n", ends, ends)) - chord2 / 4
    bend = np.sqrt(rest).sum(axis=0) / 4
    least: Array = np.maximum(np.sqrt(np.maximum(nearer2, 0.0)) - bend, 0.0) ** 2
    return least


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
    """Return the coefficients (8, 8) of `dop853.weights` as polynomials of the fraction, lowest power first."""
    coefficients = np.zeros((dop853.COEFFICIENTS, dop853.COEFFICIENTS))
    weight: Array = np.ones(1)
    for i in range(dop853.COEFFICIENTS):
        if i:
            weight = np.convolve(weight, [1.0, -1.0] if i % 2 == 0 else [0.0, 1.0])
        coefficients[i, : len(weight)] = weight
    return coefficients


_WEIGHTS = _powers_of_weights()
