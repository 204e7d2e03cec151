"""GNSS receiver: inertial position and velocity of its host."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.frame_error import frame_covariance
from relnav_sim.measurements.channel import Channel
from relnav_sim.options import AddedLater
from relnav_sim.sensors.interface import ECI_STATE, Craft, Role, Sensed, SensorOptions
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption, noise_parts, white_variance
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams


@register_sensor("gnss")
class GnssOptions(SensorOptions):
    """GNSS receiver of a craft: its ECI position and velocity at every step.

    The front end builds the orbit frame from them. Without a receiver in the campaign the orbit frame is perfect.
    """

    role: ClassVar[Role] = "orbit"
    channels: ClassVar[tuple[Channel, ...]] = ECI_STATE
    kind: Literal["gnss"] = Field(default="gnss", description="Position and velocity of its host, ECI")
    host: Annotated[Craft | None, AddedLater()] = Field(
        default=None,
        description="Craft that carries it; default: the one that carries the relative sensors. For the other craft "
        "give a second one, under a name of its own",
    )
    position_sigma_m: float = Field(gt=0, description="Position noise per axis, 1 sigma, m")
    velocity_sigma_m_s: float = Field(gt=0, description="Velocity noise per axis, 1 sigma, m/s")
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, three channels of position and three of velocity: one part or a "
        "list of parts that add; default: white Gaussian. Real solutions are largely gauss_markov, tau_s 100 to 3600",
    )

    @property
    def sigmas(self) -> Array:
        """Standard deviations (6,), m and m/s."""
        return np.repeat([self.position_sigma_m, self.velocity_sigma_m_s], 3)

    def frame_covariance(self, radius_m: float, speed_m_s: float) -> Array:
        """Return the covariance (6, 6) of the white error of the computed orbit frame; see `astro.frame_error`."""
        root = np.diag(self.sigmas)
        return frame_covariance(root, radius_m, speed_m_s) * white_variance(noise_parts(self.noise))

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the measured ECI states (runs, K, 6), m and m/s; NaN where there is no solution."""
        z = streams.noise(truth.times_s)
        z *= self.sigmas
        z += truth.host
        return z
