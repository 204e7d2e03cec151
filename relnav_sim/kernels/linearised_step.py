"""A radar's measurement taken by the extended Kalman filter, in lanes: how `epochs.filtered` updates."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import inner
from relnav_sim.kernels.converted_radar import linearise as linearise_converted
from relnav_sim.kernels.kalman import correct
from relnav_sim.kernels.lanes import LANES
from relnav_sim.kernels.scores import loses
from relnav_sim.kernels.sight import linearise


@inner
def room(n: int, settings: float) -> tuple[Array, ...]:
    """Return room for `update` of n states; the room of another update may depend on its settings."""
    zero, square = np.zeros((3, n, LANES)), np.zeros((3, 3, LANES))
    return zero, square, np.empty((3, 3, LANES)), np.zeros((3, 3, LANES)), np.empty((3, n, LANES))


@inner
def update(
    x: Array,
    p: Array,
    w: Array,
    converted: bool,
    M: Array,
    A: Array,
    c: Array,
    r_scale: float,
    room: tuple[Array, ...],
    read: Mask,
    before: Array,
    first: int,
    used: int,
    short: Array,
    nis: Array,
    log_likelihood: Array,
    extras: Array,
) -> bool:
    """Update the lanes of the runs from `first` on; return whether one that is read needs more than the short form.

    That is where `kalman.update` takes Joseph's form or says that a run is lost.

    Args:
        x: Predicted means (n, LANES), replaced.
        p: Their covariances (n, n, LANES).
        w: Measurements (3, LANES), lost.
        converted: Whether they are positions.
        M: As in `epochs.filtered`; so are A and c.
        A: See there.
        c: See there.
        r_scale: Factor on the noise.
        room: From `room`.
        read: Which runs there are measurements of, (runs,).
        before: Covariances one epoch before, (runs, n, n).
        first: Number of the first run.
        used: How many lanes there are.
        short: Gets the lower triangles of the covariances (n, n, LANES).
        nis: Gets the NIS of these runs, (runs,).
        log_likelihood: Gets their log-likelihoods.
        extras: Nothing is said here, (0, runs).
    """
    h, r, S, L, W = room
    if converted:
        linearise_converted(x, used, M, A, c[0], w, h, r)
    else:
        linearise(x, used, M, A, c[0], w, h, r)
    if r_scale != 1:
        for i in range(3):
            for j in range(3):
                for b in range(used):
                    r[i, j, b] *= r_scale
    correct(x, p, w, h, r, used, S, L, W, short, first, nis, log_likelihood)
    return loses(S, r, L, read, first, used)
