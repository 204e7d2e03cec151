"""A constant error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect, Options
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting


class BiasNoise(Options):
    """A constant error, the same in every run. A constant drawn anew for each run is `gauss_markov` with a long tau_s.

    No filter is told of it. The radar also takes its biases in m and deg (`range_bias_m` and so on).
    """

    stream: ClassVar[str] = "bias"
    effect: ClassVar[Effect] = Effect("constant error", "states")

    kind: Literal["bias"] = Field(default="bias", description="Constant error")
    value: float | tuple[float, ...] = Field(
        description="Error in sigmas of the sensor: one number for all channels, or a list with one for each"
    )

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        return _Bias(np.broadcast_to(np.array(self.value, dtype=float), setting.channels))


@dataclass(frozen=True)
class _Bias:
    value: Array

    def sample(self, times_s: Array) -> Array:
        return self.value[None, None]
