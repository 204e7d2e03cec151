"""Camera: the direction of the other craft, as two angles."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.constants import RADIUS_M
from relnav_sim.astro.line_of_sight import half_open
from relnav_sim.measurements.augmented import AdditiveBias, Distortion
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.radar_errors import AZIMUTH, ELEVATION, AnglesDistortion, radar_errors
from relnav_sim.measurements.selected import Selected
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.measurements.tangent_sight import TangentSight
from relnav_sim.options import Effect
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import ErrorShares, Form, MeasurementContext, Sensed
from relnav_sim.sensors.line_of_sight import AngleForm, SightSensorOptions, read_across
from relnav_sim.sensors.noise import noise_parts, white_law
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams


@register_sensor("camera")
class CameraOptions(SightSensorOptions):
    """Camera that measures the direction of the other craft as two angles.

    It is mounted in a body that keeps to its host's LVLH frame. Azimuth counts from the camera's x axis, its
    boresight, towards y, elevation towards minus z. It can be told to need light on the target and to avoid the Sun.
    """

    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("azimuth", "rad", "azimuth", angle=True),
        Channel("elevation", "rad", "elevation", angle=True),
    )

    error_states: ClassVar[tuple[str, ...]] = ("azimuth_bias", "elevation_bias", "attitude_error")
    kind: Literal["camera"] = Field(default="camera", description="Azimuth and elevation of the other craft")
    angle_sigma_deg: float = Field(gt=0, lt=90, description="Noise of each of the two angles, 1 sigma, deg")
    form: AngleForm = Field(
        default="tangent",
        description="What the noise of the two angles is, in truth and for the filters: tangent (two small turns "
        "across the line of sight, alike in every direction; default) or spherical (of azimuth and elevation "
        "themselves, which have a pole on the z axis)",
    )
    sunlit: Annotated[bool, Effect("light", "absence")] = Field(
        default=False, description="Whether it sees the other craft in sunlight only; needs sun_direction"
    )
    sun_exclusion_deg: Annotated[float | None, Effect("Sun exclusion", "absence")] = Field(
        default=None,
        gt=0,
        lt=180,
        description="Half angle of the cone about the Sun in which it sees nothing, deg; needs sun_direction. Default: "
        "none",
    )
    sun_direction: tuple[float, float, float] | None = Field(
        default=None, description="Direction of the Sun, ECI, of any length; it stands still. Default: not given"
    )

    @field_validator("sun_direction")
    @classmethod
    def _points_somewhere(cls, direction: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if direction is not None and not any(direction):
            raise ValueError("a direction of length 0 points nowhere")
        return direction

    @model_validator(mode="after")
    def _knows_the_sun(self) -> CameraOptions:
        if self.sun_direction is None and (self.sunlit or self.sun_exclusion_deg is not None):
            key = "sunlit" if self.sunlit else "sun_exclusion_deg"
            raise ValueError(f"{key} needs the Sun's direction: give sun_direction: [x, y, z], ECI")
        return self

    @property
    def sigmas(self) -> Array:
        """Standard deviations (2,) of both angles, rad."""
        return np.full(2, np.radians(self.angle_sigma_deg))

    def in_reach(self, truth: Sensed) -> Mask:
        """Return where the other craft is in range, in the field of view and in the right light, (runs or 1, K)."""
        return super().in_reach(truth) & self._in_light(truth)

    def _in_light(self, truth: Sensed) -> Mask:
        """Return where light allows a measurement: target outside the Earth's shadow, a cylinder, and off the Sun."""
        seen = np.ones(np.broadcast_shapes(truth.host.shape[:-1], truth.target.shape[:-1]), dtype=bool)
        if self.sun_direction is None:
            return seen
        sun = np.array(self.sun_direction) / np.linalg.norm(self.sun_direction)
        if self.sunlit:
            position = truth.target[..., :3]
            ahead = _along(position, sun)
            from_axis = np.square(position).sum(axis=-1) - ahead * ahead
            seen &= (ahead > 0) | (from_axis > RADIUS_M**2)
        if self.sun_exclusion_deg is not None:
            offset = truth.target[..., :3] - truth.host[..., :3]
            distance = np.sqrt(np.square(offset).sum(axis=-1))
            seen &= _along(offset, sun) < distance * np.cos(np.radians(self.sun_exclusion_deg))
        return seen

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return azimuth and elevation (rad, in (-pi, pi]), (runs, K, 2); NaN where nothing is seen."""
        _, azimuth, elevation = self.true_sight(truth)
        z = streams.noise(truth.times_s)
        z *= self.sigmas
        if self.form == "tangent":
            z[..., 0], z[..., 1] = read_across(azimuth, elevation, z)
        else:
            z = half_open(z + np.stack([azimuth, elevation], axis=-1))
        z[~np.broadcast_to(self.in_reach(truth), z.shape[:-1])] = np.nan
        return z

    def off_pole(self, truth: Sensed) -> Array | None:
        """Return the angle between the line of sight and the azimuth axis, (runs or 1, K), rad; None if tangent."""
        return None if self.form == "tangent" else self.off_azimuth_axis(truth)

    def needs_direction(self) -> tuple[bool, ...]:
        """Return that both angles need the host's attitude and orbit."""
        return (True, True)

    def inputs(self, z: Array, frame: HostFrame) -> dict[Form, Array]:
        """Return azimuth and elevation (rad, in (-pi, pi]) in the frame of the camera as mounted in the orbit frame.

        That is the estimated one; (runs, K, 2), NaN where the host does not know it.
        """
        at_unit_range = np.concatenate([np.ones_like(z[..., :1]), z], axis=-1)
        return {"spherical": self.in_estimated_frame(at_unit_range, frame)[..., 1:]}

    def measurement(self, context: MeasurementContext) -> Measurement:
        """Return the camera as a filter is told of it."""
        law = white_law(noise_parts(self.noise), len(self.channels))
        deviations, nominal = law.scales * self.sigmas, law.nominal * self.sigmas
        if self.form == "spherical":
            # A range of which nothing is read: its sigma does not matter.
            deviations, nominal = np.insert(deviations, 0, 1.0, axis=1), np.insert(nominal, 0, 1.0)
        attitude = self.mounting @ context.attitude @ self.mounting.T
        noise = SightNoise(law.weights, deviations, nominal, attitude, context.assumed_noise)
        if self.form == "spherical":
            return Selected(SphericalRadar(self.mounting, noise, self.host, context.orbit, context.step_s), (1, 2))
        return TangentSight(Sight(self.mounting, self.host, context.orbit, context.step_s), noise)

    def distortion(self, shares: ErrorShares, form: Form) -> Distortion:
        """Return what biases of the angles, and a turn of the body, do to a measurement.

        In tangent form the biases are two constant turns across the line of sight, those of the channels' noise.
        """
        turns = self.mounting @ shares.turn
        errors = radar_errors(shares.channels, turns)
        if self.form == "spherical":
            return AnglesDistortion(errors)
        return AdditiveBias(errors[AZIMUTH : ELEVATION + 1], turns)


def _along(vectors: Array, direction: Array) -> Array:
    """Return the components (...) of vectors (..., 3) along a unit vector (3,)."""
    return vectors[..., 0] * direction[0] + vectors[..., 1] * direction[1] + vectors[..., 2] * direction[2]
