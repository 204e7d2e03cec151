"""Named random streams: the same run gets the same numbers whatever else is computed."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array


def generator(seed: int, run: int, name: str) -> np.random.Generator:
    """Return the random generator of one named stream of one run.

    The key holds neither the case nor a counter, so all cases and filters of a run share their
    numbers, and adding a sensor, a filter or a run leaves every other stream as it was.

    Args:
        seed: The campaign's seed.
        run: The run's number in the campaign, from 0.
        name: The stream's name, for example ``sensor.radar.noise``; hashed to a fixed 32-bit word.
    """
    word = zlib.crc32(name.encode())
    if type(seed) is type(run) is int and 0 <= min(seed, run) <= max(seed, run) < 2**32:
        # The words that SeedSequence(seed, spawn_key=(run, word)) would put together, which takes it four times longer.
        entropy = np.array([seed, 0, 0, 0, run, word], dtype=np.uint32)
        return np.random.default_rng(np.random.SeedSequence(entropy))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run, word)))


class Streams:
    """One generator per run of a block; every draw has the runs as its leading axis.

    A stream serves one kind of draw only. Drawing K epochs at once or one by one then gives the same
    numbers, so neither the block nor the length of a chunk of epochs shows in the results.
    """

    def __init__(self, generators: Sequence[np.random.Generator]) -> None:
        self.generators = tuple(generators)

    def normal(self, *shape: int) -> Array:
        """Return standard normal numbers, (runs, *shape)."""
        numbers = np.empty((len(self.generators), *shape))
        for row, rng in zip(numbers, self.generators, strict=True):
            rng.standard_normal(out=row)
        return numbers

    def uniform(self, *shape: int) -> Array:
        """Return numbers uniform on [0, 1), (runs, *shape)."""
        numbers = np.empty((len(self.generators), *shape))
        for row, rng in zip(numbers, self.generators, strict=True):
            rng.random(out=row)
        return numbers


@dataclass(frozen=True)
class RandomSource:
    """Where a block's random streams come from: the campaign's seed and the block's run numbers."""

    seed: int
    runs: tuple[int, ...]

    def streams(self, name: str) -> Streams:
        """Return a fresh set of generators for the named stream, one per run."""
        return Streams([generator(self.seed, run, name) for run in self.runs])
