"""Lidar, or laser rangefinder: range at close distance, or range and two angles."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import half_open
from relnav_sim.measurements.augmented import AdditiveBias, Distortion
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.radar_errors import ELEVATION, RadarDistortion, radar_errors
from relnav_sim.measurements.ranging import GrowingRangeNoise, Ranging
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar, first_fix
from relnav_sim.measurements.tangent_sight import TangentSight
from relnav_sim.options import Effect
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import ErrorShares, Form, MeasurementContext, Sensed
from relnav_sim.sensors.line_of_sight import AngleForm, SightSensorOptions, read_across
from relnav_sim.sensors.noise import (
    GaussianNoise,
    NoiseOption,
    check_parts,
    constant_part,
    has_white_part,
    noise_parts,
    probability_below,
    white_law,
)
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams
from relnav_sim.sensors.told_noise import told_noise

_CHANNELS = (
    Channel("range", "m", "range"),
    Channel("azimuth", "rad", "azimuth", angle=True),
    Channel("elevation", "rad", "elevation", angle=True),
)


@register_sensor("lidar")
class LidarOptions(SightSensorOptions):
    """Lidar that measures the range of the other craft, and with `angle_sigma_deg` azimuth and elevation.

    The range's sigma grows with the true distance: range_sigma_m + range_sigma_m_per_km x distance / km. Mounting,
    field of view and angles are as those of a radar.
    """

    error_states: ClassVar[tuple[str, ...]] = ("range_bias", "azimuth_bias", "elevation_bias", "attitude_error")
    kind: Literal["lidar"] = Field(default="lidar", description="Range, or range and two angles, at close distance")
    range_sigma_m: float = Field(gt=0, description="Range noise at no distance, 1 sigma, m")
    range_sigma_m_per_km: float = Field(
        default=0.0, ge=0, description="What a kilometre of distance adds to the range's sigma, m; default 0"
    )
    angle_sigma_deg: float | None = Field(
        default=None,
        gt=0,
        lt=90,
        description="Noise of azimuth and of elevation, 1 sigma, deg; default: it measures the range alone",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels range, or range, azimuth, elevation: one part or a list "
        "of parts that add; default: white Gaussian",
    )
    form: AngleForm = Field(
        default="spherical",
        description="What the noise of the angles is, in truth and for the filters: spherical (of azimuth and "
        "elevation themselves, which have a pole on the z axis; default) or tangent (two small turns across the line "
        "of sight, alike in every direction)",
    )
    range_bias_m: Annotated[float, Effect("range bias", "states", ("range_bias",))] = Field(
        default=0.0, description="Constant range error, m; no filter is told of it; default 0"
    )

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]  # here they depend on the options
        """The range, or range, azimuth and elevation."""
        return _CHANNELS[:1] if self.angle_sigma_deg is None else _CHANNELS

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        if not has_white_part(noise_parts(noise)):
            raise ValueError("the noise needs a gaussian or mixture part: no filter can weigh it without")
        return noise

    @model_validator(mode="after")
    def _fits_the_channels(self) -> LidarOptions:
        check_parts(noise_parts(self.noise), len(self.channels))
        return self

    @property
    def sigmas(self) -> Array:
        """Standard deviations of range at no distance (m), and of azimuth and elevation (rad), (1,) or (3,)."""
        angles = [] if self.angle_sigma_deg is None else [self.angle_sigma_deg] * 2
        return np.array([self.range_sigma_m, *np.radians(angles)])

    def range_sigma(self, distance: Array) -> Array:
        """Return the range's sigma at a distance, m."""
        return np.asarray(self.range_sigma_m + 1e-3 * self.range_sigma_m_per_km * distance)

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return range (m), or range, azimuth and elevation (rad, in (-pi, pi]), (runs, K, m); NaN where none is read.

        A measurement whose range would not be positive does not exist.
        """
        sight = self.true_sight(truth)
        z = streams.noise(truth.times_s)
        z[..., 0] *= self.range_sigma(sight[0])
        z[..., 0] += sight[0] + self.range_bias_m
        if self.angle_sigma_deg is not None:
            z[..., 1:] *= self.sigmas[1:]
            if self.form == "tangent":
                z[..., 1], z[..., 2] = read_across(sight[1], sight[2], z[..., 1:])
            else:
                z[..., 1:] = half_open(z[..., 1:] + np.stack(sight[1:], axis=-1))
        measured = self.sees(sight) & (z[..., 0] > 0)
        if not measured.all():
            z[~measured] = np.nan
        return z

    def slow_errors(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the errors of the channels that are not white; a bias in sigmas grows with the distance."""
        constant = constant_part(noise_parts(self.noise), len(self.channels))
        distance = self.true_sight(truth)[0]
        errors = np.empty((*distance.shape, len(self.channels)))
        errors[...] = constant * self.sigmas
        errors[..., 0] = constant[0] * self.range_sigma(distance) + self.range_bias_m
        return errors

    def off_pole(self, truth: Sensed) -> Array | None:
        """Return the angle between the line of sight and the azimuth axis, rad; None without angles or if tangent."""
        return None if self.angle_sigma_deg is None or self.form == "tangent" else self.off_azimuth_axis(truth)

    def no_echo(self, distance: Array) -> Array:
        """Return the probability of a measurement that does not exist because its range would not be positive."""
        level = -(distance + self.range_bias_m) / self.range_sigma(distance)
        return probability_below(noise_parts(self.noise), len(self.channels), 0, level)

    def needs_direction(self) -> tuple[bool, ...]:
        """Return that the angles need the host's attitude and orbit, and the range does not."""
        return (False, True, True)[: len(self.channels)]

    def inputs(self, z: Array, frame: HostFrame) -> dict[Form, Array]:
        """Return what filters take: the angles are those in the lidar's frame as mounted in the estimated orbit frame.

        There is no Cartesian form: its noise would have to be taken at a range that is not known.
        """
        return {"spherical": z if self.angle_sigma_deg is None else self.in_estimated_frame(z, frame)}

    def measurement(self, context: MeasurementContext) -> Measurement:
        """Return the lidar as a filter is told of it, its R at the predicted range."""
        base: Measurement
        if self.angle_sigma_deg is None:
            base = Ranging(told_noise(self.noise, self.sigmas, context.assumed_noise))
        else:
            law = white_law(noise_parts(self.noise), len(self.channels))
            noise = SightNoise(
                weights=law.weights,
                deviations=law.scales * self.sigmas,
                nominal=law.nominal * self.sigmas,
                attitude=self.mounting @ context.attitude @ self.mounting.T,
                assumed=context.assumed_noise,
            )
            if self.form == "tangent":
                base = TangentSight(Sight(self.mounting, self.host, context.orbit, context.step_s), noise)
            else:
                base = SphericalRadar(self.mounting, noise, self.host, context.orbit, context.step_s)
        if not self.range_sigma_m_per_km:
            return base
        return GrowingRangeNoise(base, 1e-3 * self.range_sigma_m_per_km / self.range_sigma_m)

    def distortion(self, shares: ErrorShares, form: Form) -> Distortion:
        """Return what biases, and with angles a turn of the body, do to a measurement; tangent as a radar's."""
        turns = self.mounting @ shares.turn
        errors = radar_errors(shares.channels, turns)
        if self.angle_sigma_deg is None:
            return AdditiveBias(errors[:1])
        return AdditiveBias(errors[: ELEVATION + 1], turns) if self.form == "tangent" else RadarDistortion(errors)

    @property
    def gives_fix(self) -> bool:
        """Whether one measurement gives a position: with angles."""
        return self.angle_sigma_deg is not None

    def first_fix(self, measurement: Measurement, z: Array) -> tuple[Array, Array] | None:
        """Return the position that range and angles give, and its covariance to first order; None without angles."""
        if not self.gives_fix:
            return None
        radar = measurement.base if isinstance(measurement, GrowingRangeNoise) else measurement
        assert isinstance(radar, SphericalRadar | TangentSight)  # its own
        return first_fix(radar, z, noise=measurement.noise)
