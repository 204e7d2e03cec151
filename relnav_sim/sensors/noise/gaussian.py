"""White Gaussian noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect, Options
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting
from relnav_sim.streams import Streams


class GaussianNoise(Options):
    """White Gaussian noise, independent in every channel and epoch: thermal noise, quantisation."""

    stream: ClassVar[str] = "white"
    effect: ClassVar[Effect] = Effect("noise", "noise")

    kind: Literal["gaussian"] = Field(default="gaussian", description="White Gaussian noise")
    scale: float = Field(
        default=1.0,
        gt=0,
        description="Standard deviation in sigmas of the sensor; default 1: the sensor's sigma is the noise's. "
        "Below 1 it is the white share beside a gauss_markov part",
    )

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        return _Gaussian(setting.streams(), self.scale, setting.channels)


@dataclass(frozen=True)
class _Gaussian:
    normals: Streams
    scale: float
    channels: int

    def sample(self, times_s: Array) -> Array:
        draws = self.normals.normal(len(times_s), self.channels)
        draws *= self.scale
        return draws
