"""Resampling of weighted particles: which particle each new one copies, for all runs at once.

Weights are normalised, (runs, N). A run's result depends on its own weights and random numbers alone. In every scheme
the expected number of copies of particle i is N w_i (Douc and Cappe, ISPA 2005).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.streams import Streams

Resampling = Literal["systematic", "stratified", "residual"]


def effective_sample_size(weights: Array) -> Array:
    """Return 1 / sum w^2 of normalised weights (runs, N): (runs,) (Kong, Liu and Wong 1994)."""
    return np.asarray(1 / np.square(weights).sum(axis=-1))


def draw_ancestors(scheme: Resampling, weights: Array, streams: Streams) -> Indices:
    """Return, for each new particle, the index of the particle it copies: (runs, N), ascending.

    Args:
        scheme: systematic (one random number a run), stratified or residual (N numbers a run).
        weights: Normalised and finite, (runs, N).
        streams: Random streams of these runs.
    """
    runs, N = weights.shape
    counts = _COUNTS[scheme](weights, streams)
    particles = np.broadcast_to(np.arange(N), (runs, N))
    return np.repeat(particles.ravel(), counts.ravel()).reshape(runs, N)


def _scaled_edges(weights: Array) -> Array:
    """Return N times the cumulative weights, ending at N exactly whatever the rounding."""
    N = weights.shape[-1]
    edges = np.cumsum(weights, axis=-1)
    edges *= N / edges[:, -1:]
    np.minimum(edges, N, out=edges)
    edges[:, -1] = N
    return edges


def _systematic(weights: Array, streams: Streams) -> Indices:
    # Positions i + u, i = 0 ... N - 1: ceil(c - u) of them lie below c, so no search is needed.
    edges = _scaled_edges(weights)
    edges -= streams.uniform(1)
    return _counts(np.ceil(edges, out=edges).astype(np.intp))


def _stratified(weights: Array, streams: Streams) -> Indices:
    # Positions i + u_i: below c lie the floor(c) of the full strata, and that of the last where u is small enough.
    edges = _scaled_edges(weights)
    N = weights.shape[-1]
    full = np.floor(edges)
    strata = full.astype(np.intp)
    u = np.take_along_axis(streams.uniform(N), np.minimum(strata, N - 1), axis=-1)
    return _counts(strata + (u < edges - full))


def _counts(below: Indices) -> Indices:
    """Return the number of positions between successive edges, from the number below each."""
    below[:, 1:] -= below[:, :-1].copy()
    return below


def _residual(weights: Array, streams: Streams) -> Indices:
    # Liu and Chen, JASA 93, 1998: floor(N w) sure copies, the rest multinomial from what is left of the weights.
    N = weights.shape[-1]
    expected = N * weights
    counts = np.floor(expected).astype(np.intp)
    left = expected - counts
    for row, (rest, u) in enumerate(zip(left, streams.uniform(N), strict=True)):
        free = N - counts[row].sum()
        if free > 0:
            edges = np.cumsum(rest)
            drawn = np.searchsorted(edges, u[:free] * edges[-1], side="right")
            counts[row] += np.bincount(np.minimum(drawn, N - 1), minlength=N)
    return counts


_COUNTS: dict[Resampling, Callable[[Array, Streams], Indices]] = {
    "systematic": _systematic,
    "stratified": _stratified,
    "residual": _residual,
}
