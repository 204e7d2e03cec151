"""The error of linear Kalman filters on position fixes, without their states: estimate less truth, epoch by epoch.

A filter's gain does not depend on what it reads, and its error e follows e- = F e - d, e+ = e- + K (w - H e-), where d
is what its dynamics leave out of the truth in a step and w the measurement's error (Jazwinski, Stochastic Processes and
Filtering Theory, 1970, section 7.8). Some flops are saved where Clohessy-Wiltshire's F has zeros.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels.compiling import given, integer, kernel, written


@kernel(given(2), given(2), given(1))
def markov(decays: Array, normals: Array, sigmas: Array) -> Array:
    """Return stationary first-order Gauss-Markov series (K, 3) with these decays a step, (K, 1), and sizes (3,)."""
    count = normals.shape[0]
    series = np.empty((count, 3))
    for axis in range(3):
        value = sigmas[axis] * normals[0, axis]
        series[0, axis] = value
        for k in range(1, count):
            a = decays[k, 0]
            value = a * value + sigmas[axis] * np.sqrt(1.0 - a * a) * normals[k, axis]
            series[k, axis] = value
    return series


@kernel(
    given(3), given(3), given(2), given(1, integer), given(2), given(3), given(3), given(4), given(2), given(2),
    given(2), written(4), written(2),
)  # fmt: skip
def errors(
    F: Array,
    Q: Array,
    spans: Array,
    kinds: Integers,
    d: Array,
    R: Array,
    w: Array,
    g: Array,
    columns: Array,
    P0: Array,
    e0: Array,
    out: Array,
    formal: Array,
) -> None:
    """Write the errors of several filters over the same measurements.

    Args:
        F: Transition matrices of Clohessy-Wiltshire for each kind of step, (S, 6, 6).
        Q: Process noise of each kind of step for a white acceleration of density 1, (S, 6, 6).
        spans: Length of each kind of step, s, and how many measurements it stands for, (S, 2).
        kinds: Kind of each step, (K,).
        d: True state less the one that F makes of the true one before, (K, 6).
        R: Covariance of a step's measurement as the filters are told, (K, 3, 3).
        w: Errors of the measurements, (runs, K, 3).
        g: Normal numbers of sampled means, (filters or 1, runs, K, 6).
        columns: Of each filter: density of the acceleration, m^2/s^3; of a white velocity, m^2/s; factor of R; number
            of samples of a measurement, 0 for none drawn; (filters, 4).
        P0: First covariance, (6, 6).
        e0: First errors, (runs, 6).
        out: Errors after each step, (filters, runs, K, 6).
        formal: Formal standard deviation of the position after each step, (filters, K), m.
    """
    runs, steps = w.shape[0], w.shape[1]
    P, A, K, S, e = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 3)), np.empty((3, 3)), np.empty(6)
    L = np.zeros((6, 6))
    state = np.empty((runs, 6))
    for c in range(columns.shape[0]):
        qa, qp, factor, samples = columns[c, 0], columns[c, 1], columns[c, 2], columns[c, 3]
        P[:, :] = P0
        state[:, :] = e0
        for k in range(steps):
            s = kinds[k]
            f = F[s]
            for j in range(6):  # A = F P
                A[0, j] = f[0, 0] * P[0, j] + f[0, 3] * P[3, j] + f[0, 4] * P[4, j]
                A[1, j] = f[1, 0] * P[0, j] + P[1, j] + f[1, 3] * P[3, j] + f[1, 4] * P[4, j]
                A[2, j] = f[2, 2] * P[2, j] + f[2, 5] * P[5, j]
                A[3, j] = f[3, 0] * P[0, j] + f[3, 3] * P[3, j] + f[3, 4] * P[4, j]
                A[4, j] = f[4, 0] * P[0, j] + f[4, 3] * P[3, j] + f[4, 4] * P[4, j]
                A[5, j] = f[5, 2] * P[2, j] + f[5, 5] * P[5, j]
            for i in range(6):  # P = A F' + Q
                P[i, 0] = A[i, 0] * f[0, 0] + A[i, 3] * f[0, 3] + A[i, 4] * f[0, 4] + qa * Q[s, i, 0]
                P[i, 1] = A[i, 0] * f[1, 0] + A[i, 1] + A[i, 3] * f[1, 3] + A[i, 4] * f[1, 4] + qa * Q[s, i, 1]
                P[i, 2] = A[i, 2] * f[2, 2] + A[i, 5] * f[2, 5] + qa * Q[s, i, 2]
                P[i, 3] = A[i, 0] * f[3, 0] + A[i, 3] * f[3, 3] + A[i, 4] * f[3, 4] + qa * Q[s, i, 3]
                P[i, 4] = A[i, 0] * f[4, 0] + A[i, 3] * f[4, 3] + A[i, 4] * f[4, 4] + qa * Q[s, i, 4]
                P[i, 5] = A[i, 2] * f[5, 2] + A[i, 5] * f[5, 5] + qa * Q[s, i, 5]
            for i in range(3):
                P[i, i] += qp * spans[s, 0]
                for j in range(3):
                    S[i, j] = P[i, j] + factor * R[k, i, j]
            c00 = S[1, 1] * S[2, 2] - S[1, 2] * S[2, 1]
            c01 = S[0, 2] * S[2, 1] - S[0, 1] * S[2, 2]
            c02 = S[0, 1] * S[1, 2] - S[0, 2] * S[1, 1]
            c11 = S[0, 0] * S[2, 2] - S[0, 2] * S[2, 0]
            c12 = S[0, 2] * S[1, 0] - S[0, 0] * S[1, 2]
            c22 = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
            determinant = S[0, 0] * c00 + S[1, 0] * c01 + S[2, 0] * c02
            for i in range(6):
                K[i, 0] = (P[i, 0] * c00 + P[i, 1] * c01 + P[i, 2] * c02) / determinant
                K[i, 1] = (P[i, 0] * c01 + P[i, 1] * c11 + P[i, 2] * c12) / determinant
                K[i, 2] = (P[i, 0] * c02 + P[i, 1] * c12 + P[i, 2] * c22) / determinant
            for i in range(6):  # the lower triangle last: the upper rows are read until then
                for j in range(6):
                    A[i, j] = P[i, j] - K[i, 0] * P[0, j] - K[i, 1] * P[1, j] - K[i, 2] * P[2, j]
            for i in range(6):
                P[i, i] = A[i, i]
                for j in range(i):
                    P[i, j] = P[j, i] = 0.5 * (A[i, j] + A[j, i])
            formal[c, k] = np.sqrt(P[0, 0] + P[1, 1] + P[2, 2])
            if samples > 0:  # a mean of samples is off by their scatter: Cholesky factor of P
                for i in range(6):
                    for j in range(i + 1):
                        total = P[i, j]
                        for m in range(j):
                            total -= L[i, m] * L[j, m]
                        L[i, j] = np.sqrt(max(total, 0.0)) if i == j else total / max(L[j, j], 1e-150)
                scatter = np.sqrt(spans[s, 1] / samples)
            for run in range(runs):
                x = state[run]
                e[0] = f[0, 0] * x[0] + f[0, 3] * x[3] + f[0, 4] * x[4] - d[k, 0]
                e[1] = f[1, 0] * x[0] + x[1] + f[1, 3] * x[3] + f[1, 4] * x[4] - d[k, 1]
                e[2] = f[2, 2] * x[2] + f[2, 5] * x[5] - d[k, 2]
                e[3] = f[3, 0] * x[0] + f[3, 3] * x[3] + f[3, 4] * x[4] - d[k, 3]
                e[4] = f[4, 0] * x[0] + f[4, 3] * x[3] + f[4, 4] * x[4] - d[k, 4]
                e[5] = f[5, 2] * x[2] + f[5, 5] * x[5] - d[k, 5]
                v0, v1, v2 = w[run, k, 0] - e[0], w[run, k, 1] - e[1], w[run, k, 2] - e[2]
                for i in range(6):
                    value = e[i] + K[i, 0] * v0 + K[i, 1] * v1 + K[i, 2] * v2
                    if samples > 0:
                        for m in range(i + 1):
                            value += L[i, m] * g[c, run, k, m] * scatter
                    x[i] = value
                    out[c, run, k, i] = value
