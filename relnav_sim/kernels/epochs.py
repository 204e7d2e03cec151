"""Kalman filters over many epochs in one go, their beliefs in lanes all the while.

Each epoch is what `kalman.predict_linear` and the filter's update do one after the other, to the last bit. What is
saved is the way into each kernel, and each run's matrices turned into lanes and back. The loop is written once: each
filter brings an `update`, and the `room` that it needs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import flag, given, inner, kernel, kernel_like, number, written
from relnav_sim.kernels.kalman import carry_mean_by_one, multiply_by_one, multiply_by_transpose_of_one
from relnav_sim.kernels.lanes import LANES, copy_vectors, load, load_vectors, mirror, store_symmetric, store_vectors
from relnav_sim.kernels.linearised_step import room, update
from relnav_sim.kernels.point_step import TRANSFORM
from relnav_sim.kernels.point_step import room as room_for_points
from relnav_sim.kernels.point_step import update as update_by_points
from relnav_sim.kernels.reweighted_step import STUDENT_T
from relnav_sim.kernels.reweighted_step import room as room_for_student_t
from relnav_sim.kernels.reweighted_step import update as update_by_student_t
from relnav_sim.kernels.sample_step import TEMPERED
from relnav_sim.kernels.sample_step import room as room_for_samples
from relnav_sim.kernels.sample_step import update as update_by_samples

_GIVEN = (given(2), given(3), given(3), given(3), given(3), given(2, flag), flag, given(2), given(2), given(2))
_FILLED = (written(3), written(4), written(2), written(2), written(3))


@kernel(*_GIVEN, number, *_FILLED)
def filtered(
    m: Array,
    P: Array,
    F: Array,
    Q: Array,
    z: Array,
    read: Mask,
    converted: bool,
    M: Array,
    A: Array,
    c: Array,
    settings: float,
    means: Array,
    covariances: Array,
    nis: Array,
    log_likelihood: Array,
    extras: Array,
) -> int:
    """Filter a radar's measurements by the extended Kalman filter; return how many epochs have been.

    These are range, azimuth and elevation, or positions that they have been converted to: one kernel for both, as
    compiling takes longest for what they have in common.

    It returns all epochs, or those before the first one in which a run that is read needs more than `update` does.
    What stands behind these in the arrays that are written is of no meaning.

    Args:
        m: Means one epoch before the first, (runs, n).
        P: Their covariances (runs, n, n).
        F: Transition matrices (K, n, n), or one (1, n, n) for all epochs.
        Q: Process noise alike.
        z: Measurements (K, runs, 3).
        read: Which of them there are, (K, runs); a run without keeps its prediction.
        converted: Whether they are positions.
        M: Rotation (3, 3) from the states' axes to the radar's.
        A: Covariance (3, 3) of the attitude error, rad^2; of positions, T of `converted_radar.covariances`.
        c: Variances of range, azimuth and elevation (1, 3); of positions, its coefficients (1, 14).
        settings: What `update` needs to know; here the factor on the noise.
        means: Gets the means (K, runs, n).
        covariances: Gets their covariances (K, runs, n, n).
        nis: Gets the NIS (K, runs), NaN without a measurement.
        log_likelihood: Gets the log-likelihoods (K, runs), 0 without a measurement.
        extras: Gets the filter's further numbers (K, count, runs), NaN without a measurement; here none.
    """
    K, runs, _ = z.shape
    n = m.shape[1]
    blocks = (runs + LANES - 1) // LANES
    X, C = np.empty((blocks, n, LANES)), np.empty((blocks, n, n, LANES))  # the belief of all runs
    for block in range(blocks):
        load_vectors(m, block * LANES, min(LANES, runs - block * LANES), X[block])
        load(P, block * LANES, min(LANES, runs - block * LANES), C[block])
    y, q, fp, w = np.empty((n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES)), np.empty((3, LANES))
    rooms = room(n, settings)
    for k in range(K):
        F_k, Q_k = F[k if len(F) > 1 else 0], Q[k if len(Q) > 1 else 0]
        for block in range(blocks):
            first = block * LANES
            used = min(LANES, runs - first)
            x, p = X[block], C[block]
            carry_mean_by_one(x, F_k, used, y)
            multiply_by_one(F_k, p, used, fp)
            for i in range(n):
                for j in range(i + 1):
                    for b in range(used):
                        q[i, j, b] = Q_k[i, j] + 0.0  # not -0, as no sum with it is
            multiply_by_transpose_of_one(fp, F_k, used, q)
            copy_vectors(y, used, x)
            mirror(q, used, p)
            there = _count(read[k], first, used)
            if there > 0:
                load_vectors(z[k], first, used, w)
                out = nis[k], log_likelihood[k], extras[k]
                before = covariances[k - 1] if k > 0 else P
                if update(x, p, w, converted, M, A, c, settings, rooms, read[k], before, first, used, q, *out):
                    return k
            for b in range(used if there < used else 0):
                if not read[k, first + b]:
                    nis[k, first + b], log_likelihood[k, first + b] = math.nan, 0.0
                    for e in range(extras.shape[1]):
                        extras[k, e, first + b] = math.nan
                    for i in range(n):
                        x[i, b] = y[i, b]
                        for j in range(i + 1):
                            q[i, j, b] = p[i, j, b]
            mirror(q, used, p)
            store_vectors(x, first, used, means[k])
            store_symmetric(p, first, used, covariances[k])
    return K


# What follows takes the arguments of `filtered`, with settings of its own.
@kernel_like(filtered, *_GIVEN, TRANSFORM, *_FILLED, room=room_for_points, update=update_by_points)
def filtered_by_points(*arguments: Any) -> int:
    """Do the same by the unscented Kalman filter; settings are a `point_step.Transform`."""
    return 0


@kernel_like(filtered, *_GIVEN, TEMPERED, *_FILLED, wide=True, room=room_for_samples, update=update_by_samples)
def filtered_by_samples(*arguments: Any) -> int:
    """Do the same by the alpha-divergence filter of fixed samples; settings and extras are of `sample_step`."""
    return 0


@kernel_like(filtered, *_GIVEN, STUDENT_T, *_FILLED, room=room_for_student_t, update=update_by_student_t)
def filtered_by_student_t(*arguments: Any) -> int:
    """Do the same by the extended filter with Student-t noise; settings and extras are of `reweighted_step`."""
    return 0


@inner
def _count(marked: Mask, first: int, used: int) -> int:
    """Return how many of the runs from `first` on are marked."""
    count = 0
    for b in range(used):
        count += marked[first + b]
    return count
