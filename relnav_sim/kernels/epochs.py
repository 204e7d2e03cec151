"""The extended Kalman filter over many epochs in one go, its belief in lanes all the while.

Each epoch is what `kalman.predict_linear`, a sensor's `linearised` and `kalman.update` do one after the other, to the
last bit. What is saved is the way into each of them, and each run's matrices turned into lanes and back.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import flag, given, inner, kernel, kernel_like, number, written
from relnav_sim.kernels.converted_radar import linearise as linearise_converted
from relnav_sim.kernels.kalman import carry, carry_mean, correct
from relnav_sim.kernels.lanes import LANES, copy_vectors, load, load_vectors, mirror, store_symmetric, store_vectors
from relnav_sim.kernels.sight import linearise

_BELIEF, _STEPS, _READINGS = (given(2), given(3)), (given(3), given(3)), (given(3), given(2, flag))
_MODEL, _FILLED = (given(2), given(2), given(2), number), (written(3), written(4), written(2), written(2))


@kernel(*_BELIEF, *_STEPS, *_READINGS, *_MODEL, *_FILLED)
def spherical(
    m: Array,
    P: Array,
    F: Array,
    Q: Array,
    z: Array,
    read: Mask,
    M: Array,
    A: Array,
    c: Array,
    r_scale: float,
    means: Array,
    covariances: Array,
    nis: Array,
    log_likelihood: Array,
) -> int:
    """Filter measurements of range, azimuth and elevation; return how many epochs have been.

    That is all of them, or those before the first one in which a run that is read is lost, see `kalman.update`. What
    stands behind these in the arrays that are written is of no meaning.

    Args:
        m: Means one epoch before the first, (runs, n).
        P: Their covariances (runs, n, n).
        F: Transition matrices (K, n, n), or one (1, n, n) for all epochs.
        Q: Process noise alike.
        z: Measurements (K, runs, 3).
        read: Which of them there are, (K, runs); a run without keeps its prediction.
        M: Rotation (3, 3) from the states' axes to the radar's.
        A: Covariance (3, 3) of the attitude error, rad^2.
        c: Variances of range, azimuth and elevation (1, 3).
        r_scale: Factor on the noise.
        means: Gets the means (K, runs, n).
        covariances: Gets their covariances (K, runs, n, n).
        nis: Gets the NIS (K, runs), NaN without a measurement.
        log_likelihood: Gets the log-likelihoods (K, runs), 0 without a measurement.
    """
    K, runs, _ = z.shape
    n = m.shape[1]
    blocks = (runs + LANES - 1) // LANES
    X, C = np.empty((blocks, n, LANES)), np.empty((blocks, n, n, LANES))  # the belief of all runs
    for block in range(blocks):
        load_vectors(m, block * LANES, min(LANES, runs - block * LANES), X[block])
        load(P, block * LANES, min(LANES, runs - block * LANES), C[block])
    y, q, fp, f = np.empty((n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES))
    w, h, r = np.empty((3, LANES)), np.zeros((3, n, LANES)), np.zeros((3, 3, LANES))
    S, L, W = np.empty((3, 3, LANES)), np.zeros((3, 3, LANES)), np.empty((3, n, LANES))
    lost = np.zeros(runs, dtype=np.bool_)
    for k in range(K):
        own_F, own_Q = k if len(F) > 1 else 0, k if len(Q) > 1 else 0
        for block in range(blocks):
            first = block * LANES
            used = min(LANES, runs - first)
            x, p = X[block], C[block]
            carry_mean(x, F[own_F : own_F + 1], f, used, y)
            carry(p, F[own_F : own_F + 1], Q[own_Q : own_Q + 1], first, used, f, fp, q)
            copy_vectors(y, used, x)
            mirror(q, used, p)
            there = _count(read[k], first, used)
            if there > 0:
                load_vectors(z[k], first, used, w)
                linearise(x, used, M, A, c, w, h, r)
                if r_scale != 1:
                    for i in range(3):
                        for j in range(3):
                            for b in range(used):
                                r[i, j, b] *= r_scale
                correct(x, p, w, h, r, used, S, L, W, q, first, nis[k], log_likelihood[k], lost)
            for b in range(used if there < used else 0):
                if not read[k, first + b]:
                    nis[k, first + b], log_likelihood[k, first + b], lost[first + b] = math.nan, 0.0, False
                    for i in range(n):
                        x[i, b] = y[i, b]
                        for j in range(i + 1):
                            q[i, j, b] = p[i, j, b]
            mirror(q, used, p)
            if _count(lost, first, used) > 0:
                return k
            store_vectors(x, first, used, means[k])
            store_symmetric(p, first, used, covariances[k])
    return K


@kernel_like(spherical, *_BELIEF, *_STEPS, *_READINGS, *_MODEL, *_FILLED, linearise=linearise_converted)
def converted(
    m: Array,
    P: Array,
    F: Array,
    Q: Array,
    z: Array,
    read: Mask,
    M: Array,
    A: Array,
    c: Array,
    r_scale: float,
    means: Array,
    covariances: Array,
    nis: Array,
    log_likelihood: Array,
) -> int:
    """Filter positions from measurements; A, c are T and the coefficients of `converted_radar.covariances`."""
    return 0


@inner
def _count(marked: Mask, first: int, used: int) -> int:
    """Return how many of the runs from `first` on are marked."""
    count = 0
    for b in range(used):
        count += marked[first + b]
    return count
