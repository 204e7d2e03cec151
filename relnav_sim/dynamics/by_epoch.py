"""Arrays by epoch, computed for a chunk of epochs at a time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.dynamics.interface import ByTransition, Step, is_still

T = TypeVar("T")


class PerChunk(Generic[T]):
    """What a function gives for a chunk of epochs at a time, for callers that go from epoch to epoch.

    The chunks lie on a fixed grid of epochs, so the numbers of an epoch do not depend on the order of the calls.
    The two latest chunks are kept: callers that take turns of a chunk ask for the end of the one before.

    Args:
        compute: Maps the epochs of a chunk (CHUNK_EPOCHS,), the first a multiple of that, to what is wanted of them.
    """

    def __init__(self, compute: Callable[[Array], T]) -> None:
        self._compute = compute
        self._held: dict[int, T] = {}

    def at(self, epoch: int) -> tuple[T, int]:
        """Return the chunk with this epoch, and the epoch's place in it."""
        chunk, place = divmod(epoch, CHUNK_EPOCHS)
        if chunk not in self._held:
            computed = self._compute(np.arange(chunk * CHUNK_EPOCHS, (chunk + 1) * CHUNK_EPOCHS, dtype=float))
            self._held = dict([*self._held.items(), (chunk, computed)][-2:])
        return self._held[chunk], place


class LinearByEpoch(ByTransition):
    """Linear dynamics whose transition matrix differs from epoch to epoch: x_k = F_k x_{k-1} + w, w ~ N(0, Q).

    Args:
        transitions: Maps epochs (K,) to the matrices (K, n, n) of the steps that end there.
        process_noise: Q (n, n).
    """

    def __init__(self, transitions: Callable[[Array], Array], process_noise: Array) -> None:
        self.dimension = len(process_noise)
        self._chunks = PerChunk(partial(_closed, transitions))
        self._Q = process_noise

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F of this epoch, (n, n)."""
        matrices, place = self._chunks.at(step.epoch)
        return matrices[place]

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (n, n)."""
        return self._Q

    def known_steps(self, first_epoch: int, count: int) -> tuple[Array, Array] | None:
        """Return F (count, n, n) and Q (1, n, n) of steps; None where a derived class or an object has its own."""
        base = LinearByEpoch
        if not is_still(self, base.propagate, base.transition, base.process_noise):
            return None
        chunks = map(self._chunks.at, range(first_epoch, first_epoch + count))
        return np.stack([matrices[place] for matrices, place in chunks]), self._Q[None]


def _closed(transitions: Callable[[Array], Array], epochs: Array) -> Array:
    """Return matrices that a filter can't write into: they are kept for the other runs' next steps."""
    matrices = transitions(epochs)
    matrices.setflags(write=False)
    return matrices
