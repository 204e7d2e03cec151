"""Crosslink: range, or range and range rate, from a radio link between the craft, with the error of their clocks."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from relnav_sim.arrays import Array
from relnav_sim.dynamics.augmentation.kinds import AugmentedStateOption, ClockOptions, RangeBiasOptions
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.ranging import Ranging
from relnav_sim.options import Effect
from relnav_sim.sensors.interface import MeasurementContext, RelativeSensorOptions, Sensed
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption, check_parts, noise_parts, probability_below
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams
from relnav_sim.sensors.told_noise import told_noise

_CHANNELS = (Channel("range", "m", "range"), Channel("range_rate", "m/s", "range rate"))


@register_sensor("crosslink")
class CrosslinkOptions(RelativeSensorOptions):
    """Radio link between the craft that measures their range, and with `range_rate_sigma_m_s` its rate too.

    From either craft alike. A link that compares two free clocks (one-way) is off by their difference: by a bias and a
    drift that each run draws once. Lever arms of the antennas are left out, and it needs no attitude.
    """

    error_states: ClassVar[tuple[str, ...]] = ("range_bias", "clock")
    kind: Literal["crosslink"] = Field(
        default="crosslink", description="Range, or range and range rate, over a radio link"
    )
    range_sigma_m: float = Field(gt=0, description="Range noise, 1 sigma, m")
    range_rate_sigma_m_s: float | None = Field(
        default=None, gt=0, description="Range-rate noise, 1 sigma, m/s; default: it measures the range alone"
    )
    clock_bias_sigma_m: Annotated[float, Effect("clock bias", "states", ("clock",))] = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of each run's difference of the clocks at time 0 times the speed of light, m, "
        "which adds to the range; a filter can estimate it as `clock`; default 0",
    )
    clock_drift_sigma_m_s: Annotated[float, Effect("clock drift", "states", ("clock",))] = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of each run's constant rate of that difference, m/s (1 m/s is 3.3e-9 s/s), "
        "which adds to the range rate; default 0",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels range, or range, range rate: one part or a list of parts "
        "that add; default: white Gaussian",
    )

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        return cls.with_white_part(noise)  # how many channels there are is known when all is read

    @model_validator(mode="after")
    def _fits_the_channels(self) -> CrosslinkOptions:
        check_parts(noise_parts(self.noise), len(self.channels))
        if self.range_rate_sigma_m_s is None and self.clock_drift_sigma_m_s:
            raise ValueError(
                "clocks that drift move the range rate, which this link does not read; give range_rate_sigma_m_s, or "
                "leave clock_drift_sigma_m_s out"
            )
        return self

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]  # they depend on what is read
        """The range, or range and range rate."""
        return _CHANNELS[:1] if self.range_rate_sigma_m_s is None else _CHANNELS

    @property
    def sigmas(self) -> Array:
        """Standard deviations (m,) of range (m) and, where it is read, range rate (m/s)."""
        return np.array([self.range_sigma_m, self.range_rate_sigma_m_s or 0.0])[: len(self.channels)]

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return range (m) and, where it is read, range rate (m/s), (runs, K, m); NaN where nothing is read.

        A measurement whose range, but for the clocks, would not be positive does not exist: no signal comes before it
        is sent, while a wrong clock can well say so.
        """
        offset = truth.target - truth.host
        r, v = offset[..., :3], offset[..., 3:]
        distance = np.sqrt(np.square(r).sum(axis=-1))
        # Where the craft meet there is no range rate; the measurement is left out below.
        rate = (r * v).sum(axis=-1) / np.where(distance > 0, distance, 1.0)
        z = streams.noise(truth.times_s)
        z *= self.sigmas
        z += np.stack([distance, rate], axis=-1)[..., : z.shape[-1]]
        measured = self.in_reach(truth) & (z[..., 0] > 0)
        z += self._clock(truth.times_s, streams)
        if not measured.all():
            z[~measured] = np.nan
        return z

    def slow_errors(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the error of the clocks and the constant errors, (runs, K, m); NaN where noise drifts on top."""
        return self._clock(truth.times_s, streams) + self.constant_errors()

    def _clock(self, times_s: Array, streams: SensorStreams) -> Array:
        """Return what the clocks add to range (m) and range rate (m/s), (runs, K, m)."""
        bias, drift = (streams.constant("clock", 2) * [self.clock_bias_sigma_m, self.clock_drift_sigma_m_s]).T
        rate = np.broadcast_to(drift[:, None], (len(drift), len(times_s)))
        return np.stack([bias[:, None] + rate * times_s, rate], axis=-1)[..., : len(self.channels)]

    def drawn_errors(self) -> tuple[AugmentedStateOption, ...]:
        """Return the error of the clocks."""
        if not self.clock_drift_sigma_m_s:
            return (RangeBiasOptions(sigma_m=self.clock_bias_sigma_m),) if self.clock_bias_sigma_m else ()
        # A bias a millionth of the noise is as good as none, and keeps covariances definite.
        bias = self.clock_bias_sigma_m or 1e-6 * self.range_sigma_m
        return (ClockOptions(sigma_m=bias, drift_sigma_m_s=self.clock_drift_sigma_m_s),)

    def no_echo(self, distance: Array) -> Array:
        """Return the probability of a measurement that does not exist because its range would not be positive."""
        return probability_below(noise_parts(self.noise), len(self.channels), 0, -distance / self.range_sigma_m)

    def measurement(self, context: MeasurementContext) -> Ranging:
        """Return the link as a filter is told of it, without clock errors; `clock` states bring them in."""
        return Ranging(told_noise(self.noise, self.sigmas, context.assumed_noise))
