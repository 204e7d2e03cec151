"""Roots of the Cramér-Rao bound, and of what measurements tell, from one epoch to the next.

Models are few and their epochs follow one another, so the numbers side by side are the columns of one matrix.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, short_for


@kernel(given(3), given(4), given(4), given(3))
def covariance_roots(root: Array, F: Array, noise_root: Array, W: Array) -> Array:
    """Return the upper-triangular roots R, R^T R = P, of the bound after each epoch, (K, models, n, n).

    With N = [R F^T; noise_root], a root of Q + F P F^T, an orthogonal triangularisation takes the information W^T W in:
    [[I, 0], [N W^T, N]] = U [[., .], [0, R+]] (the array form of the Kalman filter; Kailath, Sayed and Hassibi, Linear
    Estimation, 2000, section 12.3).

    Args:
        root: R before the first epoch (models, n, n).
        F: Transition to each epoch (K, models, n, n).
        noise_root: A root of Q (K, models, n, n).
        W: A root of the information at each epoch (K, m, n).
    """
    K, models, n, _ = F.shape
    m = W.shape[1]
    roots = np.empty((K, models, n, n))
    A = np.empty((m + 2 * n, m + n))
    R, t = np.empty((n, n)), np.empty(m + n)
    for model in range(models):
        for i in range(n):
            for j in range(n):
                R[i, j] = root[model, i, j]
        for k in range(K):
            for i in range(m):
                for j in range(m + n):
                    A[i, j] = 1.0 if i == j else 0.0
            for i in range(n):
                for j in range(n):
                    A[m + i, m + j] = _dot(R[i], F[k, model, j])
                    A[m + n + i, m + j] = noise_root[k, model, i, j]
            for i in range(m, m + 2 * n):
                for j in range(m):
                    A[i, j] = _dot(A[i, m:], W[k, j])
            _triangularise(A, m, t)
            for i in range(n):
                for j in range(n):
                    R[i, j] = roots[k, model, i, j] = A[m + i, m + j] if j >= i else 0.0
    return roots


@kernel(given(2), given(3))
def information_roots(root: Array, rows: Array) -> Array:
    """Return the upper-triangular roots (K, n, n) of root^T root + the sum of rows^T rows up to each epoch.

    Args:
        root: Upper triangular (n, n).
        rows: (K, m, n).
    """
    K, m, n = rows.shape
    roots = np.empty((K, n, n))
    A, t = np.empty((n + m, n)), np.empty(n)
    for i in range(n):
        for j in range(n):
            A[i, j] = root[i, j]
    for k in range(K):
        for i in range(m):
            for j in range(n):
                A[n + i, j] = rows[k, i, j]
        _triangularise(A, n, t)
        for i in range(n):
            for j in range(n):
                roots[k, i, j] = A[i, j]
    return roots


@inner
def _dot(x: Array, y: Array) -> float:
    """Return x^T y over the length of x."""
    total = 0.0
    for i in range(len(y)):
        total += x[i] * y[i]
    return total


@inner
def _triangularise(A: Array, head: int, t: Array) -> None:
    """Replace A (p, q), p >= q, whose first rows, up to `head`, are triangular, by U A, upper triangular, U orthogonal.

    Column by column with a reflection I - beta v v^T (Golub and Van Loan, Matrix Computations, 4th ed., section 5.2),
    v being zero between the diagonal and the row `head`; t (q,) is scratch.
    """
    p, q = A.shape
    for i in range(q):
        below = max(i + 1, head)
        norm = A[i, i] * A[i, i]
        for j in range(below, p):
            norm += A[j, i] * A[j, i]
        norm = math.sqrt(norm)
        # The image of the column is -sign norm, so that nothing cancels in the head of v.
        image = norm if A[i, i] < 0 else -norm
        v = A[i, i] - image
        beta = 1 / (norm * abs(v)) if norm != 0 else 0.0
        for k in range(i + 1, q):
            t[k] = v * A[i, k]
        for j in range(below, p):
            for k in range(i + 1, q):
                t[k] += A[j, i] * A[j, k]
        for k in range(i + 1, q):
            t[k] *= beta
            A[i, k] -= v * t[k]
        for j in range(below, p):
            for k in range(i + 1, q):
                A[j, k] -= A[j, i] * t[k]
        A[i, i] = image
        for j in range(below, p):
            A[j, i] = 0.0


@short_for(_triangularise)
def _triangularise_at_once(A: Array, head: int, t: Array) -> None:
    q = A.shape[1]
    A[:q], A[q:] = np.linalg.qr(A, mode="r"), 0.0
