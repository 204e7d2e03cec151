"""Resampling of weighted particles: which particle each new one copies, for all runs at once.

Weights are normalised, (runs, N). A run's result depends on its own weights and random numbers alone. In every scheme
the expected number of copies of particle i is N w_i (Douc and Cappe, ISPA 2005).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.streams import Streams

Resampling = Literal["systematic", "stratified", "residual"]


def draw_ancestors(scheme: Resampling, weights: Array, streams: Streams) -> Indices:
    """Return, for each new particle, the index of the particle it copies: (runs, N), ascending.

    Args:
        scheme: systematic (one random number a run), stratified or residual (N numbers a run).
        weights: Normalised and finite, (runs, N).
        streams: Random streams of these runs.
    """
    if scheme == "residual":
        return _residual(weights, streams)
    # The positions of one random number a run, or of one for each new particle.
    u = streams.uniform(1 if scheme == "systematic" else weights.shape[1])
    return kernels.resampling.ancestors(np.ascontiguousarray(weights), u)


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
    particles = np.broadcast_to(np.arange(N), weights.shape)
    return np.repeat(particles.ravel(), counts.ravel()).reshape(weights.shape)
