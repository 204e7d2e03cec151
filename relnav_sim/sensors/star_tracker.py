"""Star tracker: inertial attitude of its host's body."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.attitude import nadir_axes, quaternion_from_axes
from relnav_sim.astro.line_of_sight import ARCSEC, components, rotate, rows
from relnav_sim.measurements.channel import Channel
from relnav_sim.options import AddedLater
from relnav_sim.sensors.interface import Craft, Role, Sensed, SensorOptions
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption, noise_parts, white_variance
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams


@register_sensor("star_tracker")
class StarTrackerOptions(SensorOptions):
    """Star tracker of a craft: its body's attitude at every step.

    Three small turns corrupt the attitude: two across the boresight, and a larger one about it. Without a tracker in
    the campaign the body's attitude in inertial space is known perfectly.
    """

    role: ClassVar[Role] = "attitude"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("cross_1", "rad", "turn about the first axis across the boresight"),
        Channel("cross_2", "rad", "turn about the second axis across the boresight"),
        Channel("about", "rad", "turn about the boresight"),
    )
    error_states: ClassVar[tuple[str, ...]] = ("attitude_error",)
    kind: Literal["star_tracker"] = Field(default="star_tracker", description="Attitude of its host's body")
    host: Annotated[Craft | None, AddedLater()] = Field(
        default=None,
        description="Craft that carries it; default: the one that carries the relative sensors. For the other craft "
        "give a second one, under a name of its own",
    )
    cross_boresight_sigma_arcsec: float = Field(
        gt=0, lt=36000, description="Turn about each axis across the boresight, 1 sigma, arcsec"
    )
    about_boresight_sigma_arcsec: float = Field(
        gt=0, lt=36000, description="Turn about the boresight, 1 sigma, arcsec; commonly 3 to 10 times the other"
    )
    boresight_body: tuple[float, float, float] = Field(
        default=(0.0, 1.0, 0.0),
        description="Direction of the boresight in the body's LVLH frame (x along-track, y minus orbit normal, "
        "z nadir), of any length; default: across the orbit, away from Earth and, mostly, Sun. A turn about the "
        "line of sight does no harm, so a boresight towards the target is the kindest to the radar",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels cross, cross, about: one part or a list of parts that "
        "add; default: white Gaussian. A white share of 0.84 beside a gauss_markov share of 0.55 with tau_s 60 is a "
        "fair picture of a real tracker",
    )

    @field_validator("boresight_body")
    @classmethod
    def _is_direction(cls, boresight: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(boresight):
            raise ValueError("must not be zero: it is a direction")
        return boresight

    @property
    def sigmas(self) -> Array:
        """Standard deviations (3,) of the turns across, across and about the boresight, rad."""
        cross, about = self.cross_boresight_sigma_arcsec, self.about_boresight_sigma_arcsec
        return np.array([cross, cross, about]) * ARCSEC

    @property
    def axes(self) -> Array:
        """The tracker's axes as columns (3, 3) in the body: two across the boresight, and the boresight."""
        boresight = np.array(self.boresight_body) / np.linalg.norm(self.boresight_body)
        first = np.cross(boresight, np.eye(3)[np.argmin(np.abs(boresight))])
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(boresight, first), boresight], axis=1)

    def body_covariance(self) -> Array:
        """Return the covariance (3, 3) of the white error of the attitude, about the body's axes, rad^2."""
        return (self.axes * np.square(self.sigmas)) @ self.axes.T * white_variance(noise_parts(self.noise))

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the body's attitude as a quaternion (x, y, z, w), (runs, K, 4); NaN where there is none.

        The body keeps to the host's LVLH frame. The quaternion turns ECI into body components, v_body = C(q) v_eci;
        scipy's Rotation.from_quat(q) is its inverse, from body to ECI.
        """
        error = rotate(rows(self.axes * self.sigmas), components(streams.noise(truth.times_s)))
        attitude = np.stack(quaternion_from_axes(nadir_axes(truth.host)), axis=-1)
        return kernels.frames.turned(attitude, np.stack(error, axis=-1))
