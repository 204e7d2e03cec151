"""Covariances as U D U^T: Thornton's time update and Bierman's measurement update.

Bierman, Factorization Methods for Discrete Sequential Estimation, 1977; Thornton and Bierman, Control and Dynamic
Systems 16, 1980. U is unit upper triangular, D diagonal and never negative, whatever the rounding: that is what the
form is for. Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.kernels.compiling import given, inner, integer, kernel, kernel_like, number, single
from relnav_sim.kernels.elementary import log
from relnav_sim.kernels.lanes import LANES, load, load_vectors, store, store_vectors

_LOG_TWO_PI = math.log(2 * math.pi)
_NEGATIVE = 1e10
"""Units of rounding by which a pivot may be negative, of a matrix that is positive semidefinite up to rounding."""
_REPEATED = 1e6
"""Units of rounding by which a measurement may differ from what is known exactly, before it contradicts that."""


@kernel(given(3), number)
def factor(P: Array, eps: float) -> tuple[Array, Array]:
    """Return U (runs, n, n) and D (runs, n) of P = U D U^T, positive semidefinite.

    A pivot within rounding of zero is zero. Runs whose matrix has a negative one beyond that are NaN.

    Args:
        P: (runs, n, n).
        eps: Unit of rounding, here and below.
    """
    runs, n, _ = P.shape
    U, D = np.empty((runs, n, n), P.dtype), np.empty((runs, n), P.dtype)
    p, u, d = np.empty((n, n, LANES), P.dtype), np.empty((n, n, LANES), P.dtype), np.empty((n, LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        factor_upper(p, used, eps, u, d)
        store(u, first, used, U)
        store_vectors(d, first, used, D)
    return U, D


@kernel(given(2), given(3), given(2), given(3), given(3), number)
def predict(m: Array, U: Array, D: Array, F: Array, Q: Array, eps: float) -> tuple[Array, Array, Array]:
    """Return the mean F m (runs, n) and the factors of F U D U^T F^T + Q.

    Args:
        m: (runs, n).
        U: (runs, n, n).
        D: (runs, n).
        F: (runs, n, n), or (1, n, n) for all runs, as Q.
        Q: Positive semidefinite.
        eps: Unit of rounding.
    """
    runs, n = m.shape
    mean, root, variances = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype), np.empty((runs, n), m.dtype)
    x, y, f = np.empty((n, LANES), m.dtype), np.empty((n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    q, u, d = np.empty((n, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    g, e = np.empty((n, n, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    W, weights, v = (
        np.empty((n, 2 * n, LANES), m.dtype),
        np.empty((2 * n, LANES), m.dtype),
        np.empty((2 * n, LANES), m.dtype),
    )
    if len(Q) == 1:
        load(Q, 0, LANES, q)
        factor_upper(q, LANES, eps, g, e)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(U, first, used, u)
        load_vectors(D, first, used, d)
        load(F, first, used, f)
        if len(Q) > 1:
            load(Q, first, used, q)
            factor_upper(q, used, eps, g, e)
        for i in range(n):
            for b in range(used):
                y[i, b] = f[i, 0, b] * x[0, b]
            for j in range(1, n):
                for b in range(used):
                    y[i, b] += f[i, j, b] * x[j, b]
        for i in range(n):
            for j in range(n):
                for b in range(used):
                    W[i, j, b] = f[i, j, b]
                    W[i, n + j, b] = g[i, j, b]
                for k in range(j):
                    for b in range(used):
                        W[i, j, b] += f[i, k, b] * u[k, j, b]
            for b in range(used):
                weights[i, b] = d[i, b]
                weights[n + i, b] = e[i, b]
        gram_schmidt(W, weights, used, v, u, d)
        store_vectors(y, first, used, mean)
        store(u, first, used, root)
        store_vectors(d, first, used, variances)
    return mean, root, variances


@kernel(given(2), given(3), given(2), given(2), given(3), given(3), given(1, integer), number)
def update(
    m: Array, U: Array, D: Array, nu: Array, H: Array, R: Array, considered: Integers, eps: float
) -> tuple[Array, Array, Array, Array, Array, int]:
    """Return mean (runs, n), U, D, NIS and log-likelihood (runs,) of the update, and how many runs it contradicts.

    With R = C r C^T by the same factorisation, the channels of C^-1 z have independent noises of variances r and are
    taken one after the other (Bierman 1977, section V.3). One without any variance, its own or the state's, tells
    nothing: it is passed over, or contradicts what is known, which has the NIS inf.

    Args:
        m: Predicted means (runs, n).
        U: Their factors (runs, n, n).
        D: (runs, n).
        nu: Residuals z - h(m), (runs, k).
        H: Jacobians (runs, k, n), or (1, k, n) for all runs.
        R: Measurement noise, positive semidefinite, (runs, k, k) or (1, k, k).
        considered: Places of the states that are accounted for but not estimated (Schmidt's update).
        eps: Unit of rounding.
    """
    runs, n = m.shape
    k = nu.shape[1]
    e = len(considered)
    mean, root, variances = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype), np.empty((runs, n), m.dtype)
    nis, log_likelihood, contradicted = np.empty(runs), np.empty(runs), 0
    x, u, d = np.empty((n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype), np.empty((n, LANES), m.dtype)
    h, r, w = np.empty((k, n, LANES), m.dtype), np.empty((k, k, LANES), m.dtype), np.empty((k, LANES), m.dtype)
    C, c = np.empty((k, k, LANES), m.dtype), np.empty((k, LANES), m.dtype)
    moved, gain, alpha = np.empty((n, LANES), m.dtype), np.empty((n, LANES), m.dtype), np.empty((k, LANES), m.dtype)
    f, v, s = np.empty((n, LANES), m.dtype), np.empty((n, LANES), m.dtype), np.empty((4, LANES), m.dtype)
    kept, weights, t = (
        np.zeros((n, n + k, LANES), m.dtype),
        np.zeros((n + k, LANES), m.dtype),
        np.empty((n + k, LANES), m.dtype),
    )
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load(U, first, used, u)
        load_vectors(D, first, used, d)
        load_vectors(nu, first, used, w)
        load(H, first, used, h)
        load(R, first, used, r)
        factor_upper(r, used, eps, C, c)
        decorrelate(C, used, h, w)
        for i in range(n):
            for b in range(used):
                moved[i, b] = 0.0
        for b in range(used):
            nis[first + b], log_likelihood[first + b] = 0.0, 0.0
        for channel in range(k):
            for b in range(used):
                if c[channel, b] == 0:
                    # Without noise of its own it may repeat, or contradict, what is known already.
                    told = _repeats(channel, b, x, u, d, h, w[channel, b], moved, eps)
                    if told > 0:
                        for i in range(n):
                            h[channel, i, b] = 0.0
                        c[channel, b] = math.inf
                    if told > 1:
                        nis[first + b] = math.inf
                        contradicted += 1
            scalar_update(channel, h, w, c, used, u, d, moved, f, v, gain, alpha, s)
            for b in range(used):
                if alpha[channel, b] != math.inf:
                    nis[first + b] += s[0, b] * s[0, b] / alpha[channel, b]
                    log_likelihood[first + b] -= 0.5 * (log(np.float64(alpha[channel, b])) + _LOG_TWO_PI)
            for place in range(e):
                for b in range(used):
                    kept[considered[place], n + channel, b] = gain[considered[place], b]
        for b in range(used):
            log_likelihood[first + b] -= 0.5 * nis[first + b]
        if e > 0:
            # What the update took from the considered block is put back; their means stay.
            for channel in range(k):
                for b in range(used):
                    weights[n + channel, b] = alpha[channel, b] if alpha[channel, b] != math.inf else 0.0
            for i in range(n):
                for j in range(n):
                    for b in range(used):
                        kept[i, j, b] = u[i, j, b]
                for b in range(used):
                    weights[i, b] = d[i, b]
            for place in range(e):
                for b in range(used):
                    moved[considered[place], b] = 0.0
            gram_schmidt(kept, weights, used, t, u, d)
        for i in range(n):
            for b in range(used):
                x[i, b] += moved[i, b]
        store_vectors(x, first, used, mean)
        store(u, first, used, root)
        store_vectors(d, first, used, variances)
    return mean, root, variances, nis, log_likelihood, contradicted


@inner
def factor_upper(P: Array, used: int, eps: float, U: Array, D: Array) -> None:
    """Set U (n, n) and D (n,) to the factors of P = U D U^T; the upper triangle of P is lost.

    Bierman 1977, section III.4, from the last column on.
    """
    n = len(P)
    for j in range(n):
        for b in range(used):
            D[j, b] = P[j, j, b]
    for j in range(n - 1, -1, -1):
        for i in range(n):
            for b in range(used):
                U[i, j, b] = 1.0 if i == j else 0.0
        for b in range(used):
            # The place of the diagonal's element is taken by the pivot; it holds how large the variance was until then.
            pivot, size = P[j, j, b], abs(D[j, b])
            if pivot > 8 * n * eps * size:
                D[j, b] = pivot
            elif pivot >= -_NEGATIVE * eps * size:
                D[j, b] = 0.0
            else:
                D[j, b] = math.nan
        for i in range(j):
            for b in range(used):
                # NaN in D goes into all that follows.
                if D[j, b] != 0:
                    U[i, j, b] = P[i, j, b] / D[j, b]
        for i in range(j):
            for k in range(i + 1):
                for b in range(used):
                    P[k, i, b] -= U[k, j, b] * P[i, j, b]


@inner
def gram_schmidt(W: Array, weights: Array, used: int, v: Array, U: Array, D: Array) -> None:
    """Set the factors U (n, n) and D (n,) of W diag(weights) W^T, W (n, q), which is lost, and weights (q,).

    The modified weighted Gram-Schmidt process (Bierman 1977, section VI.4): rows are made orthogonal from the last on.
    D is a sum of squares.
    """
    n, q, _ = W.shape
    for j in range(n - 1, -1, -1):
        for i in range(n):
            for b in range(used):
                U[i, j, b] = 1.0 if i == j else 0.0
        for b in range(used):
            v[0, b] = weights[0, b] * W[j, 0, b]
            D[j, b] = v[0, b] * W[j, 0, b]
        for k in range(1, q):
            for b in range(used):
                v[k, b] = weights[k, b] * W[j, k, b]
                D[j, b] += v[k, b] * W[j, k, b]
        for i in range(j):
            for b in range(used):
                U[i, j, b] = W[i, 0, b] * v[0, b]
            for k in range(1, q):
                for b in range(used):
                    U[i, j, b] += W[i, k, b] * v[k, b]
            for b in range(used):
                U[i, j, b] = U[i, j, b] / D[j, b] if D[j, b] != 0 else U[i, j, b] * 0
            for k in range(q):
                for b in range(used):
                    W[i, k, b] -= U[i, j, b] * W[j, k, b]


@inner
def decorrelate(C: Array, used: int, h: Array, w: Array) -> None:
    """Replace h (k, n) and w (k,) by C^-1 h and C^-1 w, C unit upper triangular."""
    k, n, _ = h.shape
    for i in range(k - 2, -1, -1):
        for j in range(i + 1, k):
            for b in range(used):
                w[i, b] -= C[i, j, b] * w[j, b]
            for place in range(n):
                for b in range(used):
                    h[i, place, b] -= C[i, j, b] * h[j, place, b]


@inner
def scalar_update(
    channel: int,
    h: Array,
    w: Array,
    c: Array,
    used: int,
    U: Array,
    D: Array,
    moved: Array,
    f: Array,
    v: Array,
    gain: Array,
    alpha: Array,
    s: Array,
) -> None:
    """Update the factors and what the mean has moved, (n,), by one channel (Bierman 1977, section V.3).

    Args:
        channel: Its place.
        h: Decorrelated Jacobian (k, n).
        w: Decorrelated residuals (k,).
        c: Their variances.
        used: Lanes in use.
        U: Changed, as D and `moved`.
        D: (n,).
        moved: (n,).
        f: Room for U^T h, (n,).
        v: Room for D f, (n,).
        gain: Becomes the gain, (n,).
        alpha: Its place of the channel becomes the variance of the innovation.
        s: Room, of which the first row becomes the innovation.
    """
    n = len(D)
    for b in range(used):
        s[0, b], s[1, b] = w[channel, b], c[channel, b]
    for j in range(n):
        for b in range(used):
            s[0, b] -= h[channel, j, b] * moved[j, b]
            f[j, b] = h[channel, j, b]
        for i in range(j):
            for b in range(used):
                f[j, b] += U[i, j, b] * h[channel, i, b]
        for b in range(used):
            v[j, b] = D[j, b] * f[j, b]
    for j in range(n):
        for b in range(used):
            before = s[1, b]
            s[1, b] = before + f[j, b] * v[j, b]
            # Before the first direction that a measurement without noise sees, nothing has moved yet.
            s[2, b] = -f[j, b] / before if before != 0 else f[j, b] * 0
            if s[1, b] != 0 and s[1, b] != math.inf:
                D[j, b] *= before / s[1, b]
            gain[j, b] = v[j, b]
        for i in range(j):
            for b in range(used):
                s[3, b] = U[i, j, b]
                U[i, j, b] += s[2, b] * gain[i, b]
                gain[i, b] += v[j, b] * s[3, b]
    for b in range(used):
        alpha[channel, b] = s[1, b]
    for i in range(n):
        for b in range(used):
            gain[i, b] /= alpha[channel, b]
            moved[i, b] += gain[i, b] * s[0, b]


@inner
def _repeats(channel: int, b: int, x: Array, U: Array, D: Array, h: Array, w: float, moved: Array, eps: float) -> int:
    """Return whether the state of lane b leaves a channel no variance: 1; 2 where the measurement contradicts it."""
    n = len(D)
    variance, size, left = 0.0, 0.0, w
    for j in range(n):
        f, own = h[channel, j, b], 0.0
        for i in range(j):
            f += U[i, j, b] * h[channel, i, b]
        variance += f * f * D[j, b]
        for i in range(j, n):
            own += U[j, i, b] * U[j, i, b] * D[i, b]
        size += abs(h[channel, j, b]) * (abs(x[j, b]) + abs(moved[j, b]) + math.sqrt(own))
        left -= h[channel, j, b] * moved[j, b]
    if not variance <= (16 * n * eps * size) ** 2:
        return 0
    return 2 if abs(left) > _REPEATED * eps * size else 1


@kernel_like(factor, given(3, single), number)
def factor_single(P: Array, eps: float) -> tuple[Array, Array]:
    """Return the same as `factor`."""
    return P, P[0]


@kernel_like(predict, given(2, single), given(3, single), given(2, single), given(3, single), given(3, single), number)
def predict_single(m: Array, U: Array, D: Array, F: Array, Q: Array, eps: float) -> tuple[Array, Array, Array]:
    """Return the same as `predict`."""
    return m, U, D


@kernel_like(
    update,
    given(2, single),
    given(3, single),
    given(2, single),
    given(2, single),
    given(3, single),
    given(3, single),
    given(1, integer),
    number,
)
def update_single(
    m: Array, U: Array, D: Array, nu: Array, H: Array, R: Array, considered: Integers, eps: float
) -> tuple[Array, Array, Array, Array, Array, int]:
    """Return the same as `update`."""
    return m, U, D, nu, nu, 0
