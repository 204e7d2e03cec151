"""A radar reading with tangent angles converted to a Cartesian position, as a filter sees it.

As `converted_radar`, for noise that is two small turns (a, b) across the line of sight u: the read direction is
cos(t) u + sin(t)/t (a e_a + b e_b), t = hypot(a, b), so its mean is E[cos t] u and its second moment
E[cos^2 t] u u^T + E[(a sin(t)/t)^2] e_a e_a^T + E[(b sin(t)/t)^2] e_b e_b^T. Nothing depends on where u points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, components, rotate, rows, times
from relnav_sim.astro.tangent_plane import across, unit
from relnav_sim.measurements.converted_radar import PAIRS, attitude_map
from relnav_sim.measurements.interface import MeasurementDefaults, Mixture
from relnav_sim.measurements.spherical_radar import SightNoise

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(60)
"""The moments are entire functions of the angles; 60 nodes are exact to rounding for sigmas up to 90 deg."""


def tangent_shrinkage(weights: Array, deviations: Array) -> float:
    """Return E[cos t] under a mixture, weights (k,), deviations (k, 3) of range and two angles (rad).

    Dividing the read position by it makes it unbiased.
    """
    return float(sum(w * _moments(*row[1:])[0] for w, row in zip(weights, deviations, strict=True)))


class ConvertedTangentRadar(MeasurementDefaults):
    """Position of the deputy relative to the chief from range and tangent angles, RTN, z = (m, m, m), H = [I 0].

    For a radar on the chief; the front end divides the position by the same `tangent_shrinkage`.

    Args:
        mounting: Rotation (3, 3) from the chief's nadir frame to the radar frame.
        noise: What the filter is told about the noise of range and angles, and of the attitude.
    """

    dimension = 3
    depends_on = (0, 1, 2)
    whole = True

    def __init__(self, mounting: Array, noise: SightNoise) -> None:
        radar_from_rtn = mounting @ NADIR_FROM_RTN
        self._radar_from_rtn, self._rtn_from_radar = rows(radar_from_rtn), rows(radar_from_rtn.T)
        shrinkage = tangent_shrinkage(noise.weights, noise.deviations)
        each = [_coefficients(row, shrinkage) for row in noise.deviations]
        if noise.assumed == "nominal":
            self._one = _coefficients(noise.nominal, shrinkage)
        else:
            self._one = _Coefficients(*(noise.weights @ np.array([vars(one)[name] for one in each]) for name in _NAMES))
        self._weights = noise.weights
        self._components = each if noise.has_components else []
        attitude = radar_from_rtn.T @ noise.attitude @ radar_from_rtn
        self._attitude = rows(attitude_map(attitude)) if noise.attitude.any() else None

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the position of states (runs, ..., n): (runs, ..., 3)."""
        return states[..., :3]

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return [I 0], (3, n)."""
        return np.eye(3, states.shape[-1])

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at the predicted mean (runs, n): (runs, 3, 3), m^2."""
        return self._covariance(mean, self._one)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the joint components, (runs, k, 3, 3), where the filter is told of a mixture."""
        if not self._components:
            return None
        covariances = np.stack([self._covariance(mean, one) for one in self._components], axis=-3)
        return Mixture(self._weights, covariances, shared=True)

    def _covariance(self, states: Array, m: _Coefficients) -> Array:
        """Return w r r^T + p e_a e_a^T + q e_b e_b^T with the attitude's share, RTN (..., 3, 3)."""
        r = components(states)
        squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        first, second = (rotate(self._rtn_from_radar, axis) for axis in across(unit(rotate(self._radar_from_rtn, r))))
        w = m.along[0] + m.along[1] / squared
        p, q = (each[0] * squared + each[1] for each in (m.first, m.second))
        attitude = None if self._attitude is None else times(self._attitude, [r[i] * r[j] for i, j in PAIRS])
        R = np.empty((*squared.shape, 3, 3))
        for n, (i, j) in enumerate(PAIRS):
            entry = w * r[i] * r[j] + p * first[i] * first[j] + q * second[i] * second[j]
            R[..., i, j] = R[..., j, i] = entry if attitude is None else entry + attitude[n]
        return R


@dataclass(frozen=True)
class _Coefficients:
    """Of r r^T, e_a e_a^T and e_b e_b^T, each (2,): of r^2 and 1 for the axes, of 1 and 1 / r^2 along r."""

    along: Array
    first: Array
    second: Array


_NAMES = ("along", "first", "second")


def _moments(a_sigma: float, b_sigma: float) -> tuple[float, float, float, float]:
    """Return E[cos t], E[cos^2 t], E[(a sin(t)/t)^2] and E[(b sin(t)/t)^2] of independent Gaussian turns a and b."""
    a, b = np.meshgrid(a_sigma * _NODES, b_sigma * _NODES, indexing="ij")
    probability = np.outer(_WEIGHTS, _WEIGHTS) / _WEIGHTS.sum() ** 2
    t = np.hypot(a, b)
    along, aside = np.cos(t), np.sinc(t / np.pi)
    mean, straight, first, second = (
        float((probability * values).sum()) for values in (along, along**2, (a * aside) ** 2, (b * aside) ** 2)
    )
    return mean, straight, first, second


def _coefficients(deviations: Array, shrinkage: float) -> _Coefficients:
    """Return the coefficients of the error's second moment, for deviations (3,) of range and both angles."""
    mean, straight, first, second = _moments(*deviations[1:])
    by_range = np.array([1.0, deviations[0] ** 2]) / shrinkage**2
    along = straight * by_range
    along[0] += 1 - 2 * mean / shrinkage
    return _Coefficients(along, first * by_range, second * by_range)
