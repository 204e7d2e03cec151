"""One error at a time: sensors whose measurements are perfect but for an error that is put in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.sensors.interface import Craft, SensorOptions
from relnav_sim.sensors.noise import NoisePart, OutageNoise, noise_parts
from relnav_sim.sensors.streams import SensorStreams
from relnav_sim.sensors.suite import StreamsMaker
from relnav_sim.streams import RandomSource

SIZE = 1e-3
"""Of an injected error, in sigmas: the answer is then linear to about a millionth, and rounding is far below."""

Draw = Literal["noise", "constant", "each"]
"""What a sensor asks its streams for: the noise of its channels, numbers that a run keeps, numbers of each epoch."""


@dataclass(frozen=True)
class Injection:
    """One standard normal number that a sensor draws.

    Attributes:
        sensor: The sensor's name in the campaign.
        host: The craft that carries it.
        draw: What the sensor asks its streams for.
        word: The word of the stream; empty for the noise of the channels.
        place: Which channel, or which of the numbers.
    """

    sensor: str
    host: Craft
    draw: Draw
    word: str
    place: int


@dataclass
class Asked:
    """What sensors draw beside the noise of their channels, in the order in which they ask.

    Attributes:
        normal: Normal numbers, each of which may be injected.
        by_chance: Sensor and word of uniform numbers and of jumps, which are injected as nothing.
    """

    normal: list[Injection] = field(default_factory=list)
    by_chance: list[tuple[str, str]] = field(default_factory=list)


def injecting(injections: Sequence[Injection], asked: Asked | None = None) -> StreamsMaker:
    """Return what makes streams of 1 + J runs: in run 0 nothing errs, in run j only injection j - 1, by `SIZE`.

    Args:
        injections: What is put in.
        asked: Takes down what sensors draw beside the noise of their channels.
    """

    def make(name: str, options: SensorOptions, host: Craft, source: RandomSource, step_s: float) -> SensorStreams:
        own = {j: one for j, one in enumerate(injections, start=1) if (one.sensor, one.host) == (name, host)}
        return _InjectedStreams(name, options, host, 1 + len(injections), own, asked)

    return make


class _InjectedStreams(SensorStreams):
    """The random numbers of one sensor, none of which is drawn."""

    def __init__(
        self,
        name: str,
        options: SensorOptions,
        host: Craft,
        runs: int,
        injections: Mapping[int, Injection],
        asked: Asked | None,
    ) -> None:
        self._name, self._host, self._count = name, host, runs
        self._channels = len(options.channels)
        self._windows = _fixed_outages(noise_parts(options.noise))
        self._injections, self._asked = injections, asked

    @property
    def runs(self) -> int:
        """Runs of the block."""
        return self._count

    def noise(self, times_s: Array) -> Array:
        """Return the injected errors of the channels, in sigmas, (runs, K, m); NaN in fixed outages."""
        values = self._put("noise", "", (self._channels,), (self._count, len(times_s)))
        for start, end in self._windows:
            values[:, (times_s >= start) & (times_s < end)] = np.nan
        return values

    def normal(self, word: str, epochs: int, *shape: int) -> Array:
        """Return the injected numbers of each epoch, (runs, epochs, *shape)."""
        return self._put("each", word, shape, (self._count, epochs))

    def uniform(self, word: str, epochs: int, *shape: int) -> Array:
        """Return numbers just below 1, so that nothing happens by chance."""
        self._note(word)
        return np.full((self._count, epochs, *shape), np.nextafter(1.0, 0.0))

    def jumps(self, word: str, epochs: int, chance: float, held: int, channels: int) -> Array:
        """Return no jumps."""
        self._note(word)
        return np.zeros((self._count, epochs, channels))

    def constant(self, word: str, *shape: int) -> Array:
        """Return the injected numbers that a run keeps, (runs, *shape)."""
        return self._put("constant", word, shape, (self._count,))

    def _note(self, word: str) -> None:
        if self._asked is not None and (self._name, word) not in self._asked.by_chance:
            self._asked.by_chance.append((self._name, word))

    def _put(self, draw: Draw, word: str, shape: tuple[int, ...], leading: tuple[int, ...]) -> Array:
        size = int(np.prod(shape))
        if self._asked is not None and word:
            numbers = [Injection(self._name, self._host, draw, word, place) for place in range(size)]
            self._asked.normal.extend(one for one in numbers if one not in self._asked.normal)
        values = np.zeros((*leading, size))
        for run, one in self._injections.items():
            if (one.draw, one.word) == (draw, word):
                values[run, ..., one.place] = SIZE
        return values.reshape(*leading, *shape)


def _fixed_outages(parts: Sequence[NoisePart]) -> list[tuple[float, float]]:
    return [window for part in parts if isinstance(part, OutageNoise) for window in part.windows_s]
