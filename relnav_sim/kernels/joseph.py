"""The Kalman update in Joseph's form throughout (Bucy and Joseph, Filtering for Stochastic Processes, 1968).

`kalman.update` takes it only where the short form loses digits; in single precision that is nearly everywhere.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, number, single
from relnav_sim.kernels.elementary import log
from relnav_sim.kernels.lanes import (
    LANES,
    back,
    factor,
    forward,
    forward_vectors,
    load,
    load_vectors,
    product,
    product_by_transpose,
    store_symmetric,
    store_vectors,
)
from relnav_sim.kernels.scores import places

_LOG_TWO_PI = math.log(2 * math.pi)


@kernel(given(2), given(3), given(2), given(3), given(3), number)
def update(m: Array, P: Array, nu: Array, H: Array, R: Array, eps: float) -> tuple[Array, Array, Array, Array, Indices]:
    """Return mean (runs, n), covariance (runs, n, n), NIS and log-likelihood (runs,), and which runs are indefinite.

    Those are the runs in which S or the covariance has no Cholesky factor, to the unit of rounding. A state without
    variance counts as known.

    Args:
        m: Predicted means (runs, n).
        P: Their covariances (runs, n, n), symmetric.
        nu: Residuals z - h(m), (runs, k).
        H: Jacobians (runs, k, n), or (1, k, n) for all runs.
        R: Measurement noise (runs, k, k) or (1, k, k).
        eps: Unit of rounding.
    """
    runs, n = m.shape
    k = nu.shape[1]
    mean, covariance = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype)
    nis, log_likelihood, lost = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    x, p, h = np.empty((n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((k, n, LANES), m.dtype)
    r, S, L = np.empty((k, k, LANES), m.dtype), np.empty((k, k, LANES), m.dtype), np.empty((k, k, LANES), m.dtype)
    K, w, T = np.empty((k, n, LANES), m.dtype), np.empty((k, LANES), m.dtype), np.empty((k, n, LANES), m.dtype)
    A, M, C = np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(P, first, used, p)
        load(H, first, used, h)
        load(R, first, used, r)
        load_vectors(nu, first, used, w)
        product(h, p, used, K)
        product_by_transpose(K, h, used, S)
        for i in range(k):
            for j in range(k):
                for b in range(used):
                    S[i, j, b] += r[i, j, b]
        factor(S, used, L)
        forward(L, used, K)
        forward_vectors(L, used, w)
        for c in range(k):
            for i in range(n):
                for b in range(used):
                    x[i, b] += K[c, i, b] * w[c, b]
        _score(w, S, L, first, used, eps, nis, log_likelihood, lost)
        # From here on K is the transpose of the gain: (I - K H) P (I - K H)^T + K R K^T.
        back(L, used, K)
        for i in range(n):
            for j in range(n):
                for b in range(used):
                    A[i, j, b] = 1.0 if i == j else 0.0
                for c in range(k):
                    for b in range(used):
                        A[i, j, b] -= K[c, i, b] * h[c, j, b]
        product(A, p, used, M)
        product(r, K, used, T)
        for i in range(n):
            for j in range(i + 1):
                for b in range(used):
                    p[i, j, b] = M[i, 0, b] * A[j, 0, b]
                for c in range(1, n):
                    for b in range(used):
                        p[i, j, b] += M[i, c, b] * A[j, c, b]
                for c in range(k):
                    for b in range(used):
                        p[i, j, b] += K[c, i, b] * T[c, j, b]
        _mark_indefinite(p, first, used, eps, C, M, lost)
        store_vectors(x, first, used, mean)
        store_symmetric(p, first, used, covariance)
    return mean, covariance, nis, log_likelihood, places(lost)


@kernel(
    given(2, single),
    given(3, single),
    given(3, single),
    given(2, single),
    given(3, single),
    given(3, single),
    given(3, single),
    single,
    single,
    number,
)
def update_by_points(
    m: Array,
    offsets: Array,
    d: Array,
    nu: Array,
    S: Array,
    C: Array,
    R: Array,
    weight: float,
    centre_weight: float,
    eps: float,
) -> tuple[Array, Array, Array, Array, Indices]:
    """Return the same as `update` from sigma points, in float32.

    With S = w sum(d_i d_i^T) + w_0 s s^T + R, where the d_i are deviations from the mean of the measurements, C the
    covariance with the state and K = C^T S^-1, P - K S K^T is w sum(a_i a_i^T) + w_0 (K s) (K s)^T + K R K^T with
    a_i = x_i - K d_i: no difference of covariances is taken, and with w_0 >= 0 it is a sum of squares.

    Args:
        m: Predicted means (runs, n).
        offsets: x_i, of the points from the mean, (runs, 2 n, n).
        d: Deviations of the measurements from that of the centre, which comes first, (runs, 2 n + 1, k).
        nu: Residuals (runs, k).
        S: Covariances of the residual (runs, k, k).
        C: Covariances of measurement and state (runs, k, n).
        R: Measurement noise (runs, k, k) or (1, k, k).
        weight: w.
        centre_weight: w_0.
        eps: Unit of rounding.
    """
    runs, points, n = offsets.shape
    k = nu.shape[1]
    mean, covariance = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype)
    nis, log_likelihood, lost = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    x, K, T = np.empty((n, LANES), m.dtype), np.empty((k, n, LANES), m.dtype), np.empty((k, n, LANES), m.dtype)
    a, both = np.empty((points, n, LANES), m.dtype), np.empty((points + 1, k, LANES), m.dtype)
    r, V, L = np.empty((k, k, LANES), m.dtype), np.empty((k, k, LANES), m.dtype), np.empty((k, k, LANES), m.dtype)
    w, s, Ks = np.empty((k, LANES), m.dtype), np.empty((k, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    p, A, B = np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    y = both[1:]
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(offsets, first, used, a)
        load(d, first, used, both)
        load(S, first, used, V)
        load(C, first, used, K)
        load(R, first, used, r)
        load_vectors(nu, first, used, w)
        factor(V, used, L)
        forward(L, used, K)
        forward_vectors(L, used, w)
        for c in range(k):
            for i in range(n):
                for b in range(used):
                    x[i, b] += K[c, i, b] * w[c, b]
        _score(w, V, L, first, used, eps, nis, log_likelihood, lost)
        back(L, used, K)
        for c in range(k):
            for b in range(used):
                s[c, b] = 0.0
            for point in range(points):
                for b in range(used):
                    s[c, b] += y[point, c, b]
            for b in range(used):
                s[c, b] *= weight
            for point in range(points):
                for b in range(used):
                    y[point, c, b] -= s[c, b]
        for i in range(n):
            for b in range(used):
                Ks[i, b] = 0.0
            for c in range(k):
                for b in range(used):
                    Ks[i, b] += K[c, i, b] * s[c, b]
                for point in range(points):
                    for b in range(used):
                        a[point, i, b] -= K[c, i, b] * y[point, c, b]
        product(r, K, used, T)
        for i in range(n):
            for j in range(i + 1):
                for b in range(used):
                    p[i, j, b] = 0.0
                for point in range(points):
                    for b in range(used):
                        p[i, j, b] += a[point, i, b] * a[point, j, b]
                for b in range(used):
                    p[i, j, b] = weight * p[i, j, b] + centre_weight * (Ks[i, b] * Ks[j, b])
                for c in range(k):
                    for b in range(used):
                        p[i, j, b] += K[c, i, b] * T[c, j, b]
        _mark_indefinite(p, first, used, eps, A, B, lost)
        store_vectors(x, first, used, mean)
        store_symmetric(p, first, used, covariance)
    return mean, covariance, nis, log_likelihood, places(lost)


@inner
def _score(
    w: Array,
    S: Array,
    L: Array,
    first: int,
    used: int,
    eps: float,
    nis: Array,
    log_likelihood: Array,
    lost: Mask,
) -> None:
    """Set NIS and log-likelihood by whitened residuals w (k,), and mark the runs in which S = L L^T is indefinite."""
    k = len(w)
    for b in range(used):
        nis[first + b], log_likelihood[first + b] = 0.0, -0.5 * k * _LOG_TWO_PI
    for c in range(k):
        for b in range(used):
            lost[first + b] |= not L[c, c, b] * L[c, c, b] > eps * S[c, c, b]
            nis[first + b] += w[c, b] * w[c, b]
            log_likelihood[first + b] -= log(np.float64(L[c, c, b]))
    for b in range(used):
        log_likelihood[first + b] -= 0.5 * nis[first + b]


@inner
def _mark_indefinite(P: Array, first: int, used: int, eps: float, C: Array, L: Array, lost: Mask) -> None:
    """Mark the runs in which P has no factor to the unit of rounding; C and L (n, n) are room for it."""
    n = len(P)
    for i in range(n):
        for j in range(i + 1):
            for b in range(used):
                C[i, j, b] = P[i, j, b] if i != j or P[i, i, b] != 0 else 1.0
    factor(C, used, L)
    for i in range(n):
        for b in range(used):
            lost[first + b] |= not L[i, i, b] * L[i, i, b] > eps * C[i, i, b]


@kernel_like(update, given(2, single), given(3, single), given(2, single), given(3, single), given(3, single), number)
def update_single(
    m: Array, P: Array, nu: Array, H: Array, R: Array, eps: float
) -> tuple[Array, Array, Array, Array, Indices]:
    """Return the same as `update`, in float32."""
    return m, P, nu, nu, places(m[:, 0] > 0)
