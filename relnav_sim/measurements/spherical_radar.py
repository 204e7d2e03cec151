"""The radar as a filter sees it: range, azimuth and elevation as functions of the relative state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import mounting_matrix, sight_vector
from relnav_sim.given_arrays import numbers
from relnav_sim.linalg import transpose
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, MeasurementDefaults, Mixture, Stretch
from relnav_sim.measurements.sight import Sight, in_states

Assumed = Literal["nominal", "total", "mixture"]


_UNIT = np.eye(3)


@dataclass(frozen=True)
class SightNoise:
    """What a filter is told about the noise of one radar measurement.

    Attributes:
        weights: (k,) probabilities of the noise's joint components, positive, summing to 1.
        deviations: (k, 3) standard deviations of range (m), azimuth and elevation (rad) in each component.
        nominal: (3,) the same while no outlier component shows.
        attitude: (3, 3) covariance of the white attitude error about the radar's axes, rad^2.
        assumed: ``nominal`` (the nominal component alone), ``total`` (one Gaussian with the mixture's covariance)
            or ``mixture`` (the total for who asks for one covariance, and the components).
    """

    weights: Array
    deviations: Array
    nominal: Array
    attitude: Array
    assumed: Assumed = "total"

    @property
    def variances(self) -> Array:
        """The (3,) variances of the one Gaussian that stands for the noise."""
        if self.assumed == "nominal":
            return np.square(self.nominal)
        return np.einsum("k,ki->i", self.weights, np.square(self.deviations))

    @property
    def has_components(self) -> bool:
        """Whether the filter is told the components of a mixture."""
        return self.assumed == "mixture" and len(self.weights) > 1


class SphericalRadar(MeasurementDefaults):
    """Range, azimuth and elevation of the other craft in the radar frame; z = (m, rad, rad).

    The state begins with the deputy's position and velocity relative to the chief, RTN (m, m/s); more states may
    follow. The radar's axes stand fixed in the LVLH frame of its host's orbit. The azimuth and its row of the
    Jacobian do not exist on the radar's z axis: mount the radar so that the target stays away from it.

    The noise is diagonal plus G P G^T: an attitude error dtheta turns the line of sight and moves the angles by
    G dtheta, G = H_angles [r x] (attitude errors do not touch the range).

    Args:
        mounting: Rotation (3, 3) from the host's LVLH frame to the radar frame.
        noise: What the filter is told about the noise.
        host: ``chief``: the deputy seen from the chief (Shi et al. 2025). ``deputy``: the chief seen from the
            deputy, in the deputy's own orbit frame (Wei, Song and Zhang 2012); needs `chief_orbit`.
        chief_orbit: The chief's nominal orbit, at epoch 0.
        step_s: Time between epochs, s; not needed on a circular orbit.

    Raises:
        ValueError: The host is the deputy and there is no chief orbit, or an elliptic one and no step.
    """

    leaves_arguments_alone = True
    dimension = 3
    angles = (1, 2)

    def __init__(
        self,
        mounting: Array,
        noise: SightNoise,
        host: Literal["chief", "deputy"] = "chief",
        chief_orbit: ChiefOrbit | None = None,
        step_s: float | None = None,
    ) -> None:
        self._sight = Sight(mounting, host, chief_orbit, step_s)
        self._rotation = self._sight.sensor_from_rtn
        self.depends_on = self._sight.depends_on
        self._attitude = np.ascontiguousarray(noise.attitude)
        self._turns = bool(noise.attitude.any())
        self._variances = noise.variances
        self._weights = noise.weights
        self._component_variances = tuple(np.square(noise.deviations)) if noise.has_components else ()

    def predict(self, states: Array, epoch: int) -> Array:
        """Return range, azimuth and elevation of states (runs, ..., n): (runs, ..., 3)."""
        return kernels.sight.spherical(self._sight.positions(states, epoch), self._rotation).reshape(
            *states.shape[:-1], 3
        )

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives with respect to states (runs, ..., n): (runs, ..., 3, n)."""
        positions, by_state = self._sight.positions_with_jacobian(states, epoch)
        return in_states(kernels.sight.jacobian(positions, self._rotation), by_state, states)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, 3), Jacobian (runs, 3, n) and R at the means (runs, n), all at once."""
        positions, by_state = self._sight.positions_with_jacobian(mean, epoch)
        nu, H, R = kernels.sight.linearised(
            np.ascontiguousarray(z), positions, self._rotation, self._attitude, self._variances
        )
        return nu, in_states(H, by_state, mean), R if self._turns else R[0]

    def filtered(
        self, mean: Array, covariance: Array, F: Array, Q: Array, update: CompiledUpdate, stretch: Stretch
    ) -> int | None:
        """Fill a stretch, where the position is part of the state."""
        if self.depends_on is None:
            return None
        model = self._rotation, self._attitude, self._variances[None]
        return stretch.filled(mean, covariance, F, Q, update, False, model)

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return |W (z - h(x))|^2 of the samples x = centre + root e, (runs, N)."""
        if self.depends_on is None or root.shape[2] != 3:
            return super().squared_errors(z, W, centre, root, e, epoch)
        z, W, centre, root, e = map(np.ascontiguousarray, (z, W, centre, root, e))
        return kernels.sight.squared_errors(z, W, centre, root, e, self._rotation)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at the predicted mean (runs, n): (3, 3) with perfect attitude, else (runs, 3, 3)."""
        return self._covariance(mean, epoch, self._variances)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the joint components, (k, 3, 3) or (runs, k, 3, 3), where the filter is told of a mixture."""
        if not self._component_variances:
            return None
        covariances = [self._covariance(mean, epoch, variances) for variances in self._component_variances]
        return Mixture(self._weights, np.stack(covariances, axis=-3), shared=True)

    def position(self, z: Array, epoch: int) -> Array:
        """Return the relative position, RTN (..., 3) m, that measurements (..., 3) give; at rest where that matters."""
        return self._sight.position(sight_vector(z[..., 0], z[..., 1], z[..., 2]), epoch)

    def _covariance(self, states: Array, epoch: int, variances: Array) -> Array:
        """Return diag(variances) + G P G^T, (..., 3, 3), or (3, 3) with perfect attitude."""
        if not self._turns:
            return variances * _UNIT
        R = kernels.sight.noise(self._sight.positions(states, epoch), self._rotation, self._attitude, variances)
        return R.reshape(*states.shape[:-1], 3, 3)


