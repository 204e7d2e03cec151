"""A radar measurement with tangent angles converted to a Cartesian position, as a filter sees it.

As `converted_radar`, for noise that is two small turns (a, b) across the line of sight u: the read direction is
cos(t) u + sin(t)/t (a e_a + b e_b), t = hypot(a, b), so its mean is E[cos t] u and its second moment
E[cos^2 t] u u^T + E[(a sin(t)/t)^2] e_a e_a^T + E[(b sin(t)/t)^2] e_b e_b^T. Nothing depends on where u points.
"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN
from relnav_sim.measurements.converted_radar import ConvertedPosition, attitude_map
from relnav_sim.measurements.interface import Mixture
from relnav_sim.measurements.spherical_radar import SightNoise

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(60)
"""The moments are entire functions of the angles; 60 nodes are exact to rounding for sigmas up to 90 deg."""


def tangent_shrinkage(weights: Array, deviations: Array) -> float:
    """Return E[cos t] under a mixture, weights (k,), deviations (k, 3) of range and two angles (rad).

    Dividing the read position by it makes it unbiased.
    """
    return float(sum(w * _moments(*row[1:])[0] for w, row in zip(weights, deviations, strict=True)))


class ConvertedTangentRadar(ConvertedPosition):
    """Position of the deputy relative to the chief from range and tangent angles, RTN, z = (m, m, m), H = [I 0].

    For a radar on the chief; the front end divides the position by the same `tangent_shrinkage`.

    Args:
        mounting: Rotation (3, 3) from the chief's LVLH frame to the radar frame.
        noise: What the filter is told about the noise of range and angles, and of the attitude.
    """

    def __init__(self, mounting: Array, noise: SightNoise) -> None:
        super().__init__(noise.weights)
        radar_from_rtn = mounting @ NADIR_FROM_RTN
        self._radar_from_rtn = radar_from_rtn
        shrinkage = tangent_shrinkage(noise.weights, noise.deviations)
        each = np.array([_coefficients(row, shrinkage) for row in noise.deviations])
        nominal = noise.assumed == "nominal"
        self._one = (_coefficients(noise.nominal, shrinkage) if nominal else noise.weights @ each)[None]
        self._components = each if noise.has_components else None
        self._attitude = attitude_map(radar_from_rtn.T @ noise.attitude @ radar_from_rtn)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at the predicted mean (runs, n): (runs, 3, 3), m^2."""
        return self._covariances(mean, self._one)[:, 0]

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the joint components, (runs, k, 3, 3), where the filter is told of a mixture."""
        if self._components is None:
            return None
        return Mixture(self._weights, self._covariances(mean, self._components), shared=True)

    def _covariances(self, states: Array, coefficients: Array) -> Array:
        """Return w r r^T + p e_a e_a^T + q e_b e_b^T with the attitude's share, RTN (runs, k, 3, 3)."""
        return kernels.converted_radar.tangent_covariances(
            np.ascontiguousarray(states), self._radar_from_rtn, coefficients, self._attitude
        )


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


def _coefficients(deviations: Array, shrinkage: float) -> Array:
    """Return the coefficients (6,) of the error's second moment, for deviations (3,) of range and both angles.

    Of r r^T, e_a e_a^T and e_b e_b^T, two each: of 1 and 1 / r^2 along r, of r^2 and 1 across it.
    """
    mean, straight, first, second = _moments(*deviations[1:])
    by_range = np.array([1.0, deviations[0] ** 2]) / shrinkage**2
    along = straight * by_range
    along[0] += 1 - 2 * mean / shrinkage
    return np.concatenate([along, first * by_range, second * by_range])
