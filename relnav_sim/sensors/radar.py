"""Radar: range, azimuth and elevation of the other craft."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, half_open, rotate, rows, sight_vector
from relnav_sim.measurements.augmented import AdditiveBias, Distortion
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.converted_radar import Conversion, ConvertedRadar, conversion
from relnav_sim.measurements.converted_tangent_radar import ConvertedTangentRadar, tangent_shrinkage
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.radar_errors import AZIMUTH, ELEVATION, RadarDistortion, radar_errors
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar, first_fix
from relnav_sim.measurements.tangent_sight import TangentSight
from relnav_sim.options import AddedLater, Effect
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import Craft, ErrorShares, Form, MeasurementContext, Sensed
from relnav_sim.sensors.line_of_sight import AngleForm, SightSensorOptions, read_across
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption, noise_parts, probability_below, white_law
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams

_RTN_FROM_NADIR = rows(NADIR_FROM_RTN.T)


@register_sensor("radar")
class RadarOptions(SightSensorOptions):
    """Radar that measures range, azimuth and elevation of the other craft.

    It is mounted in a body that keeps to its host's LVLH frame: x along-track, y minus orbit normal, z nadir.
    Azimuth counts from the radar's x axis towards y, elevation towards minus z. GNSS receiver and star tracker of the
    same craft, if any, tell it where it points.
    """

    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("range", "m", "range"),
        Channel("azimuth", "rad", "azimuth", angle=True),
        Channel("elevation", "rad", "elevation", angle=True),
    )
    forms: ClassVar[tuple[Form, ...]] = ("spherical", "cartesian")
    linear_forms: ClassVar[tuple[Form, ...]] = ("cartesian",)
    former_keys: ClassVar[Mapping[str, str]] = {"host": "carrier"}

    error_states: ClassVar[tuple[str, ...]] = ("range_bias", "azimuth_bias", "elevation_bias", "attitude_error")
    kind: Literal["radar"] = Field(default="radar", description="Range, azimuth and elevation of the other craft")
    host: Craft = Field(
        default="chief",
        description="Craft that carries the radar and sees the other one; default: the chief (Shi et al. 2025). In "
        "Wei, Song and Zhang (2012) it is the deputy",
    )
    range_sigma_m: float = Field(gt=0, description="Range noise, 1 sigma, m")
    angle_sigma_deg: float = Field(gt=0, lt=90, description="Noise of azimuth and of elevation, 1 sigma, deg")
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels range, azimuth, elevation: one part or a list of parts "
        "that add; default: white Gaussian",
    )
    form: Annotated[AngleForm, AddedLater()] = Field(
        default="spherical",
        description="What the noise of the angles is, in truth and for the filters: spherical (of azimuth and "
        "elevation themselves, which have a pole on the z axis; default) or tangent (two small turns across the line "
        "of sight, alike in every direction)",
    )
    range_bias_m: Annotated[float, Effect("range bias", "states", ("range_bias",))] = Field(
        default=0.0, description="Constant range error, m; no filter is told of it"
    )
    azimuth_bias_deg: Annotated[float, Effect("azimuth bias", "states", ("azimuth_bias", "attitude_error"))] = Field(
        default=0.0, description="Constant azimuth error, deg; no filter is told of it"
    )
    elevation_bias_deg: Annotated[float, Effect("elevation bias", "states", ("elevation_bias", "attitude_error"))] = (
        Field(default=0.0, description="Constant elevation error, deg; no filter is told of it")
    )
    period_s: Annotated[float | None, Effect("period", "absence")] = Field(
        default=None,
        gt=0,
        description="Time between measurements, s, a multiple of the clock's step; default: every step",
    )

    @property
    def sigmas(self) -> Array:
        """Standard deviations (3,) of range (m), azimuth and elevation (rad)."""
        angle = np.radians(self.angle_sigma_deg)
        return np.array([self.range_sigma_m, angle, angle])

    @property
    def biases(self) -> Array:
        """Constant errors (3,) of range (m), azimuth and elevation (rad), beside those in the noise."""
        return np.array([self.range_bias_m, *np.radians([self.azimuth_bias_deg, self.elevation_bias_deg])])

    def constant_errors(self) -> Array:
        """Return the constant errors (3,) of range (m), azimuth and elevation (rad); NaN where they drift."""
        return self.biases + super().constant_errors()

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return range (m), azimuth and elevation (rad, in (-pi, pi]), (runs, K, 3); NaN where nothing is measured.

        A measurement whose range would not be positive does not exist.
        """
        sight = self.true_sight(truth)
        z = streams.noise(truth.times_s)
        z *= self.sigmas
        if self.form == "tangent":
            z += self.biases
            z[..., 0] += sight[0]
            z[..., 1], z[..., 2] = read_across(sight[1], sight[2], z[..., 1:])
        else:
            z += np.stack(sight, axis=-1) + self.biases
            z[..., 1:] = half_open(z[..., 1:])
        # A radar finds no echo before it has sent its pulse.
        measured = self.sees(sight) & (z[..., 0] > 0)
        if not measured.all():
            z[~measured] = np.nan
        return z

    def off_pole(self, truth: Sensed) -> Array | None:
        """Return the angle between the line of sight and the azimuth axis, (runs or 1, K), rad; None if tangent."""
        return None if self.form == "tangent" else self.off_azimuth_axis(truth)

    def no_echo(self, distance: Array) -> Array:
        """Return the probability of a measurement that does not exist because its range would not be positive."""
        level = -(distance + self.range_bias_m) / self.range_sigma_m
        return probability_below(noise_parts(self.noise), len(self.channels), 0, level)

    def needs_direction(self) -> tuple[bool, ...]:
        """Return that the angles need the host's attitude and orbit, and the range does not."""
        return (False, True, True)

    def inputs(self, z: Array, frame: HostFrame) -> dict[Form, Array]:
        """Return what filters take.

        ``spherical``: range (m), azimuth and elevation (rad, in (-pi, pi]) in the radar frame as mounted in the
        estimated orbit frame, (runs, K, 3); the angles are NaN where the host does not know it. ``cartesian``, with the
        radar on the chief: the deputy's position relative to it, RTN (m), (runs, K, 3), unbiased.
        """
        inputs: dict[Form, Array] = {"spherical": self.in_estimated_frame(z, frame)}
        if self.host == "chief":
            sight = sight_vector(z[..., 0], z[..., 1], z[..., 2])
            law = white_law(noise_parts(self.noise), len(self.channels))
            if self.form == "tangent":
                factor = tangent_shrinkage(law.weights, law.scales * self.sigmas)
                shrinkage = Conversion(factor, factor)
            else:
                shrinkage = conversion(law.weights, law.scales * self.sigmas)
            unbiased = (sight[0] / shrinkage.level, sight[1] / shrinkage.level, sight[2] / shrinkage.height)
            body = rotate(rows(self.mounting.T), unbiased)
            nadir = body if frame.body_to_orbit is None else frame.body_to_orbit(body)
            inputs["cartesian"] = np.stack(rotate(_RTN_FROM_NADIR, nadir), axis=-1)
        return inputs

    def measurement(self, context: MeasurementContext) -> Measurement:
        """Return the radar as a filter is told of it.

        Raises:
            ValueError: It is on the deputy and the Cartesian form is wanted.
        """
        law = white_law(noise_parts(self.noise), len(self.channels))
        noise = SightNoise(
            weights=law.weights,
            deviations=law.scales * self.sigmas,
            nominal=law.nominal * self.sigmas,
            attitude=self.mounting @ context.attitude @ self.mounting.T,
            assumed=context.assumed_noise,
        )
        if context.form == "spherical":
            if self.form == "tangent":
                return TangentSight(Sight(self.mounting, self.host, context.orbit, context.step_s), noise)
            return SphericalRadar(self.mounting, noise, self.host, context.orbit, context.step_s)
        if self.host == "deputy":
            raise ValueError(
                "a radar on the deputy gives no Cartesian measurement: its orbit frame turns with the state; take "
                "spherical"
            )
        return (ConvertedTangentRadar if self.form == "tangent" else ConvertedRadar)(self.mounting, noise)

    def distortion(self, shares: ErrorShares, form: Form) -> Distortion:
        """Return what biases of range and angles, and a turn of the body, do to a measurement.

        In tangent form the biases of the angles are two constant turns across the line of sight, those of the noise.

        Raises:
            ValueError: These are wanted of a converted position.
        """
        turns = self.mounting @ shares.turn
        errors = radar_errors(shares.channels, turns)
        if form == "cartesian":
            if self.form == "tangent" and errors[AZIMUTH : ELEVATION + 1].any():
                raise ValueError(
                    "a position converted from tangent angles can't carry their biases, which turn with the line of "
                    "sight; take measurement: spherical, or form: spherical on the radar"
                )
            return RadarDistortion(errors, self.mounting @ NADIR_FROM_RTN)
        return AdditiveBias(errors[: ELEVATION + 1], turns) if self.form == "tangent" else RadarDistortion(errors)

    def first_fix(self, measurement: Measurement, z: Array) -> tuple[Array, Array] | None:
        """Return the position that range and angles give, and its covariance to first order."""
        assert isinstance(measurement, SphericalRadar | TangentSight)  # its own, in the spherical form
        return first_fix(measurement, z)
