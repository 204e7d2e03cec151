"""Quantiles over epochs from counts in logarithmic bins: fixed memory, and counts add up exactly.

A bin is one of 32 equal parts of an octave, so its relative width lies between 1/64 and 1/32. The bin is read
off the bits of the number (exponent and the first five bits of the fraction), which is exact on every machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array, Integers

Counts = NDArray[np.int32]

_PARTS_BITS = 5
_LOWEST_OCTAVE = -24  # 2^-24 = 6e-8: smaller errors, in m or m/s, all count as below it
_OCTAVES = 64
_SHIFT = 52 - _PARTS_BITS
_FIRST = (1023 + _LOWEST_OCTAVE) << _PARTS_BITS
BINS = (_OCTAVES << _PARTS_BITS) + 1
BIN_RULE = (_SHIFT, _FIRST - 1)
"""How compiled loops tell a bin: what `bin_of` shifts to the right and takes off."""


def bin_edges() -> Array:
    """Return the lower edges of the bins and the last upper edge, (BINS + 1,); the first bin starts at 0."""
    patterns = (np.arange(BINS, dtype=np.int64) + _FIRST) << _SHIFT
    return np.concatenate([[0.0], patterns.view(np.float64)])


def bin_of(values: Array) -> Integers:
    """Return the bin of each value >= 0; those beyond the last bin, infinity too, count in it."""
    patterns = np.ascontiguousarray(values, dtype=np.float64).view(np.int64)
    return np.clip((patterns >> BIN_RULE[0]) - BIN_RULE[1], 0, BINS - 1)


def quantiles(counts: Counts, probabilities: tuple[float, ...], largest: Array) -> Array:
    """Return quantiles from bin counts; off by at most the width of a bin.

    The quantile is the smallest counted value that at least this share of the values does not exceed (inverse of
    the empirical distribution), placed inside its bin by its rank there.

    Args:
        counts: (..., BINS).
        probabilities: Between 0 and 1, (q,).
        largest: Largest value counted, which no quantile exceeds, (...).

    Returns:
        (..., q); NaN where nothing was counted.
    """
    edges = bin_edges()
    below = np.cumsum(counts, axis=-1, dtype=np.int64)
    total = below[..., -1]
    found = np.empty((*total.shape, len(probabilities)))
    for i, probability in enumerate(probabilities):
        rank = np.maximum(np.ceil(probability * total - 1e-9) - 1, 0)
        place = np.minimum((below <= rank[..., None]).sum(axis=-1), BINS - 1)
        here = np.take_along_axis(counts, place[..., None], axis=-1)[..., 0]
        before = np.take_along_axis(below, place[..., None], axis=-1)[..., 0] - here
        share = (rank - before + 0.5) / np.maximum(here, 1)
        value = edges[place] + (edges[place + 1] - edges[place]) * share
        found[..., i] = np.where(total > 0, np.minimum(value, largest), np.nan)
    return found
