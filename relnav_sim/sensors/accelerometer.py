"""Accelerometer: the specific force that a craft feels, thrust and drag but not gravity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.measurements.channel import Channel
from relnav_sim.options import Effect
from relnav_sim.sensors.interface import Craft, Role, Sensed, SensorOptions
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams


@register_sensor("accelerometer")
class AccelerometerOptions(SensorOptions):
    """Accelerometers: the specific force in the body of their craft, which keeps to its RTN axes, step by step.

    They sense specific force: thrust and drag, not gravity. A measurement is the mean over the step before its epoch,
    and the mean weighted with the time that was left, from which the change of position follows. Both suffer the same
    errors.
    """

    role: ClassVar[Role] = "force"
    channels: ClassVar[tuple[Channel, ...]] = tuple(
        Channel(f"force_{axis}", "m/s^2", f"specific force, {axis}") for axis in ("radial", "along", "normal")
    )
    per_craft: ClassVar[bool] = True
    former_keys: ClassVar[Mapping[str, str]] = {"host": "carrier"}

    error_states: ClassVar[tuple[str, ...]] = ("accelerometer_bias",)
    kind: Literal["accelerometer"] = Field(default="accelerometer", description="Specific force on its host")
    host: Craft | Literal["both"] = Field(
        default="both", description="Craft that carry one; default: both, so that all relative thrust is measured"
    )
    velocity_random_walk_m_s_sqrt_s: Annotated[float, Effect("noise", "noise")] = Field(
        gt=0,
        description="Noise per axis, 1 sigma, of the velocity gained in one second, m/s/sqrt(s); it grows with the "
        "root of time. Tactical grade 1e-3 to 3e-4, navigation grade 1e-4 or less",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of this sigma, that is velocity_random_walk / sqrt(step) in m/s^2, three channels: "
        "one part or a list of parts that add; default: white Gaussian",
    )
    bias_sigma_m_s2: Annotated[float, Effect("bias", "states")] = Field(
        default=0.0, ge=0, description="Standard deviation of each run's constant error per axis, m/s^2; default 0"
    )
    scale_factor_sigma_percent: Annotated[float, Effect("scale factor", "never")] = Field(
        default=0.0,
        ge=0,
        le=30,
        description="Standard deviation of each run's constant scale-factor error per axis, percent; default 0",
    )
    deadband_m_s2: Annotated[float, Effect("dead band", "never")] = Field(
        default=0.0,
        ge=0,
        description="Measurements smaller than this count as no thrust, m/s^2, and so do noise and bias in them; "
        "default 0: none do. Without an estimated bias a filter that adds up the bias all the way is worse than none",
    )

    def bias(self, streams: SensorStreams) -> Array:
        """Return each run's constant error, (runs, 3), m/s^2."""
        return self.bias_sigma_m_s2 * streams.constant("bias", 1, 3)[:, 0]

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the plain and the weighted mean of the measured force, (runs, K, 6), m/s^2, RTN of the host."""
        assert truth.felt is not None  # it says that it `feels`
        errors = streams.constant("scale_factor", 1, 1, 3)
        scale = 1 + self.scale_factor_sigma_percent / 100 * errors
        sigma = self.velocity_random_walk_m_s_sqrt_s / np.sqrt(truth.step_s)
        z = sigma * streams.noise(truth.times_s) + self.bias(streams)[:, None]
        readings = scale * truth.felt + z[:, :, None]
        if self.deadband_m_s2 > 0:
            plain = readings[:, :, 0]
            small = plain[..., 0] ** 2 + plain[..., 1] ** 2 + plain[..., 2] ** 2 < self.deadband_m_s2**2
            readings[small] = 0.0
        return readings.reshape(*readings.shape[:2], 6)