def radar(
    *,
    range_sigma_m: float,
    angle_sigma_deg: float,
    mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    host: Literal["chief", "deputy"] = "chief",
    chief_orbit: ChiefOrbit | None = None,
    attitude_sigma_deg: float = 0.0,
    step_s: float | None = None,
) -> SphericalRadar:
    """Return a radar's range, azimuth and elevation for `create_filter`; z = (m, rad, rad).

    The state is the deputy's position and velocity relative to the chief in the chief's RTN frame, m and m/s; more
    states may follow. The radar stands fixed in its host's LVLH frame (x along-track, y minus orbit normal, z
    nadir). Azimuth counts from the radar's x axis towards y, elevation towards minus z.

    Args:
        range_sigma_m: Standard deviation of the range, m.
        angle_sigma_deg: Standard deviation of azimuth and of elevation, deg (measurements are in rad).
        mounting_deg: Yaw, pitch and roll from the LVLH frame to the radar frame, deg, about z, the new y, the new x.
        host: Craft with the radar, which sees the other one.
        chief_orbit: The chief's nominal orbit at epoch 0, needed with the radar on the deputy.
        attitude_sigma_deg: Standard deviation of a white error of the host's attitude about each axis, deg.
        step_s: Time between epochs, s, needed with the radar on the deputy of an elliptic orbit.

    Raises:
        ValueError: A sigma is not positive (the attitude's: negative), or the chief's orbit or the step is missing.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import measurements
        >>> radar = measurements.radar(range_sigma_m=2.0, angle_sigma_deg=0.05)
        >>> radar.predict(np.array([[0.0, 1000.0, 0.0, 0.0, 0.0, 0.0]]), 0).tolist()
        [[1000.0, -0.0, 0.0]]
    """
    if not (range_sigma_m > 0 and angle_sigma_deg > 0 and attitude_sigma_deg >= 0):
        raise ValueError(
            f"range_sigma_m {range_sigma_m:g} and angle_sigma_deg {angle_sigma_deg:g} must be positive, "
            f"attitude_sigma_deg {attitude_sigma_deg:g} must not be negative"
        )
    sigmas = np.array([range_sigma_m, *np.radians([angle_sigma_deg, angle_sigma_deg])])
    attitude = np.square(np.radians(attitude_sigma_deg)) * np.eye(3)
    noise = SightNoise(np.ones(1), sigmas[None], sigmas, attitude)
    return SphericalRadar(mounting_matrix(*mounting_deg), noise, host, chief_orbit, step_s)


class Locating(Measurement, Protocol):
    """A measurement model whose measurements give a position."""

    def position(self, z: Array, epoch: int) -> Array:
        """Return the relative position, RTN (..., 3) m, that measurements (..., 3) of an epoch point at."""
        ...


def first_fix(
    radar: Locating, z: Array, epoch: int = 0, noise: Callable[[Array, int], Array] | None = None
) -> tuple[Array, Array]:
    """Return the relative position that one measurement gives, and its covariance to first order.

    Args:
        radar: The model of the measurement.
        z: Range, azimuth and elevation, (runs, 3); NaN gives NaN.
        epoch: The measurement's epoch.
        noise: R at a state, where it is not the radar's own.

    Returns:
        Position of the deputy relative to the chief, RTN, (runs, 3) m, and covariance J R J^T, (runs, 3, 3) m^2,
        J = (dh/dr)^-1. Zero relative velocity is assumed where the measurement depends on it.

    Raises:
        ValueError: The model gives no position, or the measurements have another shape.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import measurements
        >>> radar = measurements.radar(range_sigma_m=2.0, angle_sigma_deg=0.05)
        >>> position, covariance = measurements.first_fix(radar, np.array([[1000.0, 0.0, 0.0]]))
        >>> position.round(6).tolist(), covariance[0].diagonal().round(3).tolist()
        ([[0.0, 1000.0, -0.0]], [0.762, 4.0, 0.762])
    """
    if not hasattr(radar, "position"):
        raise ValueError(
            "a measurement of this kind gives no position; take a radar, or a lidar with angles, or start from "
            "elsewhere"
        )
    readings = numbers(z, "z", masked_is_missing=True)
    if readings.ndim != 2 or readings.shape[1] != 3:
        hint = "; for one measurement use z[None]" if readings.ndim == 1 else ""
        raise ValueError(f"z has shape {readings.shape}; it must be (runs, 3){hint}")
    state = np.zeros((len(readings), 6))
    state[:, :3] = radar.position(readings, epoch)
    H = radar.jacobian(state, epoch)[:, :, :3]
    J = np.asarray(np.linalg.inv(H), dtype=np.float64)
    return state[:, :3], J @ (noise or radar.noise)(state, epoch) @ transpose(J)
