"""The random numbers of one sensor over one block of runs."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.arrays import Array
from relnav_sim.sensors.jumps import Jumps
from relnav_sim.sensors.noise import Fault, Noise, NoisePart, faults_of
from relnav_sim.streams import RandomSource, Streams


class SensorStreams:
    """Random numbers that go on from one chunk of epochs to the next, under names that begin with the sensor's.

    Two sensors of a campaign have different names, so that they share no noise, and the numbers of one do not depend on
    whether there is another.

    Args:
        name: The sensor's name in the campaign, with the craft behind it where both carry one.
        parts: Its noise.
        channels: Numbers of a measurement.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.

    Attributes:
        faults: Its faults that do not add to the measurements.
    """

    faults: Sequence[Fault] = ()

    def __init__(
        self, name: str, parts: Sequence[NoisePart], channels: int, source: RandomSource, step_s: float
    ) -> None:
        self._name = name
        self._source = source
        self._noise = Noise(parts, name, source, channels, step_s)
        self.faults = faults_of(parts)
        self._going: dict[str, Streams] = {}
        self._constants: dict[str, Array] = {}
        self._jumps: dict[str, Jumps] = {}

    @property
    def runs(self) -> int:
        """Runs of the block."""
        return len(self._source.runs)

    def noise(self, times_s: Array) -> Array:
        """Return the noise at the next epochs (K,), in sigmas, (runs, K, m), a fresh array; NaN during outages."""
        return self._noise.sample(times_s)

    def normal(self, word: str, epochs: int, *shape: int) -> Array:
        """Return further standard normal numbers of the stream of this word, (runs, epochs, *shape)."""
        if word not in self._going:
            self._going[word] = self._source.streams(f"sensor.{self._name}.{word}")
        return self._going[word].normal(epochs, *shape)

    def uniform(self, word: str, epochs: int, *shape: int) -> Array:
        """Return further numbers uniform on [0, 1) of the stream of this word, (runs, epochs, *shape)."""
        if word not in self._going:
            self._going[word] = self._source.streams(f"sensor.{self._name}.{word}")
        return self._going[word].uniform(epochs, *shape)

    def jumps(self, word: str, epochs: int, chance: float, held: int, channels: int) -> Array:
        """Return errors that jump and stay for a while, in sigmas, (runs, epochs, channels); see `Jumps`."""
        if word not in self._jumps:
            switches, sizes = (self._source.streams(f"sensor.{self._name}.{word}{part}") for part in (".switch", ""))
            self._jumps[word] = Jumps(switches, sizes, chance, held, channels)
        return self._jumps[word].sample(epochs)

    def constant(self, word: str, *shape: int) -> Array:
        """Return the standard normal numbers of this word that each run keeps, (runs, *shape)."""
        if word not in self._constants:
            self._constants[word] = self._source.streams(f"sensor.{self._name}.{word}").normal(*shape)
        return self._constants[word]
