"""What a filter needs to go back some epochs and over them again: dynamics and random numbers as they were."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.around import AroundDynamics
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.streams import RandomSource, Streams


@dataclass(frozen=True)
class RewindableSource(RandomSource):
    """A source of random numbers that can be put back to where it was.

    A filter that goes over an epoch again then draws the numbers that it has drawn there before, and ends as one that
    has gone over it once.
    """

    made: list[np.random.Generator] = field(default_factory=list, compare=False)

    def streams(self, name: str) -> Streams:
        """Return the generators of the named stream, one per run, and remember them."""
        streams = super().streams(name)
        self.made.extend(streams.generators)
        return streams

    def state(self) -> list[Any]:
        """Return where all generators are."""
        return [one.bit_generator.state for one in self.made]

    def rewind(self, state: list[Any]) -> None:
        """Put the generators back to where they were."""
        for one, its in zip(self.made, state, strict=True):
            one.bit_generator.state = its


class RewindableDynamics(AroundDynamics):
    """Dynamics that can be asked for the steps of the chunk before as well, as they were fed then.

    Args:
        base: The dynamics, fed a chunk of epochs at a time.
    """

    def __init__(self, base: Dynamics) -> None:
        super().__init__(base)
        self._before: Dynamics = base
        self._first_epoch = 0

    def keep(self, first_epoch: int) -> None:
        """Keep the dynamics as they are, before they are fed the chunk that begins with this epoch."""
        self._before, self._first_epoch = deepcopy(self._base), first_epoch

    def propagate(self, states: Array, step: Step) -> Array:
        """Return f(states)."""
        return self._at(step).propagate(states, step)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian of f."""
        return self._at(step).transition(mean, step)

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q."""
        return self._at(step).process_noise(states, step)

    def known_steps(self, first_epoch: int, count: int) -> None:
        """Return None: it goes from step to step."""

    def _at(self, step: Step) -> Dynamics:
        return self._base if step.epoch >= self._first_epoch else self._before
