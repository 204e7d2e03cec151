"""A radar's measurement whose noise is Student's t, in lanes: how `epochs.filtered_by_student_t` updates.

The variational form of Agamennoni, Nieto and Nebot, IEEE Trans. Signal Processing 60(10), 2012, channel by channel.
Each step is what the kernels of `reweighting` and `kalman.update` do one after the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import inner, integer, number, record
from relnav_sim.kernels.converted_radar import linearise as linearise_converted
from relnav_sim.kernels.kalman import correct
from relnav_sim.kernels.lanes import LANES, copy, copy_vectors, factor, forward, forward_vectors, mirror
from relnav_sim.kernels.reweighting import scale, take_residuals
from relnav_sim.kernels.roots import mark_poor
from relnav_sim.kernels.scores import loses, lost
from relnav_sim.kernels.sight import linearise


class StudentT(NamedTuple):
    """Noise whose precision is itself random.

    Args:
        freedom: Degrees of freedom.
        least: Of the weights.
        largest: Of the weights.
        iterations: Reweighted updates.
    """

    freedom: float
    least: float
    largest: float
    iterations: int


STUDENT_T = record(StudentT, number, number, number, integer)


@inner
def room(n: int, settings: StudentT) -> tuple[Array, ...]:
    """Return room for `update` of n states."""
    y, dx, post = np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, n, LANES))
    nu, white, e, weights, spread = (
        np.empty((3, LANES)),
        np.empty((3, LANES)),
        np.empty((3, LANES)),
        np.empty((3, LANES)),
        np.empty((3, LANES)),
    )
    h, rows, W = np.zeros((3, n, LANES)), np.zeros((3, n, LANES)), np.empty((3, n, LANES))
    r, S, L, root = np.zeros((3, 3, LANES)), np.empty((3, 3, LANES)), np.zeros((3, 3, LANES)), np.zeros((3, 3, LANES))
    return y, dx, post, nu, white, e, weights, spread, h, rows, W, r, S, L, root, np.empty(LANES), np.empty(LANES)


@inner
def update(
    x: Array,
    p: Array,
    w: Array,
    converted: bool,
    M: Array,
    A: Array,
    c: Array,
    student: StudentT,
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
    """Update as `linearised_step.update` does; the same is returned, and where the noise is singular.

    Extras (2, runs) are the least weight and the NIS by the noise of the last update.
    """
    y, dx, post, nu, white, e, weights, spread, h, rows, W, r, S, L, root, nis_after, unused = room
    if converted:
        linearise_converted(x, used, M, A, c[0], w, h, r)
    else:
        linearise(x, used, M, A, c[0], w, h, r)
    factor(r, used, root)
    if _noise_is_poor(r, root, before, read, first, used):
        return True
    copy_vectors(w, used, white)
    forward_vectors(root, used, white)
    copy(h, used, rows)
    forward(root, used, rows)
    copy_vectors(x, used, y)
    copy_vectors(w, used, nu)
    correct(x, p, nu, h, r, used, S, L, W, short, first, nis, log_likelihood)
    if loses(S, r, L, read, first, used):
        return True
    for _ in range(student.iterations):
        for i in range(len(x)):
            for b in range(used):
                dx[i, b] = x[i, b] - y[i, b]
        mirror(short, used, post)
        copy_vectors(white, used, e)
        take_residuals(rows, dx, post, used, W, e, spread)
        for i in range(3):
            for b in range(used):
                weight = (student.freedom + 1) / (student.freedom + (e[i, b] * e[i, b] + spread[i, b]))
                weight = student.least if weight < student.least else weight
                weights[i, b] = student.largest if weight > student.largest else weight
        scale(root, weights, used, r)
        mirror(r, used, r)
        copy_vectors(y, used, x)
        copy_vectors(w, used, nu)
        correct(x, p, nu, h, r, used, S, L, W, short, 0, nis_after, unused)
        if loses(S, r, L, read, first, used):
            return True
    for b in range(used):
        least = weights[0, b]
        for i in range(1, 3):
            least = weights[i, b] if weights[i, b] < least or math.isnan(weights[i, b]) else least
        extras[0, first + b], extras[1, first + b] = least, nis_after[b]
    return False


@inner
def _noise_is_poor(r: Array, root: Array, before: Array, read: Mask, first: int, used: int) -> bool:
    """Return whether the noise of a run that is read is as good as singular; a run lost before does not count."""
    poor, found = np.empty(LANES, dtype=np.bool_), False
    if mark_poor(r, root, 0, used, poor) > 0:
        for b in range(used):
            found |= poor[b] and read[first + b] and not lost(before, first + b)
    return found
