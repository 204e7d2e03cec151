"""Errors that jump at random times and stay for a while."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.streams import Streams


class Jumps:
    """Normal numbers that come at random epochs and are held for a number of epochs, or until the next ones come.

    Args:
        switches: Decides when, one number a run and epoch.
        sizes: Draws how far, `channels` numbers a run and epoch, used or not.
        chance: Probability that an epoch begins a jump.
        held: Epochs for which it stays, the first included.
        channels: Numbers of a jump.
    """

    def __init__(self, switches: Streams, sizes: Streams, chance: float, held: int, channels: int) -> None:
        self._switches, self._sizes = switches, sizes
        self._chance, self._held = chance, held
        runs = len(switches.generators)
        self._age = np.full(runs, held)
        self._latest = np.zeros((runs, channels))

    def sample(self, epochs: int) -> Array:
        """Return the errors at the next epochs, in sigmas, (runs, epochs, channels)."""
        begins = self._switches.uniform(epochs) < self._chance
        drawn = np.concatenate([self._latest[:, None], self._sizes.normal(epochs, self._latest.shape[1])], axis=1)
        # Place 0 is the jump from before; of the others the latest that began counts.
        place = np.maximum.accumulate(np.where(begins, np.arange(1, epochs + 1), 0), axis=1)
        age = np.arange(1, epochs + 1) - np.where(place > 0, place, -self._age[:, None])
        errors = np.take_along_axis(drawn, place[..., None], axis=1)
        self._age, self._latest = np.minimum(age[:, -1], self._held), errors[:, -1]
        return np.where((age < self._held)[..., None], errors, 0.0)
