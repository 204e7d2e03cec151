"""Accelerometer: the specific force that a craft feels, thrust and drag but not gravity."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from relnav_sim.options import Options
from relnav_sim.sensors.noise import GaussianNoise, Noise, NoiseOption, check_parts, noise_parts
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]
Craft = Literal["chief", "deputy"]
CHANNELS = 3


class AccelerometerOptions(Options):
    """Accelerometers: the specific force in the body of their craft, which keeps to its RTN axes, step by step.

    They feel thrust and drag, not gravity. A reading is the mean over the step before its epoch, and the mean weighted
    with the time that was left, from which the change of position follows. Both suffer the same errors.
    """

    carrier: Literal["both", "chief", "deputy"] = Field(
        default="both", description="Craft that carry one; default: both, so that all relative thrust is measured"
    )
    velocity_random_walk_m_s_sqrt_s: float = Field(
        gt=0,
        description="Noise per axis, 1 sigma, of the velocity gained in one second, m/s/sqrt(s); it grows with the "
        "root of time. Tactical grade 1e-3 to 3e-4, navigation grade 1e-4 or less",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of this sigma, that is velocity_random_walk / sqrt(step) in m/s^2, three channels: "
        "one part or a list of parts that add; default: white Gaussian",
    )
    bias_sigma_m_s2: float = Field(
        default=0.0, ge=0, description="Standard deviation of each run's constant error per axis, m/s^2; default 0"
    )
    scale_factor_sigma_percent: float = Field(
        default=0.0,
        ge=0,
        le=30,
        description="Standard deviation of each run's constant scale-factor error per axis, percent; default 0",
    )
    deadband_m_s2: float = Field(
        default=0.0,
        ge=0,
        description="Readings shorter than this count as no thrust, m/s^2, and so do noise and bias in them; default "
        "0: none do. Without an estimated bias a filter that adds up the bias all the way is worse than none",
    )

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        check_parts(noise_parts(noise), CHANNELS)
        return noise

    @property
    def craft(self) -> tuple[Craft, ...]:
        """The craft that carry one."""
        return ("chief", "deputy") if self.carrier == "both" else (self.carrier,)


def constant_bias(options: AccelerometerOptions, craft: Craft, source: RandomSource) -> Array:
    """Return each run's constant error of one craft's accelerometer, (runs, 1, 3), m/s^2."""
    return options.bias_sigma_m_s2 * source.streams(f"sensor.accelerometer.{craft}.bias").normal(1, CHANNELS)


class Accelerometer:
    """The accelerometer of one craft over one block of runs.

    Args:
        options: How badly it measures.
        craft: The craft that carries it.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.
    """

    def __init__(self, options: AccelerometerOptions, craft: Craft, source: RandomSource, step_s: float) -> None:
        name = f"accelerometer.{craft}"
        self._sigma = options.velocity_random_walk_m_s_sqrt_s / np.sqrt(step_s)
        self._deadband = options.deadband_m_s2
        self._noise = Noise(noise_parts(options.noise), name, source, CHANNELS, step_s)
        self._bias = constant_bias(options, craft, source)
        errors = source.streams(f"sensor.{name}.scale_factor").normal(1, 1, CHANNELS)
        self._scale = 1 + options.scale_factor_sigma_percent / 100 * errors

    def measure(self, times_s: Array, felt: Array) -> Array:
        """Return the plain and the weighted mean of the measured force, (runs, K, 6), m/s^2, RTN of the craft.

        Args:
            times_s: Epochs (K,), the ones that follow the last call's.
            felt: True means of both kinds, (runs or 1, K, 2, 3), m/s^2.
        """
        z = self._sigma * self._noise.sample(times_s) + self._bias
        readings = self._scale * felt + z[:, :, None]
        if self._deadband > 0:
            plain = readings[:, :, 0]
            small = plain[..., 0] ** 2 + plain[..., 1] ** 2 + plain[..., 2] ** 2 < self._deadband**2
            readings[small] = 0.0
        return readings.reshape(*readings.shape[:2], 2 * CHANNELS)
