"""A line of sight as two angles across it, with or without the range beside them: no direction is a pole.

Azimuth and elevation turn ever faster towards the axis on which they do not exist; the noise of a sensor with a focal
plane does not. Here the noise is two small turns across the line of sight, alike in every direction (the error vector
across the line of sight of Shuster and Oh, J. Guidance and Control 4(1), 1981, with unit weights). A measurement u_z is
the centre of a chart of all directions (`astro.tangent_plane`): what is measured of a state is how far its line of
sight lies from u_z, h(x), and the measurement itself is 0. A plain difference is then right for every filter. With
isotropic noise of the angles the density of h(x) at the true state is that of the noise exactly, whatever its size.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import mounting_matrix, sight_vector
from relnav_sim.measurements.interface import MeasurementDefaults, Mixture
from relnav_sim.measurements.sight import Sight, in_states
from relnav_sim.measurements.spherical_radar import SightNoise


class TangentSight(MeasurementDefaults):
    """How far the line of sight lies from where it was read, z = (rad, rad), or (m, rad, rad) with the range.

    `take` is given measurements as azimuth and elevation, behind the range where there is one, and turns the angles to
    0. Runs and epochs of which no measurement was taken are seen from the line of sight of their own (first) state: h =
    0, with derivatives and noise as of a measurement there.

    The noise is diagonal plus G P G^T on the angles: an attitude error dtheta moves them by G dtheta, with the rows of
    G, e_a x u_z and e_b x u_z, of the measurement.

    Args:
        sight: Where the sensor sees the other craft.
        noise: What the filter is told about the noise of the channels, two or three.
    """

    leaves_arguments_alone = True

    def __init__(self, sight: Sight, noise: SightNoise) -> None:
        self.dimension = len(noise.nominal)
        self._ranged = self.dimension == 3
        self._angles = slice(self.dimension - 2, self.dimension)
        self._sight = sight
        self._rotation = sight.sensor_from_rtn
        self.depends_on = sight.depends_on
        self._attitude = np.ascontiguousarray(noise.attitude) if noise.attitude.any() else None
        self._covariance = np.diag(noise.variances)[None].copy()
        self._covariance.setflags(write=False)  # as that of `checked_noise`
        self._weights = noise.weights
        self._components = (
            np.square(noise.deviations)[:, None] * np.eye(self.dimension) if noise.has_components else None
        )
        self._centres: Array | None = None  # (epochs, runs, 3)
        self._first_epoch = 0

    def take(self, z: Array, first_epoch: int) -> Array:
        """Return z (runs, K, m) of the epochs from `first_epoch` on with 0 for their angles, and remember the angles.

        Args:
            z: Azimuth and elevation, rad, behind the range in m where there is one; NaN where a channel is missing. A
                direction with one angle is none.
            first_epoch: Number of the first epoch.
        """
        azimuth, elevation = np.moveaxis(z[..., self._angles], -1, 0)
        centres = np.stack(sight_vector(np.ones(()), azimuth, elevation), axis=-1)
        self._centres, self._first_epoch = np.ascontiguousarray(centres.swapaxes(0, 1)), first_epoch
        taken = z.copy()
        taken[..., self._angles] = np.where(np.isnan(centres[..., :1]), np.nan, 0.0)
        return taken

    def predict(self, states: Array, epoch: int) -> Array:
        """Return (range and) the angles from measurement to line of sight of states (runs, ..., n): (runs, ..., m)."""
        positions = self._sight.positions(states, epoch)
        z = kernels.tangent.readings(positions, self._rotation, self._read(len(states), epoch), self._ranged)
        return z.reshape(*states.shape[:-1], self.dimension)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives with respect to states (runs, ..., n): (runs, ..., m, n)."""
        return _with_jacobian(self._sight, self._read(len(states), epoch), self._ranged, states, epoch)[1]

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian (runs, m, n) and R at the means (runs, n)."""
        predicted, H = _with_jacobian(self._sight, self._read(len(mean), epoch), self._ranged, mean, epoch)
        return z - predicted, H, self.noise(mean, epoch)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R: (m, m) with perfect attitude, else (runs, m, m)."""
        if self._attitude is None:
            return self._covariance[0]
        return self._turned(mean, epoch, self._attitude, self._covariance)[:, 0]

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the joint components, (k, m, m) or (runs, k, m, m), where the filter is told of a mixture."""
        if self._components is None:
            return None
        covariances = self._components
        if self._attitude is not None:
            covariances = self._turned(mean, epoch, self._attitude, covariances)
        return Mixture(self._weights, covariances, shared=True)

    def turning(self, states: Array, epoch: int) -> Array:
        """Return what a small turn about the sensor's axes does to the measurement, (runs, 1, ..., m, 3)."""
        first = states.reshape(len(states), -1, states.shape[-1])[:, 0]
        G = np.zeros((len(states), self.dimension, 3))
        G[:, self._angles] = kernels.tangent.by_turn(
            self._sight.positions(first, epoch), self._rotation, self._read(len(states), epoch)
        )
        return G.reshape(len(states), *[1] * (states.ndim - 2), self.dimension, 3)

    def position(self, z: Array, epoch: int) -> Array:
        """Return the relative position, RTN (..., 3) m, that range, azimuth and elevation (..., 3) point at."""
        return self._sight.position(sight_vector(z[..., 0], z[..., 1], z[..., 2]), epoch)

    def _turned(self, mean: Array, epoch: int, attitude: Array, own: Array) -> Array:
        """Return covariances (k, m, m) and what the attitude's error adds to each, (runs, k, m, m)."""
        positions, centres = self._sight.positions(mean, epoch), self._read(len(mean), epoch)
        return kernels.tangent.noise(positions, self._rotation, centres, attitude, own)

    def _read(self, runs: int, epoch: int) -> Array:
        """Return the direction of each run's measurement, (runs, 3); NaN where there is none."""
        place = epoch - self._first_epoch
        if self._centres is None or not 0 <= place < len(self._centres) or self._centres.shape[1] != runs:
            return np.full((runs, 3), np.nan)
        return np.asarray(self._centres[place])


