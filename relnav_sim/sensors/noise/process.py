"""What every kind of noise is built from: the setting of its sensor, and the process that samples it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.streams import RandomSource, Streams


class NoiseProcess(Protocol):
    """One noise of one sensor over one block of runs; it remembers where the last chunk ended."""

    def sample(self, times_s: Array) -> Array:
        """Return the noise at the next epochs, in sigmas: broadcasts to (runs, len(times_s), channels)."""
        ...


class Silent:
    """A process that adds nothing: that of a fault which changes measurements in another way."""

    def sample(self, times_s: Array) -> Array:
        """Return zeros."""
        return np.zeros((1, len(times_s), 1))


@dataclass(frozen=True)
class NoiseSetting:
    """Where a noise process works.

    Attributes:
        name: The first part of its random streams' names, ``sensor.radar.white`` say.
        source: The block's seed and run numbers.
        channels: Components of the sensor's measurement.
        step_s: Time between epochs, s.
    """

    name: str
    source: RandomSource
    channels: int
    step_s: float

    def streams(self, draw: str = "") -> Streams:
        """Return the streams for one kind of draw, one generator per run."""
        return self.source.streams(f"{self.name}.{draw}" if draw else self.name)
