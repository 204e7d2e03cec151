"""An error that grows with time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect
from relnav_sim.sensors.noise.fault import FaultOptions, Values
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting


class RampNoise(FaultOptions):
    """A fault: an error that grows linearly from nothing, the same in every run: a drift, a spoofed signal.

    It is the hardest to edit: each measurement fits the ones before it.
    """

    stream: ClassVar[str] = "ramp"
    effect: ClassVar[Effect] = Effect("fault: ramp", "never")

    kind: Literal["ramp"] = Field(default="ramp", description="Error that grows with time")
    rate_per_s: Values = Field(
        description="Growth, sigmas of the sensor a second: one number for all channels, or a list with one for each"
    )

    @property
    def per_channel(self) -> Values:
        """The growth."""
        return self.rate_per_s

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        return _Ramp(self, np.broadcast_to(np.array(self.rate_per_s, dtype=float), setting.channels))


@dataclass(frozen=True)
class _Ramp:
    fault: RampNoise
    rate: Array

    def sample(self, times_s: Array) -> Array:
        grown = np.where(self.fault.on(times_s), times_s - self.fault.from_s, 0.0)
        return grown[None, :, None] * self.rate