def _with_jacobian(sight: Sight, centres: Array, ranged: bool, states: Array, epoch: int) -> tuple[Array, Array]:
    """Return h, (points, m), and its derivatives, (runs, ..., m, n)."""
    positions, by_state = sight.positions_with_jacobian(states, epoch)
    z, H = kernels.tangent.linearised(positions, sight.sensor_from_rtn, centres, ranged)
    return z, in_states(H, by_state, states)


def camera(
    *,
    angle_sigma_deg: float,
    mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    host: Literal["chief", "deputy"] = "chief",
    chief_orbit: ChiefOrbit | None = None,
    step_s: float | None = None,
) -> TangentSight:
    """Return what a filter believes of a camera: the direction of the other craft, with no pole.

    Measurements for `run_filter` are azimuth and elevation in the camera's frame, rad, (runs, T, 2): azimuth from its x
    axis towards y, elevation towards minus z. The state begins with the deputy's position and velocity relative to the
    chief, RTN (m, m/s). The filter compares directions by two small angles across the line of sight, so its NIS has
    two degrees of freedom and no direction is special.

    Args:
        angle_sigma_deg: Noise of each of the two angles, 1 sigma, deg.
        mounting_deg: Yaw, pitch and roll from the host's LVLH frame (x along-track, y minus orbit normal, z nadir) to
            the camera's frame, deg.
        host: Craft that carries it.
        chief_orbit: The chief's nominal orbit at epoch 0; needed where the host is the deputy.
        step_s: Time between epochs, s; needed where the host is the deputy of an elliptic orbit.

    Raises:
        ValueError: A sigma that is not between 0 and 90 deg, or no chief orbit or step with the deputy as host.

    Examples:
        The deputy ahead and above, seen along the camera's x axis:

        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, create_filter, measurements, run_filter
        >>> standing = LinearDynamics(np.eye(6), 1e-6 * np.eye(6))
        >>> filter = create_filter("ekf", standing, measurements.camera(angle_sigma_deg=0.01))
        >>> z = np.full((1, 50, 2), [0.0, 0.1])
        >>> history = run_filter(filter, z, [0.0, 1000.0, 0.0, 0.0, 0.0, 0.0], np.diag([100.0] * 3 + [1e-4] * 3))
        >>> x, y, _ = history.mean[0, -1, :3]
        >>> round(float(np.arctan2(x, y)), 4)
        0.1
    """
    if not 0 < angle_sigma_deg < 90:
        raise ValueError(f"angle_sigma_deg is {angle_sigma_deg:g}; it must be between 0 and 90")
    sigmas = np.full(2, np.radians(angle_sigma_deg))
    sight = Sight(mounting_matrix(*mounting_deg), host, chief_orbit, step_s)
    return TangentSight(sight, SightNoise(np.ones(1), sigmas[None], sigmas, np.zeros((3, 3))))
