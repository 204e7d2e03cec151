"""Square roots of covariances: Cholesky factors, and triangular forms by Householder's reflections.

Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, single
from relnav_sim.kernels.lanes import (
    LANES,
    back,
    factor,
    forward,
    forward_vectors,
    load,
    load_vectors,
    store,
    store_vectors,
)
from relnav_sim.kernels.scores import score

_EPS = float(np.finfo(float).eps)
_KNOWN = 16.0
"""Units of rounding of a state's deviations, times their number, within which what is left of them is no variance."""


@kernel(given(3))
def cholesky(P: Array) -> tuple[Array, Mask, int]:
    """Return the Cholesky factor L (runs, n, n), where P is as good as singular (runs,), and in how many runs it is.

    It is where a pivot is within rounding of zero or no number.
    """
    runs, n, _ = P.shape
    root, poor, count = np.zeros((runs, n, n), P.dtype), np.empty(runs, dtype=np.bool_), 0
    p, L = np.empty((n, n, LANES), P.dtype), np.zeros((n, n, LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        factor(p, used, L)
        store(L, first, used, root)
        count += mark_poor(p, L, first, used, poor)
    return root, poor, count


@kernel(given(3), given(3))
def solve(P: Array, B: Array) -> tuple[Array, Mask, int]:
    """Return P^-1 B (runs, n, q), where P is as good as singular (runs,), and in how many runs it is.

    Args:
        P: Symmetric (runs, n, n).
        B: (runs, n, q), or (1, n, q) for all runs.
    """
    runs, n, _ = P.shape
    solution, poor, count = np.empty((runs, n, B.shape[2]), P.dtype), np.empty(runs, dtype=np.bool_), 0
    p, L = np.empty((n, n, LANES), P.dtype), np.zeros((n, n, LANES), P.dtype)
    x = np.empty((n, B.shape[2], LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        load(B, first, used, x)
        factor(p, used, L)
        forward(L, used, x)
        back(L, used, x)
        store(x, first, used, solution)
        count += mark_poor(p, L, first, used, poor)
    return solution, poor, count


@kernel(given(3), given(3))
def whiten(P: Array, B: Array) -> tuple[Array, Mask, int]:
    """Return L^-1 B (runs, n, q) for P = L L^T, and otherwise the same as `solve`."""
    runs, n, _ = P.shape
    white, poor, count = np.empty((runs, n, B.shape[2]), P.dtype), np.empty(runs, dtype=np.bool_), 0
    p, L = np.empty((n, n, LANES), P.dtype), np.zeros((n, n, LANES), P.dtype)
    x = np.empty((n, B.shape[2], LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        load(B, first, used, x)
        factor(p, used, L)
        forward(L, used, x)
        store(x, first, used, white)
        count += mark_poor(p, L, first, used, poor)
    return white, poor, count


@inner
def mark_poor(P: Array, L: Array, first: int, used: int, poor: Mask) -> int:
    """Set in which runs from `first` on a pivot of P = L L^T is within rounding of zero, or no number; count them."""
    count = 0
    for b in range(used):
        clear = True
        for i in range(len(P)):
            clear &= L[i, i, b] * L[i, i, b] > 8 * len(P) * _EPS * P[i, i, b]
        poor[first + b] = not clear
        count += not clear
    return count


@kernel(given(3), given(3))
def triangular(A: Array, B: Array) -> Array:
    """Return the lower-triangular L (runs, p, p), diagonal >= 0, with L L^T = A A^T + B B^T.

    The squares, whose condition numbers are the square of the roots', are never formed.

    Args:
        A: (runs, p, q).
        B: (runs, p, r), or (1, p, r) for all runs; q + r >= p.
    """
    runs, p, q = A.shape
    root = np.empty((runs, p, p), A.dtype)
    M = np.empty((p, q + B.shape[2], LANES), A.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(A, first, used, M)
        load(B, first, used, M[:, q:])
        triangularise(M, used)
        store(M, first, used, root)
    return root


@kernel(given(3), given(3), given(3), given(2), given(2))
def update(
    X: Array, Y: Array, N: Array, nu: Array, reading: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Mask, int]:
    """Return the Kalman update from the triangular form of [[Y, N], [X, 0]], which is [[L, 0], [K L, P^(1/2)]].

    Kaminski, Bryson and Schmidt, IEEE Trans. Automatic Control 16(6), 1971. L is the root of S.

    Args:
        X: Deviations of the state, (runs, n, q), q >= n.
        Y: The same of the measurement, (runs, m, q).
        N: Root of the measurement noise (runs, m, r) or (1, m, r).
        nu: Residuals (runs, m).
        reading: How large the compared measurements and their parts are, (runs, m).

    Returns:
        K L (runs, n, m), P^(1/2) (runs, n, n), L (runs, m, m), L^-1 nu (runs, m), NIS and log-likelihood (runs,), and
        the runs in which a channel has no variance of its own beyond rounding, where the others don't count, and how
        many there are. Rows of P^(1/2) that hold nothing but rounding are zero.
    """
    runs, n, q = X.shape
    m = nu.shape[1]
    gain, root = np.empty((runs, n, m), X.dtype), np.empty((runs, n, n), X.dtype)
    S_root, white = np.empty((runs, m, m), X.dtype), np.empty((runs, m), X.dtype)
    nis, log_likelihood = np.empty(runs), np.empty(runs)
    dead, count = np.zeros(runs, dtype=np.bool_), 0
    M, w = np.empty((m + n, q + N.shape[2], LANES), X.dtype), np.empty((m, LANES), X.dtype)
    size = np.empty((m + n, LANES), X.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(Y, first, used, M)
        load(N, first, used, M[:, q:])
        load(X, first, used, M[m:])
        for i in range(m, m + n):
            for j in range(q, M.shape[1]):
                for b in range(used):
                    M[i, j, b] = 0.0
        load_vectors(nu, first, used, w)
        _norms(M, used, size)
        triangularise(M, used)
        forward_vectors(M[:m], used, w)
        store(M[:m], first, used, S_root)
        store(M[m:], first, used, gain)
        store_vectors(w, first, used, white)
        score(w, M[:m], first, used, nis, log_likelihood)
        for b in range(used):
            run = first + b
            for i in range(m):
                dead[run] |= M[i, i, b] <= 16 * m * _EPS * (size[i, b] + reading[run, i])
            count += dead[run]
            for i in range(n):
                total = 0.0
                for j in range(i + 1):
                    total += M[m + i, m + j, b] * M[m + i, m + j, b]
                # A state that is left with nothing but the rounding of its deviations is known.
                left = 1.0 if math.sqrt(total) > _KNOWN * (n + m) * _EPS * size[m + i, b] else 0.0
                for j in range(n):
                    root[run, i, j] = left * M[m + i, m + j, b]
    return gain, root, S_root, white, nis, log_likelihood, dead, count


@kernel(given(3), given(2), given(3), given(2))
def squares(W: Array, a: Array, U: Array, b: Array) -> Array:
    """Return |W a|^2 + |U b|^2, (runs,), for W (runs, n, n), a (runs, n), U (runs, m, m), b (runs, m)."""
    runs, n = a.shape
    m = b.shape[1]
    found, total = np.empty(runs, a.dtype), np.empty(LANES, a.dtype)
    w, u = np.empty((n, n, LANES), a.dtype), np.empty((m, m, LANES), a.dtype)
    x, y = np.empty((n, LANES), a.dtype), np.empty((m, LANES), a.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(W, first, used, w)
        load(U, first, used, u)
        load_vectors(a, first, used, x)
        load_vectors(b, first, used, y)
        squares_of(w, x, u, y, used, total)
        for lane in range(used):
            found[first + lane] = total[lane]
    return found


@inner
def squares_of(W: Array, x: Array, U: Array, y: Array, used: int, total: Array) -> None:
    """Set total (LANES,) to |W x|^2 + |U y|^2."""
    other = np.empty(LANES, total.dtype)
    _square_of(W, x, used, total)
    _square_of(U, y, used, other)
    for b in range(used):
        total[b] += other[b]


@inner
def _square_of(W: Array, x: Array, used: int, total: Array) -> None:
    """Set total (LANES,) to |W x|^2."""
    entry = np.empty(LANES, total.dtype)
    for b in range(used):
        total[b] = 0.0
    for i in range(len(W)):
        for b in range(used):
            entry[b] = 0.0
        for j in range(len(x)):
            for b in range(used):
                entry[b] += W[i, j, b] * x[j, b]
        for b in range(used):
            total[b] += entry[b] * entry[b]


@inner
def _norms(M: Array, used: int, size: Array) -> None:
    """Set the norms of the rows of M (p, q)."""
    for i in range(len(M)):
        for b in range(used):
            size[i, b] = 0.0
        for j in range(M.shape[1]):
            for b in range(used):
                size[i, b] += M[i, j, b] * M[i, j, b]
        for b in range(used):
            size[i, b] = math.sqrt(size[i, b])


@inner
def triangularise(M: Array, used: int) -> None:
    """Replace M (p, q), q >= p, by M times an orthogonal matrix, lower triangular with a diagonal >= 0.

    Row by row with a reflection I - beta v v^T of the columns from the diagonal on (Golub and Van Loan, Matrix
    Computations, 4th ed., section 5.1).
    """
    p, q, _ = M.shape
    norm, beta, head = np.empty(LANES, M.dtype), np.empty(LANES, M.dtype), np.empty(LANES, M.dtype)
    sign, t = np.empty(LANES, M.dtype), np.empty(LANES, M.dtype)
    for i in range(p):
        for b in range(used):
            norm[b] = 0.0
        for j in range(i, q):
            for b in range(used):
                norm[b] += M[i, j, b] * M[i, j, b]
        for b in range(used):
            norm[b] = math.sqrt(norm[b])
            # The image of the row is -sign norm, so that nothing cancels in the head of v.
            sign[b] = -1.0 if M[i, i, b] < 0 else 1.0
            head[b] = M[i, i, b] + sign[b] * norm[b]
            beta[b] = 1 / (norm[b] * abs(head[b])) if norm[b] != 0 else 0.0
        for k in range(i + 1, p):
            for b in range(used):
                t[b] = M[k, i, b] * head[b]
            for j in range(i + 1, q):
                for b in range(used):
                    t[b] += M[k, j, b] * M[i, j, b]
            for b in range(used):
                t[b] *= beta[b]
                M[k, i, b] = -sign[b] * (M[k, i, b] - t[b] * head[b])
            for j in range(i + 1, q):
                for b in range(used):
                    M[k, j, b] -= t[b] * M[i, j, b]
        for b in range(used):
            M[i, i, b] = norm[b]
        for j in range(i + 1, q):
            for b in range(used):
                M[i, j, b] = 0.0


@kernel_like(cholesky, given(3, single))
def cholesky_single(P: Array) -> tuple[Array, Mask, int]:
    """Return the same as `cholesky`; what counts as singular is as there."""
    return P, P[:, 0, 0] > 0, 0


@kernel_like(solve, given(3, single), given(3, single))
def solve_single(P: Array, B: Array) -> tuple[Array, Mask, int]:
    """Return the same as `solve`; what counts as singular is as there."""
    return B, P[:, 0, 0] > 0, 0


@kernel_like(whiten, given(3, single), given(3, single))
def whiten_single(P: Array, B: Array) -> tuple[Array, Mask, int]:
    """Return the same as `whiten`; what counts as singular is as there."""
    return B, P[:, 0, 0] > 0, 0


@kernel_like(squares, given(3, single), given(2, single), given(3, single), given(2, single))
def squares_single(W: Array, a: Array, U: Array, b: Array) -> Array:
    """Return the same as `squares`."""
    return a


@kernel_like(triangular, given(3, single), given(3, single))
def triangular_single(A: Array, B: Array) -> Array:
    """Return the same as `triangular`."""
    return A


@kernel_like(
    update,
    given(3, single),
    given(3, single),
    given(3, single),
    given(2, single),
    given(2, single),
    _EPS=float(np.finfo(np.float32).eps),
    _KNOWN=0.0,
)
def update_single(
    X: Array, Y: Array, N: Array, nu: Array, reading: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Mask, int]:
    """Return the same as `update`, but no state counts as known: in float32 sigmas differ by all its digits."""
    return X, X, X, nu, nu, nu, nu[:, 0] > 0, 0
