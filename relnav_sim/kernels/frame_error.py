"""What a white error of the orbit frame adds to the noise of a measurement (see `measurements.frame_error`)."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel
from relnav_sim.kernels.lanes import LANES, load, load_vectors, product, product_by_transpose, store_symmetric


@kernel(given(3), given(2), given(3))
def added(H: Array, states: Array, P: Array) -> Array:
    """Return G P G^T, G = H [[r x], 0; [v x], [r x]], (runs, m, m), symmetric to the bit.

    Args:
        H: Derivatives of the measurement, (runs, m, n) or (1, m, n), by position r, velocity v and whatever follows.
        states: (runs, n), r and v first.
        P: Covariance of turn and turn's rate, (runs, 6, 6) or (1, 6, 6), symmetric.
    """
    runs, n = states.shape
    m = H.shape[1]
    R = np.empty((runs, m, m))
    x, h, p = np.empty((n, LANES)), np.empty((m, n, LANES)), np.empty((6, 6, LANES))
    G, gp, gpg = np.empty((m, 6, LANES)), np.empty((m, 6, LANES)), np.empty((m, m, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(states, first, used, x)
        load(H, first, used, h)
        load(P, first, used, p)
        _by_frame(h, x, used, G)
        product(G, p, used, gp)
        product_by_transpose(gp, G, used, gpg)
        store_symmetric(gpg, first, used, R)
    return R


@inner
def _by_frame(h: Array, x: Array, used: int, G: Array) -> None:
    """Set G (m, 6, LANES): h_r [r x] + h_v [v x] by the turn and h_v [r x] by its rate, of each row h."""
    for i in range(len(h)):
        for b in range(used):
            r0, r1, r2, v0, v1, v2 = x[0, b], x[1, b], x[2, b], x[3, b], x[4, b], x[5, b]
            a0, a1, a2, c0, c1, c2 = h[i, 0, b], h[i, 1, b], h[i, 2, b], h[i, 3, b], h[i, 4, b], h[i, 5, b]
            G[i, 0, b] = (a1 * r2 - a2 * r1) + (c1 * v2 - c2 * v1)
            G[i, 1, b] = (a2 * r0 - a0 * r2) + (c2 * v0 - c0 * v2)
            G[i, 2, b] = (a0 * r1 - a1 * r0) + (c0 * v1 - c1 * v0)
            G[i, 3, b], G[i, 4, b], G[i, 5, b] = c1 * r2 - c2 * r1, c2 * r0 - c0 * r2, c0 * r1 - c1 * r0
