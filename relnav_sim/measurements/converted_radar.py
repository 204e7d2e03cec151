"""The radar reading converted to a Cartesian position, as a filter sees it: linear, with a covariance that moves.

Unbiased conversion and exact second moments of range and two angles with independent noise: Lerro and Bar-Shalom
(IEEE Trans. AES 29(3), 1993), Mo, Song, Zhou, Sun and Bar-Shalom (IEEE Trans. AES 34(3), 1998). The covariance is
taken at the predicted position; taken at the reading it would depend on the noise and bias the filter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, components, cross_matrix, rotate, rows, times
from relnav_sim.measurements.interface import MeasurementDefaults, Mixture
from relnav_sim.measurements.spherical_radar import SightNoise

Coefficients = list[float] | Array
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""A symmetric 3 x 3 matrix is carried as six arrays in this order."""


@dataclass(frozen=True)
class Conversion:
    """Mean shrinkage of a noisy line of sight: E[x_measured] = `level` x (y alike), E[z_measured] = `height` z.

    Dividing by them makes the converted position unbiased. Radar frame; z is the axis of the elevation.
    """

    level: float
    height: float


def conversion(weights: Array, deviations: Array) -> Conversion:
    """Return the shrinkage under a mixture, weights (k,), deviations (k, 3) of range (m), azimuth, elevation (rad)."""
    _, azimuth, elevation = np.exp(-np.square(deviations.T) / 2)
    return Conversion(float(np.sum(weights * azimuth * elevation)), float(np.sum(weights * elevation)))


class ConvertedRadar(MeasurementDefaults):
    """Position of the deputy relative to the chief from one radar reading, RTN, z = (m, m, m), H = [I 0].

    For a radar on the chief; the front end makes the reading with the same `Conversion`.

    Args:
        mounting: Rotation (3, 3) from the chief's nadir frame to the radar frame.
        noise: What the filter is told about the noise of range and angles, and of the attitude.
    """

    dimension = 3
    depends_on = (0, 1, 2)
    whole = True

    def __init__(self, mounting: Array, noise: SightNoise) -> None:
        radar_from_rtn = mounting @ NADIR_FROM_RTN
        self._radar_from_rtn = rows(radar_from_rtn)
        self._axis = radar_from_rtn[2].tolist()
        factors = conversion(noise.weights, noise.deviations)
        if noise.assumed == "nominal":
            self._one = _moments(np.ones(1), noise.nominal[None], factors)
        else:
            self._one = _moments(noise.weights, noise.deviations, factors)
        self._weights = noise.weights
        self._components = (
            _side_by_side([_moments(np.ones(1), row[None], factors) for row in noise.deviations])
            if noise.has_components
            else None
        )
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
        if self._components is None:
            return None
        covariances = np.moveaxis(self._covariance(mean, self._components(mean.ndim - 1)), 0, -3)
        return Mixture(self._weights, np.ascontiguousarray(covariances), shared=True)

    def _covariance(self, states: Array, m: _Moments) -> Array:
        """Return the second moment of the converted position's error at the true position, RTN (..., 3, 3).

        Coefficients of several components give (k, ..., 3, 3).

        In the radar frame it is [[w x^2 + d, w x y, u x z], [., w y^2 + d, u y z], [., ., v z^2 + e]]. With a the
        radar's z axis in RTN this equals w r r^T + f (r a^T + a r^T) + g a a^T + d I for the position r in RTN,
        which needs no rotation of a matrix.
        """
        position = components(states)
        x, y, z = rotate(self._radar_from_rtn, position)
        in_plane = x * x + y * y
        squared = in_plane + z * z
        inverse = 1 / squared
        w = m.w[0] + m.w[1] * inverse + (m.w[2] * squared + m.w[3]) / in_plane
        u = m.u[0] + m.u[1] * inverse
        v = m.v[0] + m.v[1] * inverse
        d = (m.d[0] + m.d[1] * inverse) * in_plane + (m.d[2] * squared + m.d[3])
        e = m.e[0] * squared + m.e[1]
        f = z * (u - w)
        g = (z * z) * (w - 2 * u + v) + (e - d)
        axis = self._axis
        by_position = [w * r + f * a if a else w * r for r, a in zip(position, axis, strict=True)]
        by_axis = [f * r + g * a if a else f * r for r, a in zip(position, axis, strict=True)]
        attitude = (
            None if self._attitude is None else times(self._attitude, [position[i] * position[j] for i, j in PAIRS])
        )
        R = np.empty((*w.shape, 3, 3))
        for n, (i, j) in enumerate(PAIRS):
            entry = position[i] * by_position[j]
            if axis[i]:
                entry = entry + axis[i] * by_axis[j]
            if i == j:
                entry = entry + d
            if attitude is not None:
                entry = entry + attitude[n]
            R[..., i, j] = entry
            if i != j:
                R[..., j, i] = entry
        return R


@dataclass(frozen=True)
class _Moments:
    """Coefficients of the covariance in powers of the range; see `ConvertedRadar._covariance`."""

    w: Coefficients
    u: Coefficients
    v: Coefficients
    d: Coefficients
    e: Coefficients


def _side_by_side(components: Sequence[_Moments]) -> Callable[[int], _Moments]:
    """Return what gives the coefficients of k components as arrays (k, 1, ..., 1), for so many axes of the states."""
    each = [np.array([getattr(m, field.name) for m in components]).T for field in fields(_Moments)]

    def spread(axes: int) -> _Moments:
        return _Moments(*(column.reshape(*column.shape, *[1] * axes) for column in each))

    return spread


def _moments(weights: Array, deviations: Array, factors: Conversion) -> _Moments:
    """Return the second moments about the true position of a conversion that divides by `factors`.

    With l = exp(-s^2 / 2) an angle's noisy square has E cos^2 = l^4 cos^2 + (1 - l^4) / 2 and E sin^2 alike, and
    E sin cos = l^4 sin cos; the noisy range has E = range^2 + sr^2. Averaged over the components of the mixture.
    """
    range_variance, azimuth_variance, elevation_variance = np.square(deviations.T)
    lg, lb = np.exp(-azimuth_variance / 2), np.exp(-elevation_variance / 2)
    G, B = lg**4, lb**4
    g, b = (1 - G) / 2, (1 - B) / 2

    def averages(factor: Array) -> tuple[float, float]:
        """Return the parts of E[range^2 factor] that go with range^2 and with 1."""
        weighted = weights * factor
        return float(np.sum(weighted)), float(np.sum(weighted * range_variance))

    level, height = factors.level, factors.height
    mean_level, mean_height = np.sum(weights * lb * lg) / level, np.sum(weights * lb) / height
    w = np.array([*averages(B * G), *averages(b * G)]) / level**2
    d = np.array([*averages(B * g), *averages(b * g)]) / level**2
    u = np.array(averages(B * lg)) / (level * height)
    v = np.array(averages(B)) / height**2
    e = np.array(averages(b)) / height**2
    w[0] += 1 - 2 * mean_level
    u[0] += 1 - mean_level - mean_height
    v[0] += 1 - 2 * mean_height
    return _Moments(w.tolist(), u.tolist(), v.tolist(), d.tolist(), e.tolist())


def attitude_map(P: Array) -> Array:
    """Return (6, 6): [r x] P [r x]^T, as six entries, from the six products of r's components."""
    axes = [cross_matrix(axis) for axis in np.eye(3)]
    columns = []
    for i, j in PAIRS:
        product = axes[i] @ P @ axes[j].T
        matrix = product if i == j else product + product.T
        columns.append([matrix[row, column] for row, column in PAIRS])
    return np.array(columns).T
