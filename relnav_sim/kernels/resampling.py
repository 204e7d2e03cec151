"""Which particle each new one copies, and copying it."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels.compiling import given, integer, kernel


@kernel(given(2), given(2))
def ancestors(weights: Array, u: Array) -> Integers:
    """Return for each position i + u_i, i = 0 ... N - 1, the particle in whose part of [0, N) it lies: (runs, N).

    The parts lie one behind the other and are as long as the weights. One u in [0, 1) for all positions of a run is
    systematic, one for each is stratified resampling (Douc and Cappe, ISPA 2005).

    Args:
        weights: (runs, N), finite, not all zero.
        u: (runs, 1) or (runs, N).
    """
    runs, N = weights.shape
    chosen = np.empty((runs, N), dtype=np.int64)
    edges = np.empty(N)
    marks = np.empty(N + 1, dtype=np.int64)
    for run in range(runs):
        edge = 0.0
        for i in range(N):
            edge += weights[run, i]
            edges[i] = edge
        scale = N / edge
        # A particle's first copy is marked, by the last of those that begin there: the ones before it have none.
        marks[:] = 0
        below = 0
        for i in range(N):
            marks[below] = i
            # The positions below an edge c: those of the full strata, and the one in the last where u is small enough.
            c = edges[i] * scale
            c = c if c < N else float(N)  # also where it is no number
            full = int(c)
            below = full + (u[run, min(full, N - 1) if u.shape[1] > 1 else 0] < c - full)
        latest = 0
        for p in range(N):
            latest = max(latest, marks[p])
            chosen[run, p] = latest
    return chosen


@kernel(given(3), given(1, integer), given(2, integer))
def copies(x: Array, rows: Integers, chosen: Integers) -> Array:
    """Return the chosen entries (rows, m, N) of the rows of x (runs, m, N), chosen (rows, N)."""
    m, N = x.shape[1:]
    copied = np.empty((len(rows), m, N))
    for place in range(len(rows)):
        for j in range(m):
            for p in range(N):
                copied[place, j, p] = x[rows[place], j, chosen[place, p]]
    return copied
