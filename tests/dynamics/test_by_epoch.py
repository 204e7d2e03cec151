"""Arrays by epoch: what is computed, and how often."""

import numpy as np

from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.dynamics.by_epoch import PerChunk


def test_callers_that_take_turns_share_every_chunk():
    computed = []

    def squares(epochs):
        computed.append(epochs[0])
        return epochs**2

    chunks = PerChunk(squares)
    for first in range(0, 4 * CHUNK_EPOCHS, CHUNK_EPOCHS):
        for _ in range(3):
            # A step begins at the epoch before its own, which the first one of a turn finds in the chunk before.
            for epoch in range(max(first - 1, 0), first + CHUNK_EPOCHS - 1):
                values, place = chunks.at(epoch)
                assert values[place] == epoch**2
    assert computed == [0, CHUNK_EPOCHS, 2 * CHUNK_EPOCHS, 3 * CHUNK_EPOCHS]


def test_the_order_of_the_calls_changes_nothing():
    chunks = PerChunk(np.sqrt)
    found = {}
    for epoch in (3, 2000, 700, 4, 1999, 1):
        values, place = chunks.at(epoch)
        found[epoch] = values[place]
    assert found == {epoch: np.sqrt(float(epoch)) for epoch in found}
