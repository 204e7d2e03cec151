"""The square-root information filter: L with L L^T = P^-1, by orthogonal transformations.

Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapters V and VI; L is the transpose of the
text's R. Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, number, single
from relnav_sim.kernels.elementary import log
from relnav_sim.kernels.lanes import (
    LANES,
    factor,
    forward,
    forward_vectors,
    load,
    load_vectors,
    solve,
    store,
    store_symmetric,
    store_vectors,
)
from relnav_sim.kernels.roots import triangularise
from relnav_sim.kernels.scores import places
from relnav_sim.kernels.ud import factor_upper

_LOG_TWO_PI = math.log(2 * math.pi)


@kernel(given(3), number)
def information(P: Array, eps: float) -> tuple[Array, Indices]:
    """Return L (runs, n, n), lower triangular, with L L^T = P^-1, and the runs whose P is singular.

    With P = U D U^T that is U^-T D^(-1/2).
    """
    runs, n, _ = P.shape
    root, flat = np.empty((runs, n, n), P.dtype), np.zeros(runs, dtype=np.bool_)
    p, u, d = np.empty((n, n, LANES), P.dtype), np.empty((n, n, LANES), P.dtype), np.empty((n, LANES), P.dtype)
    L = np.empty((n, n, LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        factor_upper(p, used, eps, u, d)
        for j in range(n):
            for i in range(n):
                for b in range(used):
                    L[i, j, b] = 1.0 if i == j else 0.0
                for k in range(j, i):
                    for b in range(used):
                        L[i, j, b] -= u[k, i, b] * L[k, j, b]
        for j in range(n):
            for b in range(used):
                flat[first + b] |= d[j, b] == 0
                d[j, b] = math.sqrt(d[j, b])
            for i in range(n):
                for b in range(used):
                    L[i, j, b] /= d[j, b]
        store(L, first, used, root)
    return root, places(flat)


@kernel(given(2), given(3), given(3), given(3), number)
def predict(m: Array, L: Array, F: Array, Q: Array, eps: float) -> tuple[Array, Array, Indices]:
    """Return F m (runs, n), the root of the information (F P F^T + Q)^-1, and the runs whose F is singular.

    With Q = G G^T and A = F^-T L the triangular form of [[I, -G^T A], [0, A]] has it at its lower right.

    Args:
        m: (runs, n).
        L: (runs, n, n).
        F: (runs, n, n), or (1, n, n) for all runs, as Q.
        Q: Positive semidefinite.
        eps: Unit of rounding.
    """
    runs, n = m.shape
    mean, root, flat = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype), np.zeros(runs, dtype=np.bool_)
    x, y, f = np.empty((n, LANES), m.dtype), np.empty((n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    t, A, q = np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    g, e = np.empty((n, n, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    M = np.empty((2 * n, 2 * n, LANES), m.dtype)
    if len(Q) == 1:
        load(Q, 0, LANES, q)
        _root(q, LANES, eps, g, e)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(L, first, used, A)
        load(F, first, used, f)
        if len(Q) > 1:
            load(Q, first, used, q)
            _root(q, used, eps, g, e)
        for i in range(n):
            for b in range(used):
                y[i, b] = f[i, 0, b] * x[0, b]
            for j in range(1, n):
                for b in range(used):
                    y[i, b] += f[i, j, b] * x[j, b]
            for j in range(n):
                for b in range(used):
                    t[i, j, b] = f[j, i, b]
        for b in range(used):
            flat[first + b] = math.isfinite(A[0, 0, b])
        solve(t, used, A)
        for b in range(used):
            flat[first + b] &= not math.isfinite(A[0, 0, b])
        for i in range(n):
            for j in range(n):
                for b in range(used):
                    M[i, j, b] = 1.0 if i == j else 0.0
                    M[i, n + j, b] = -(g[0, i, b] * A[0, j, b])
                    M[n + i, j, b] = 0.0
                    M[n + i, n + j, b] = A[i, j, b]
                for k in range(1, n):
                    for b in range(used):
                        M[i, n + j, b] -= g[k, i, b] * A[k, j, b]
        triangularise(M, used)
        store(M[n:, n:], first, used, root)
        store_vectors(y, first, used, mean)
    return mean, root, places(flat)


@kernel(given(2), given(3), given(2), given(3), given(3), number)
def update(m: Array, L: Array, nu: Array, H: Array, R: Array, eps: float) -> tuple[Array, Array, Array, Array, Indices]:
    """Return mean (runs, n), root of the information, NIS and log-likelihood (runs,), and the runs whose R is singular.

    With R = N N^T the triangular form of [[L, H^T N^-T], [0, nu^T N^-T]] is [[L+, 0], [b^T, sqrt(NIS)]], and the mean
    moves by L+^-T b.

    Args:
        m: Predicted means (runs, n).
        L: Roots of their information (runs, n, n).
        nu: Residuals z - h(m), (runs, k).
        H: Jacobians (runs, k, n), or (1, k, n) for all runs.
        R: Measurement noise, positive definite, (runs, k, k) or (1, k, k).
        eps: Unit of rounding.
    """
    runs, n = m.shape
    k = nu.shape[1]
    mean, root = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype)
    nis, log_likelihood, flat = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    x, w, h = np.empty((n, LANES), m.dtype), np.empty((k, LANES), m.dtype), np.empty((k, n, LANES), m.dtype)
    r, N = np.empty((k, k, LANES), m.dtype), np.empty((k, k, LANES), m.dtype)
    M, before = np.empty((n + 1, n + k, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(L, first, used, M[:n])
        load_vectors(nu, first, used, w)
        load(H, first, used, h)
        load(R, first, used, r)
        factor(r, used, N)
        forward(N, used, h)
        forward_vectors(N, used, w)
        for j in range(n):
            for b in range(used):
                before[j, b] = M[j, j, b]
                M[n, j, b] = 0.0
        for c in range(k):
            for i in range(n):
                for b in range(used):
                    M[i, n + c, b] = h[c, i, b]
            for b in range(used):
                M[n, n + c, b] = w[c, b]
        triangularise(M, used)
        for b in range(used):
            nis[first + b] = M[n, n, b] * M[n, n, b]
            log_likelihood[first + b] = -0.5 * (nis[first + b] + k * _LOG_TWO_PI)
        for c in range(k):
            for b in range(used):
                flat[first + b] |= not N[c, c, b] * N[c, c, b] > 8 * k * eps * r[c, c, b]
                log_likelihood[first + b] -= log(np.float64(N[c, c, b]))
        for i in range(n):
            for b in range(used):
                log_likelihood[first + b] -= log(np.float64(M[i, i, b])) - log(np.float64(before[i, b]))
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                for b in range(used):
                    M[n, i, b] -= M[j, i, b] * M[n, j, b]
            for b in range(used):
                M[n, i, b] /= M[i, i, b]
                x[i, b] += M[n, i, b]
        store_vectors(x, first, used, mean)
        store(M[:n], first, used, root)
    return mean, root, nis, log_likelihood, places(flat)


@kernel(given(3))
def covariance(L: Array) -> Array:
    """Return P = L^-T L^-1, (runs, n, n)."""
    runs, n, _ = L.shape
    covariances = np.empty((runs, n, n))
    root, X, P = np.empty((n, n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(L, first, used, root)
        for i in range(n):
            for j in range(n):
                for b in range(used):
                    X[i, j, b] = 1.0 if i == j else 0.0
        forward(root, used, X)
        for i in range(n):
            for j in range(i + 1):
                for b in range(used):
                    P[i, j, b] = X[i, i, b] * X[i, j, b]
                for k in range(i + 1, n):
                    for b in range(used):
                        P[i, j, b] += X[k, i, b] * X[k, j, b]
        store_symmetric(P, first, used, covariances)
    return covariances


@inner
def _root(Q: Array, used: int, eps: float, G: Array, D: Array) -> None:
    """Set G to a root of Q = G G^T, upper triangular."""
    n = len(Q)
    factor_upper(Q, used, eps, G, D)
    for j in range(n):
        for b in range(used):
            D[j, b] = math.sqrt(D[j, b])
        for i in range(j + 1):
            for b in range(used):
                G[i, j, b] *= D[j, b]


@kernel_like(predict, given(2, single), given(3, single), given(3, single), given(3, single), number)
def predict_single(m: Array, L: Array, F: Array, Q: Array, eps: float) -> tuple[Array, Array, Indices]:
    """Return the same as `predict`."""
    return m, L, places(m[:, 0] > 0)


@kernel_like(update, given(2, single), given(3, single), given(2, single), given(3, single), given(3, single), number)
def update_single(
    m: Array, L: Array, nu: Array, H: Array, R: Array, eps: float
) -> tuple[Array, Array, Array, Array, Indices]:
    """Return the same as `update`."""
    return m, L, nu, nu, places(m[:, 0] > 0)
