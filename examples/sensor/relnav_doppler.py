"""A sensor for relnav in a package of its own: copy it, rename it, and change what it reads."""

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relnav_sim import FunctionMeasurement, register_sensor
from relnav_sim.sensors import Channel, MeasurementContext, RelativeSensorOptions, Sensed
from relnav_sim.sensors.noise import noise_parts, white_variance
from relnav_sim.sensors.streams import SensorStreams

Array = NDArray[np.float64]


@register_sensor("doppler")
class DopplerOptions(RelativeSensorOptions):
    """Range rate of the other craft by the Doppler shift of its carrier; no range and no angles.

    z = u . v with u the unit vector to the other craft and v the relative velocity; it does not matter in which axes,
    nor which craft carries the receiver. Montenbruck and Gill, Satellite Orbits, 2000, section 6.1.
    """

    channels: ClassVar[tuple[Channel, ...]] = (Channel("range_rate", "m/s", "range rate"),)

    kind: Literal["doppler"] = Field(default="doppler", description="Range rate by the Doppler shift")
    range_rate_sigma_m_s: float = Field(gt=0, description="Range-rate noise, 1 sigma, m/s")

    @property
    def sigmas(self) -> Array:
        """Standard deviation (1,) of the range rate, m/s."""
        return np.array([self.range_rate_sigma_m_s])

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return range rates (runs, K, 1), m/s; NaN out of reach."""
        offset = truth.target - truth.host
        z = range_rate(offset) + self.sigmas * streams.noise(truth.times_s)
        return np.where(self.in_reach(truth)[..., None], z, np.nan)

    def measurement(self, context: MeasurementContext) -> FunctionMeasurement:
        """Return the range rate as a function of the state, with the variance of its white noise."""
        variance = self.range_rate_sigma_m_s**2 * white_variance(noise_parts(self.noise))
        return FunctionMeasurement(lambda states, epoch: range_rate(states), np.array([[variance]]))


def range_rate(states: Array) -> Array:
    """Return u . v of relative states (..., n), position first, (..., 1)."""
    position, velocity = states[..., :3], states[..., 3:6]
    return (position * velocity).sum(axis=-1, keepdims=True) / np.linalg.norm(position, axis=-1, keepdims=True)
