"""The Kalman filter's prediction and update (Kalman, J. Basic Engineering 82(1), 1960)."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, single
from relnav_sim.kernels.lanes import (
    LANES,
    add_image,
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
from relnav_sim.kernels.scores import WIDE, WIDEST, doubtful, exceeds, places, score, singular

_EPS = float(np.finfo(float).eps)


@kernel(given(3), given(3), given(3))
def predict(P: Array, F: Array, Q: Array) -> Array:
    """Return F P F^T + Q, (runs, m, m), symmetric to the bit.

    Args:
        P: Covariances (runs, n, n), symmetric.
        F: (runs, m, n), or (1, m, n) for all runs, as Q; also a Jacobian H, m channels of a measurement by n states.
        Q: Covariance of the process noise, or of the measurement's, (runs, m, m).
    """
    m = F.shape[1]
    predicted = np.empty((len(P), m, m), P.dtype)
    _carry(P, F, Q, predicted)
    return predicted


@kernel(given(2), given(3), given(3), given(3))
def predict_linear(m: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Return the mean F m, (runs, n), and the covariance of `predict`; m (runs, n)."""
    runs, n = m.shape
    mean, predicted = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype)
    x, y, f = np.empty((n, LANES), m.dtype), np.empty((n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        if len(F) > 1:
            load(F, first, used, f)
            y[:] = 0.0
            add_image(f, x, used, y)
        else:
            carry_mean_by_one(x, F[0], used, y)
        store_vectors(y, first, used, mean)
    _carry(P, F, Q, predicted)
    return mean, predicted


@kernel_like(predict, given(3, single), given(3, single), given(3, single))
def predict_single(P: Array, F: Array, Q: Array) -> Array:
    """Return the same as `predict`, in float32."""
    return P


@kernel_like(predict_linear, given(2, single), given(3, single), given(3, single), given(3, single))
def predict_linear_single(m: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Return the same as `predict_linear`, in float32."""
    return m, P


@inner
def _carry(P: Array, F: Array, Q: Array, out: Array) -> None:
    """Set out to F P F^T + Q of every run."""
    runs, n, _ = P.shape
    m = F.shape[1]
    p, q = np.empty((n, n, LANES), P.dtype), np.empty((m, m, LANES), P.dtype)
    fp, f = np.empty((m, n, LANES), P.dtype), np.empty((m, n, LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        load(Q, first, used, q)
        for i in range(m):
            for j in range(i + 1):
                for b in range(used):
                    q[i, j, b] += 0.0  # not -0, as no sum with it is
        if len(F) > 1:
            load(F, first, used, f)
            product(f, p, used, fp)
            for i in range(m):
                for j in range(i + 1):
                    for k in range(n):
                        for b in range(used):
                            q[i, j, b] += fp[i, k, b] * f[j, k, b]
        else:
            multiply_by_one(F[0], p, used, fp)
            multiply_by_transpose_of_one(fp, F[0], used, q)
        store_symmetric(q, first, used, out)


@inner
def carry_mean_by_one(x: Array, F: Array, used: int, y: Array) -> None:
    """Set y to F x, (n, LANES) both, by one F (n, n) for all."""
    for i in range(len(x)):
        for b in range(used):
            y[i, b] = 0.0
        for j in range(len(x)):
            for b in range(used):
                y[i, b] += F[i, j] * x[j, b]


@inner
def multiply_by_one(F: Array, p: Array, used: int, fp: Array) -> None:
    """Set fp (m, n, LANES) to F p by one F (m, n) for all, whose zeros, often half of it, are passed over."""
    m, n = F.shape
    for i in range(m):
        for j in range(n):
            for b in range(used):
                fp[i, j, b] = 0.0
            for k in range(n):
                if F[i, k] != 0:
                    for b in range(used):
                        fp[i, j, b] += F[i, k] * p[k, j, b]


@inner
def multiply_by_transpose_of_one(fp: Array, F: Array, used: int, q: Array) -> None:
    """Add to the lower triangle of q (m, m, LANES) that of fp F^T, as `multiply_by_one`."""
    m, n = F.shape
    for i in range(m):
        for j in range(i + 1):
            for k in range(n):
                if F[j, k] != 0:
                    for b in range(used):
                        q[i, j, b] += fp[i, k, b] * F[j, k]


@kernel(given(2), given(3), given(2), given(3), given(3))
def update(m: Array, P: Array, nu: Array, H: Array, R: Array) -> tuple[Array, Array, Array, Array, Indices]:
    """Return mean (runs, n), covariance (runs, n, n), NIS and log-likelihood (runs,), and which runs are lost.

    One Cholesky factor S = L L^T serves all: with W = L^-1 H P and w = L^-1 nu the mean moves by W^T w and the
    covariance becomes P - W^T W. That difference loses as many digits as the prior is wider than the noise, so runs
    where it is `WIDE` get Joseph's form instead (Bucy and Joseph, Filtering for Stochastic Processes, 1968). Lost are
    runs in which even that has no digits left, or S is as good as singular; those that have diverged are not.

    Args:
        m: Predicted means (runs, n).
        P: Their covariances (runs, n, n), symmetric.
        nu: Residuals z - h(m), (runs, k).
        H: Jacobians (runs, k, n), or (1, k, n) for all runs.
        R: Measurement noise (runs, k, k) or (1, k, k).
    """
    runs, n = m.shape
    k = nu.shape[1]
    mean, covariance = np.empty((runs, n)), np.empty((runs, n, n))
    nis, log_likelihood, lost = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    x, p, h, r = np.empty((n, LANES)), np.empty((n, n, LANES)), np.empty((k, n, LANES)), np.empty((k, k, LANES))
    S, L, W, w = np.empty((k, k, LANES)), np.zeros((k, k, LANES)), np.empty((k, n, LANES)), np.empty((k, LANES))
    short = np.empty((n, n, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(P, first, used, p)
        load(H, first, used, h)
        load(R, first, used, r)
        load_vectors(nu, first, used, w)
        correct(x, p, w, h, r, used, S, L, W, short, first, nis, log_likelihood)
        if doubtful(S, r, L, used):
            for b in range(used):
                if singular(S, L, b) or exceeds(S, r, b, WIDEST):
                    lost[first + b] = True
                elif exceeds(S, r, b, WIDE):
                    lost[first + b] = _joseph(b, p, h, r, L, W, short)
        store_vectors(x, first, used, mean)
        store_symmetric(short, first, used, covariance)
    return mean, covariance, nis, log_likelihood, places(lost)


@inner
def correct(
    x: Array,
    p: Array,
    w: Array,
    h: Array,
    r: Array,
    used: int,
    S: Array,
    L: Array,
    W: Array,
    short: Array,
    first: int,
    nis: Array,
    log_likelihood: Array,
) -> None:
    """Update the lanes of the runs from `first` on, as `update` does, by the short form of the covariance.

    Args:
        x: Means (n, LANES), replaced.
        p: Covariances (n, n, LANES).
        w: Residuals (k, LANES), lost.
        h: Jacobians (k, n, LANES).
        r: Measurement noise (k, k, LANES).
        used: How many lanes there are.
        S: Gets the covariances of the residuals (k, k, LANES).
        L: Gets their factors (k, k, LANES).
        W: Gets L^-1 H P, (k, n, LANES).
        short: Gets the lower triangles of the covariances (n, n, LANES).
        first: Number of the first run.
        nis: Gets the NIS of these runs, (runs,).
        log_likelihood: Gets their log-likelihoods, (runs,).
    """
    k = len(w)
    product(h, p, used, W)
    product_by_transpose(W, h, used, S)
    for i in range(k):
        for j in range(k):
            for b in range(used):
                S[i, j, b] += r[i, j, b]
    correct_by_moments(x, p, w, S, used, L, W, short, first, nis, log_likelihood)


@inner
def correct_by_moments(
    x: Array,
    p: Array,
    w: Array,
    S: Array,
    used: int,
    L: Array,
    W: Array,
    short: Array,
    first: int,
    nis: Array,
    log_likelihood: Array,
) -> None:
    """Do as `correct` from covariances S (k, k, LANES) of the residuals and W (k, n, LANES) of these and the state."""
    factor(S, used, L)
    forward(L, used, W)
    forward_vectors(L, used, w)
    move(W, w, used, x)
    subtract_square(p, W, used, short)
    score(w, L, first, used, nis, log_likelihood)


@kernel(given(2), given(3), given(2), given(3), given(3), given(3))
def update_by_moments(
    m: Array, P: Array, nu: Array, C: Array, S: Array, R: Array
) -> tuple[Array, Array, Array, Array, Indices]:
    """Return the same as `update` from moments that sigma points give; lost are runs that are `WIDE` or singular.

    Args:
        m: Predicted means (runs, n).
        P: Their covariances (runs, n, n), symmetric.
        nu: Residuals (runs, k).
        C: Covariances of measurement and state, (runs, k, n).
        S: Covariances of the residual (runs, k, k), symmetric.
        R: Measurement noise (runs, k, k) or (1, k, k).
    """
    runs, n = m.shape
    k = nu.shape[1]
    mean, covariance = np.empty((runs, n)), np.empty((runs, n, n))
    nis, log_likelihood, lost = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    x, p, r, s = np.empty((n, LANES)), np.empty((n, n, LANES)), np.empty((k, k, LANES)), np.empty((k, k, LANES))
    L, W, w = np.zeros((k, k, LANES)), np.empty((k, n, LANES)), np.empty((k, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(P, first, used, p)
        load(C, first, used, W)
        load(S, first, used, s)
        load(R, first, used, r)
        load_vectors(nu, first, used, w)
        correct_by_moments(x, p, w, s, used, L, W, p, first, nis, log_likelihood)
        if doubtful(s, r, L, used):
            for b in range(used):
                lost[first + b] = singular(s, L, b) or exceeds(s, r, b, WIDE)
        store_vectors(x, first, used, mean)
        store_symmetric(p, first, used, covariance)
    return mean, covariance, nis, log_likelihood, places(lost)


@inner
def move(W: Array, w: Array, used: int, x: Array) -> None:
    """Add W^T w to x (n,), W (k, n)."""
    for i in range(len(x)):
        for j in range(len(W)):
            for b in range(used):
                x[i, b] += W[j, i, b] * w[j, b]


@inner
def subtract_square(P: Array, W: Array, used: int, out: Array) -> None:
    """Set the lower triangle of out to that of P - W^T W, P (n, n), W (k, n); two terms at once, as in `product`."""
    k = len(W)
    for i in range(len(P)):
        for j in range(i + 1):
            if k % 2 == 1:
                for b in range(used):
                    out[i, j, b] = P[i, j, b] - W[0, i, b] * W[0, j, b]
            else:
                for b in range(used):
                    out[i, j, b] = P[i, j, b] - W[0, i, b] * W[0, j, b] - W[1, i, b] * W[1, j, b]
            for c in range(2 - k % 2, k, 2):
                for b in range(used):
                    out[i, j, b] = out[i, j, b] - W[c, i, b] * W[c, j, b] - W[c + 1, i, b] * W[c + 1, j, b]


@kernel(given(3), given(2))
def innovation(S: Array, nu: Array) -> tuple[Array, Array, Indices]:
    """Return NIS and log-likelihood (runs,) of residuals (runs, k) by their covariances (runs, k, k).

    The third array has the runs in which S is as good as singular, and the others don't count.
    """
    runs, k = nu.shape
    nis, log_likelihood, degenerate = np.empty(runs), np.empty(runs), np.zeros(runs, dtype=np.bool_)
    s, L, w = np.empty((k, k, LANES)), np.zeros((k, k, LANES)), np.empty((k, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(S, first, used, s)
        load_vectors(nu, first, used, w)
        factor(s, used, L)
        forward_vectors(L, used, w)
        score(w, L, first, used, nis, log_likelihood)
        for b in range(used):
            degenerate[first + b] = singular(s, L, b)
    return nis, log_likelihood, places(degenerate)


@inner
def _joseph(b: int, P: Array, H: Array, R: Array, L: Array, W: Array, covariance: Array) -> bool:
    """Set lane b of the covariance to (I - K H) P (I - K H)^T + K R K^T; return whether a variance is drowned.

    With M = (I - K H) P = P - K (H P) that is M + (K R - M H^T) K^T. A variance is drowned when it is below the
    rounding of the covariance that the update began with.
    """
    k, n = len(L), len(P)
    K, M, G, HP = np.empty((n, k)), np.empty((n, n)), np.empty((n, k)), np.empty((k, n))
    for c in range(k):
        for j in range(n):
            HP[c, j] = 0.0
            for i in range(n):
                HP[c, j] += H[c, i, b] * P[i, j, b]
    for i in range(n):  # K = W^T L^-1
        for j in range(k - 1, -1, -1):
            K[i, j] = W[j, i, b]
            for c in range(j + 1, k):
                K[i, j] -= L[c, j, b] * K[i, c]
            K[i, j] /= L[j, j, b]
    for i in range(n):
        for j in range(n):
            M[i, j] = P[max(i, j), min(i, j), b]
            for c in range(k):
                M[i, j] -= K[i, c] * HP[c, j]
    for i in range(n):
        for j in range(k):
            G[i, j] = 0.0
            for c in range(k):
                G[i, j] += K[i, c] * R[c, j, b]
            for c in range(n):
                G[i, j] -= M[i, c] * H[j, c, b]
    drowned = False
    for i in range(n):
        for j in range(i + 1):
            upper, lower = M[i, j], M[j, i]
            for c in range(k):
                upper += G[i, c] * K[j, c]
                lower += G[j, c] * K[i, c]
            covariance[i, j, b] = (upper + lower) / 2
        moved = 0.0
        for j in range(n):
            entry = 1.0 if i == j else 0.0
            for c in range(k):
                entry -= K[i, c] * H[c, j, b]
            moved += abs(entry) * math.sqrt(abs(P[j, j, b]))
        drowned |= covariance[i, i, b] < 8 * _EPS * moved * moved and P[i, i, b] != 0
    return drowned
