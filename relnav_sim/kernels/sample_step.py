"""A radar's measurement taken by fixed samples, in lanes: how `epochs.filtered_by_samples` updates.

Gultekin and Paisley, IEEE Trans. Signal Processing 65(23), 2017, algorithm 3, with one step. Each step is what the
kernels of `sampling`, those of the sensor and `kalman.innovation` do one after the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.kernels.compiling import given, inner, integer, number, record, written
from relnav_sim.kernels.converted_radar import linearise as linearise_converted
from relnav_sim.kernels.lanes import (
    LANES,
    copy,
    copy_vectors,
    factor,
    forward,
    forward_vectors,
    product,
    product_by_transpose,
)
from relnav_sim.kernels.sampling import CHUNK, EXACT, SAMPLES, regress, split, square_linear, take_moments
from relnav_sim.kernels.scores import lost, score, singular
from relnav_sim.kernels.sight import linearise, square_errors


class Tempered(NamedTuple):
    """A likelihood to a power, taken at fixed samples.

    Args:
        e: Standard normal samples (3, N) with mean 0 and covariance I, read-only.
        observed: Numbers of the states that are the position (3,).
        root: (alpha / 2)^1/2.
        r_scale: What the noise is multiplied by in the tempered innovation.
        fewest: Effective samples above which their moments count.
    """

    e: Array
    observed: Indices
    root: float
    r_scale: float
    fewest: float


TEMPERED = record(Tempered, given(2), written(1, integer), number, number, number)


@inner
def room(n: int, settings: Tempered) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return room for `update` of n states: in lanes, and for the samples of one run."""
    N = settings.e.shape[1]
    r, S, HPH, W, C = (
        np.empty((3, 3, LANES)),
        np.empty((3, 3, LANES)),
        np.empty((3, 3, LANES)),
        np.empty((3, 3, LANES)),
        np.empty((3, 3, LANES)),
    )
    z, nu, a, L = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((3, LANES)), np.zeros((3, 3, LANES))
    y = np.empty((n, LANES))
    h, g, cg = np.zeros((3, n, LANES)), np.empty((3, n, LANES)), np.empty((3, n, LANES))
    costs, w = np.empty(N), np.zeros((N + CHUNK - 1) // CHUNK * CHUNK)
    of_run = costs, w, np.empty((3, CHUNK)), np.empty(max(CHUNK, SAMPLES)), np.empty((10, LANES)), np.empty(LANES)
    return (z, nu, a, L, h, g, cg, r, S, HPH, W, C, y), (*of_run, np.empty((4, 3)), np.empty((4, 3, 3)))


@inner
def update(
    x: Array,
    p: Array,
    w: Array,
    converted: bool,
    M: Array,
    A: Array,
    c: Array,
    tempered: Tempered,
    room: tuple[tuple[Array, ...], tuple[Array, ...]],
    read: Mask,
    before: Array,
    first: int,
    used: int,
    short: Array,
    nis: Array,
    log_likelihood: Array,
    extras: Array,
) -> bool:
    """Update as `linearised_step.update` does; True where a run that is read is in need of something else.

    That is where the samples do not tell a covariance, or S is as good as singular. Extras (3, runs) are the effective
    sample size; 0, or 1 in a run that was lost at an earlier epoch; and the NIS with the tempered noise.
    """
    (z, nu, a, L, h, g, cg, r, S, HPH, W, C, y), of_run = room
    copy_vectors(w, used, z)
    copy_vectors(x, used, y)
    if converted:
        linearise_converted(x, used, M, A, c[0], w, h, r)
    else:
        linearise(x, used, M, A, c[0], w, h, r)
    # The innovation, with the noise tempered and as it is.
    product(h, p, used, cg)
    product_by_transpose(cg, h, used, HPH)
    if _scored(HPH, tempered.r_scale, r, w, read, first, used, S, L, nu, extras[2], log_likelihood):
        return True
    if _scored(HPH, 1.0, r, w, read, first, used, S, L, nu, nis, log_likelihood):
        return True
    # W with W^T W = (alpha / 2) R^-1.
    for i in range(3):
        for j in range(3):
            for b in range(used):
                W[i, j, b] = tempered.root if i == j else 0.0
    factor(r, used, L)
    forward(L, used, W)
    copy(p, used, short)
    split(short, tempered.observed, used, S, L, g)
    for b in range(used):
        if read[first + b]:
            extras[0, first + b] = _weigh(b, z, w, x, W, g, converted, M, tempered, of_run, a, C)
    regress(g, a, C, used, cg, x, short)
    for b in range(used):
        if read[first + b]:
            usable = extras[0, first + b] > tempered.fewest and _finite(short, b)
            if not usable and not lost(before, first + b):
                return True
            extras[1, first + b] = 0.0 if usable else 1.0
            # Where no variance is a number the filter's fallback leaves the mean as predicted.
            for i in range(0 if usable else len(x)):
                x[i, b] = y[i, b]
    return False


@inner
def _weigh(
    b: int,
    z: Array,
    nu: Array,
    x: Array,
    W: Array,
    g: Array,
    converted: bool,
    M: Array,
    tempered: Tempered,
    room: tuple[Array, ...],
    a: Array,
    C: Array,
) -> float:
    """Set lane b of a and C to the weighted samples' mean and covariance; return the effective sample size."""
    costs, w, gathered, more, sums, squares, vectors, matrices = room
    for i in range(3):
        vectors[0, i], vectors[1, i], vectors[2, i] = z[i, b], nu[i, b], x[i, b]
        for j in range(3):
            matrices[0, i, j], matrices[1, i, j] = W[i, j, b], g[j, i, b]
    whitening, root, mean, covariance = matrices[0], matrices[1], vectors[3], matrices[2]
    if converted:
        square_linear(vectors[1], root, whitening, tempered.e, more, costs)
    else:
        # What is to be set last is room before.
        room_of_axes = matrices[2], mean, matrices[3]
        square_errors(vectors[0], whitening, vectors[2], root, tempered.e, M, *room_of_axes, costs)
    ess = take_moments(costs, tempered.e, EXACT, w, gathered, more, sums, squares, mean, covariance)
    for i in range(3):
        a[i, b] = mean[i]
        for j in range(3):
            C[i, j, b] = covariance[i, j]
    return ess


@inner
def _scored(
    HPH: Array,
    r_scale: float,
    r: Array,
    w: Array,
    read: Mask,
    first: int,
    used: int,
    S: Array,
    L: Array,
    nu: Array,
    nis: Array,
    log_likelihood: Array,
) -> bool:
    """Set NIS and log-likelihood with S = H P H^T + r_scale R; return whether S of a run that is read is singular.

    Args:
        HPH: H P H^T, (3, 3, LANES).
        r_scale: Factor on the noise.
        r: R, (3, 3, LANES).
        w: Residuals (3, LANES).
        read: Which runs there are measurements of, (runs,).
        first: Number of the first run.
        used: How many lanes there are.
        S: Room (3, 3, LANES).
        L: Room alike.
        nu: Room (3, LANES).
        nis: Gets the NIS of these runs, (runs,).
        log_likelihood: Gets their log-likelihoods.
    """
    for i in range(3):
        for j in range(3):
            for b in range(used):
                S[i, j, b] = HPH[i, j, b] + r_scale * r[i, j, b]
    copy_vectors(w, used, nu)
    factor(S, used, L)
    forward_vectors(L, used, nu)
    score(nu, L, first, used, nis, log_likelihood)
    lost = False
    for b in range(used):
        lost |= read[first + b] and singular(S, L, b)
    return lost


@inner
def _finite(P: Array, b: int) -> bool:
    """Return whether the lower triangle of lane b is finite."""
    total = 0.0
    for i in range(len(P)):
        for j in range(i + 1):
            total += P[i, j, b]
    return math.isfinite(total)
