"""The radar measurement converted to a Cartesian position, as a filter sees it: linear, with a covariance that moves.

Unbiased conversion and exact second moments of range and two angles with independent noise: Lerro and Bar-Shalom
(IEEE Trans. AES 29(3), 1993), Mo, Song, Zhou, Sun and Bar-Shalom (IEEE Trans. AES 34(3), 1998). The covariance is
taken at the predicted position; taken at the measurement it would depend on the noise and bias the filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, cross_matrix
from relnav_sim.measurements.interface import CompiledUpdate, MeasurementDefaults, Mixture, Stretch
from relnav_sim.measurements.spherical_radar import SightNoise

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


class ConvertedPosition(MeasurementDefaults):
    """Position of the deputy relative to the chief, RTN, z = (m, m, m), H = [I 0], with a covariance that moves."""

    dimension = 3
    depends_on = (0, 1, 2)
    whole = True
    leaves_arguments_alone = True

    def __init__(self, weights: Array) -> None:
        self._weights = weights
        self._H = position_rows(6)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the position of states (runs, ..., n): (runs, ..., 3)."""
        return states[..., :3]

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return [I 0], (3, n)."""
        n = states.shape[-1]
        if self._H.shape[1] != n:
            self._H = position_rows(n)
        return self._H

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return |W (z - H x)|^2 of the samples x = centre + root e, (runs, N)."""
        # H picks the first three rows; a product with it would cost more than what is done with them.
        residual = self.residual(z, self.predict(centre, epoch))
        return kernels.sampling.squared_linear(*map(np.ascontiguousarray, (residual, root[:, :3], W, e)))


def position_rows(n: int) -> Array:
    """Return [I 0], (3, n), read-only."""
    H = np.eye(3, n)
    H.setflags(write=False)
    return H


class ConvertedRadar(ConvertedPosition):
    """Position of the deputy relative to the chief from one radar measurement, RTN, z = (m, m, m), H = [I 0].

    For a radar on the chief; the front end makes the measurement with the same `Conversion`.

    Args:
        mounting: Rotation (3, 3) from the chief's LVLH frame to the radar frame.
        noise: What the filter is told about the noise of range and angles, and of the attitude.
    """

    def __init__(self, mounting: Array, noise: SightNoise) -> None:
        super().__init__(noise.weights)
        radar_from_rtn = mounting @ NADIR_FROM_RTN
        self._radar_from_rtn = radar_from_rtn
        factors = conversion(noise.weights, noise.deviations)
        if noise.assumed == "nominal":
            self._one = _moments(np.ones(1), noise.nominal[None], factors)[None]
        else:
            self._one = _moments(noise.weights, noise.deviations, factors)[None]
        self._components = (
            np.stack([_moments(np.ones(1), row[None], factors) for row in noise.deviations])
            if noise.has_components
            else None
        )
        self._attitude = attitude_map(radar_from_rtn.T @ noise.attitude @ radar_from_rtn)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at the predicted mean (runs, n): (runs, 3, 3), m^2."""
        return self._covariances(mean, self._one)[:, 0]

    def filtered(
        self, mean: Array, covariance: Array, F: Array, Q: Array, update: CompiledUpdate, stretch: Stretch
    ) -> int | None:
        """Fill a stretch."""
        model = self._radar_from_rtn, self._attitude, self._one
        return stretch.filled(mean, covariance, F, Q, update, True, model)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the joint components, (runs, k, 3, 3), where the filter is told of a mixture."""
        if self._components is None:
            return None
        return Mixture(self._weights, self._covariances(mean, self._components), shared=True)

    def _covariances(self, states: Array, coefficients: Array) -> Array:
        """Return the second moments of the converted position's error at the true position, RTN (runs, k, 3, 3)."""
        return kernels.converted_radar.covariances(
            np.ascontiguousarray(states), self._radar_from_rtn, coefficients, self._attitude
        )


def _moments(weights: Array, deviations: Array, factors: Conversion) -> Array:
    """Return the coefficients (14,) of the second moments about the true position, for a division by `factors`.

    With l = exp(-s^2 / 2) an angle's noisy square has E cos^2 = l^4 cos^2 + (1 - l^4) / 2 and E sin^2 alike, and
    E sin cos = l^4 sin cos; the noisy range has E = range^2 + sr^2. Averaged over the components of the mixture. Their
    order is that of `kernels.converted_radar.covariances`.
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
    return np.concatenate([w, u, v, d, e])


def attitude_map(P: Array) -> Array:
    """Return (6, 6): [r x] P [r x]^T, as six entries, from the six products of r's components."""
    axes = [cross_matrix(axis) for axis in np.eye(3)]
    columns = []
    for i, j in PAIRS:
        product = axes[i] @ P @ axes[j].T
        matrix = product if i == j else product + product.T
        columns.append([matrix[row, column] for row, column in PAIRS])
    return np.ascontiguousarray(np.array(columns).T)
