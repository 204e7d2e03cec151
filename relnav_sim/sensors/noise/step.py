"""An error that appears at once and stays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect
from relnav_sim.sensors.noise.fault import FaultOptions, Values
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting


class StepNoise(FaultOptions):
    """A fault: a constant error that appears at once, the same in every run: a shifted mount, a wrong calibration."""

    stream: ClassVar[str] = "step"
    effect: ClassVar[Effect] = Effect("fault: step", "never")

    kind: Literal["step"] = Field(default="step", description="Error that appears at once")
    value: Values = Field(
        description="Error in sigmas of the sensor: one number for all channels, or a list with one for each"
    )

    @property
    def per_channel(self) -> Values:
        """The error."""
        return self.value

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        return _Step(self, np.broadcast_to(np.array(self.value, dtype=float), setting.channels))


@dataclass(frozen=True)
class _Step:
    fault: StepNoise
    value: Array

    def sample(self, times_s: Array) -> Array:
        return np.where(self.fault.on(times_s)[None, :, None], self.value, 0.0)
