"""Linear algebra over a stack of small matrices, one per run.

Every function treats a run by itself with the same sequence of roundings, so its bits do not depend on which
other runs share the stack. A matrix that is not positive definite gives NaN in its own run, never an exception:
one diverged filter must not end the others.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array

LOG_TWO_PI = float(np.log(2 * np.pi))
Kind = np.dtype[np.float64]
"""The type of an array's numbers; as arrays are annotated, of whichever precision they are."""
SINGLE: Kind = np.dtype(np.float32)  # type: ignore[assignment]
DOUBLE: Kind = np.dtype(np.float64)


def kernel_for(A: Array, theme: Any, name: str) -> Any:
    """Return the kernel of a theme that computes as A does: for float32 the one whose name ends in `_single`."""
    return getattr(theme, f"{name}_single" if A.dtype == SINGLE else name)


def by_run(A: Array, kind: Kind = DOUBLE) -> Array:
    """Return matrices (runs, p, q), or one (p, q) that all runs share as (1, p, q), in C order for a kernel."""
    return np.ascontiguousarray(A if A.ndim == 3 else A[None], dtype=kind)


def in_rows(x: Array) -> Array:
    """Return vectors (..., n) as (points, n), in C order for a kernel."""
    return np.ascontiguousarray(x if x.ndim == 2 else x.reshape(-1, x.shape[-1]), dtype=np.float64)


def matrices(A: Array) -> Array:
    """Return matrices (..., p, q) as (points, p, q), one (p, q) as (1, p, q), in C order for a kernel."""
    return np.ascontiguousarray(A if A.ndim == 3 else A.reshape(-1, *A.shape[-2:]), dtype=np.float64)


def images(A: Array, x: Array) -> Array:
    """Return A x, (..., m), of vectors x (..., n) and one matrix A (m, n) in C order."""
    return kernels.maps.linear(A, in_rows(x)).reshape(*x.shape[:-1], len(A))


def runs_last(A: Array) -> Array:
    """Return a contiguous copy (..., runs) of A (runs, ...): elementwise work on its entries is then fast."""
    return A.transpose(*range(1, A.ndim), 0).copy()


def factor(A: Array) -> Array:
    """Return the Cholesky factor of A, runs last (n, n, runs); NaN where A is not positive definite.

    Column by column, Golub and Van Loan, Matrix Computations, 4th ed., section 4.2. In NumPy, for what is given is
    checked before anything is compiled.
    """
    L = np.zeros_like(A)
    left = A.copy()
    n = len(A)
    with np.errstate(invalid="ignore", divide="ignore"):
        for k in range(n):
            L[k, k] = np.sqrt(left[k, k])
            if k + 1 < n:
                L[k + 1 :, k] = left[k + 1 :, k] / L[k, k]
            for i in range(k + 1, n):
                left[i, k + 1 : i + 1] -= L[i, k] * L[k + 1 : i + 1, k]
    return L


def cholesky(A: Array) -> Array:
    """Return lower-triangular L with L L^T = A, (..., n, n); NaN where A is not positive definite."""
    factor = kernel_for(A, kernels.roots, "cholesky")
    root: Array = factor(np.ascontiguousarray(A).reshape(-1, *A.shape[-2:]))[0].reshape(A.shape)
    return root


class CholeskyFactor:
    """What the Cholesky factor L of one small matrix per run does to others: gain, NIS and likelihood share it.

    Args:
        S: Symmetric matrices (runs, m, m).
    """

    def __init__(self, S: Array) -> None:
        self._S = np.ascontiguousarray(S)

    def whiten(self, residual: Array) -> Array:
        """Return L^-1 r for r (runs, m)."""
        return self.whiten_rows(residual[:, :, None])[:, :, 0]

    def whiten_rows(self, B: Array) -> Array:
        """Return L^-1 B for B (runs, m, n)."""
        white: Array = kernel_for(self._S, kernels.roots, "whiten")(self._S, np.ascontiguousarray(B))[0]
        return white

    def solve(self, B: Array) -> Array:
        """Return S^-1 B for B (runs, m, n)."""
        solution: Array = kernel_for(self._S, kernels.roots, "solve")(self._S, np.ascontiguousarray(B))[0]
        return solution

    def log_determinant(self) -> Array:
        """Return log det S, (runs,)."""
        return log_determinant(cholesky(self._S))


def whiten(L: Array, residual: Array) -> Array:
    """Return L^-1 r for vectors r (runs, ..., m) and L (m, m) or (runs, m, m)."""
    if L.ndim == 3:
        L = L.reshape(len(L), *[1] * (residual.ndim - 2), *L.shape[1:])
    white = np.empty(residual.shape)
    for i in range(L.shape[-1]):
        component = residual[..., i]
        for j in range(i):
            component = component - L[..., i, j] * white[..., j]
        white[..., i] = component / L[..., i, i]
    return white


def log_determinant(L: Array) -> Array:
    """Return log det(L L^T) of the factor L (..., n, n)."""
    total: Array = 2 * np.log(np.einsum("...ii->...i", L)).sum(axis=-1)
    return total


def transpose(A: Array) -> Array:
    """Return the transpose of each matrix, as a view."""
    return A.swapaxes(-1, -2)


def symmetric(A: Array) -> Array:
    """Return the symmetric part of each matrix."""
    return (A + transpose(A)) / 2


def log_density(residual: Array, covariance: Array) -> Array:
    """Return log N(r; 0, R) of residuals r (runs, ..., m), R (m, m) or (runs, m, m): (runs, ...)."""
    L = cholesky(covariance)
    white = whiten(L, residual)
    constant = residual.shape[-1] * LOG_TWO_PI + log_determinant(L)
    if L.ndim == 3:
        constant = constant.reshape(len(L), *[1] * (residual.ndim - 2))
    return -0.5 * (np.square(white).sum(axis=-1) + constant)


def mixture_log_density(residual: Array, weights: Array, covariances: Array, shared: bool) -> Array:
    """Return the log density of residuals (runs, ..., m) under a zero-mean Gaussian mixture.

    Args:
        residual: (runs, ..., m).
        weights: (k,).
        covariances: (k, m, m) or (runs, k, m, m).
        shared: One switch for all channels; else each channel switches alone (diagonal covariances).
    """
    log_weights = np.log(weights)
    if shared:
        terms = [
            log_weight + log_density(residual, covariances[..., k, :, :]) for k, log_weight in enumerate(log_weights)
        ]
        return np.logaddexp.reduce(terms, axis=0)
    total = np.zeros(residual.shape[:-1])
    for i in range(residual.shape[-1]):
        channel = residual[..., i : i + 1]
        terms = [
            log_weight + log_density(channel, covariances[..., k, i : i + 1, i : i + 1])
            for k, log_weight in enumerate(log_weights)
        ]
        total = total + np.logaddexp.reduce(terms, axis=0)
    return total
