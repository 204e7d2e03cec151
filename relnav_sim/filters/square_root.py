"""Square roots of covariances, one matrix per run, that also stand matrices without full rank."""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.linalg import DOUBLE, SINGLE, by_run, kernel_for, transpose, whiten

# A correlation matrix's eigenvalue below minus this is an error, not rounding.
_NEGATIVE = 1e-6


def triangular_root(M: Array) -> Array:
    """Return the lower-triangular L (runs, p, p), diagonal >= 0, with L L^T = M M^T, M (runs, p, q), q >= p.

    M M^T, whose condition number is the square of M's, is never formed.
    """
    return kernels.roots.triangular(np.ascontiguousarray(M), np.empty((1, M.shape[1], 0)))


def semidefinite_root(P: Array) -> Array:
    """Return a lower-triangular L with L L^T = P, (runs, n, n), P positive semidefinite.

    Cholesky's factor where P has full rank. NaN where P has a negative eigenvalue beyond rounding.
    """
    L, poor, any_poor = kernels.roots.cholesky(np.ascontiguousarray(P))
    if any_poor:
        scale, values, vectors = _spectrum(P[poor])
        L[poor] = triangular_root(scale[:, :, None] * vectors * np.sqrt(values)[:, None, :])
    return L


class Whitener:
    """W with W^T W = P^-1 for one positive semidefinite matrix per run.

    Directions without variance get no part of a solution, so that a state known exactly does no harm.

    In float32 only a state without variance is such a direction, and a matrix that is indefinite to rounding gives NaN.

    Args:
        P: (runs, n, n). NaN results where it has a negative eigenvalue beyond rounding.

    Attributes:
        root: W, (runs, n, n).
        has_exact: Whether any run has a direction without variance.
        exact: Rows (runs, n, n) that take the components in these directions, zero rows otherwise.
    """

    def __init__(self, P: Array) -> None:
        self.exact, self.has_exact = np.zeros(P.shape), False
        if P.dtype == SINGLE:
            self.root = _whitening_in_single(P)
            return
        self.root, poor, any_poor = kernels.roots.whiten(np.ascontiguousarray(P), np.eye(P.shape[-1])[None])
        if any_poor:
            scale, values, vectors = _spectrum(P[poor])
            roots = np.sqrt(np.where(values == 0, np.inf, values))
            self.root[poor] = transpose(vectors) / (roots[:, :, None] * scale[:, None, :])
            self.exact[poor] = transpose(vectors) * (values == 0)[:, :, None] / scale[:, None, :]
            self.has_exact = bool((values == 0).any())

    def solve(self, B: Array) -> Array:
        """Return X (runs, n, p) with P X = B, columns of B (runs, n, p) in P's range."""
        return transpose(self.root) @ (self.root @ B)


def squares(P: Whitener, v: Array, R: Whitener, r: Array) -> Array:
    """Return v^T P^-1 v + r^T R^-1 r, (runs,), for v (runs, n) in P's range and r (runs, m) in R's."""
    kernel = kernel_for(v, kernels.roots, "squares")
    found: Array = kernel(P.root, np.ascontiguousarray(v), R.root, np.ascontiguousarray(r))
    return found


class NoiseRoot:
    """L with L L^T = R, and residuals in its units, for noise that may have exact channels.

    The Cholesky factor where R has full rank. Elsewhere L has columns of zeros: directions without noise whiten to
    zero, as if they fitted perfectly.

    Args:
        R: (runs, m, m).

    Attributes:
        root: L, (runs, m, m); lower triangular where R has full rank.
    """

    def __init__(self, R: Array) -> None:
        self.root, self._poor, self._any_poor = kernels.roots.cholesky(np.ascontiguousarray(R))
        if self._any_poor:
            scale, values, vectors = _spectrum(R[self._poor])
            self.root[self._poor] = scale[:, :, None] * vectors * np.sqrt(values)[:, None, :]
            roots = np.sqrt(np.where(values == 0, np.inf, values))
            self._inverse = transpose(vectors) / (roots[:, :, None] * scale[:, None, :])

    def whiten(self, v: Array) -> Array:
        """Return L^-1 v, (runs, m), for v (runs, m)."""
        white = whiten(self.root, v)
        if self._any_poor:
            white[self._poor] = np.einsum("bij,bj->bi", self._inverse, v[self._poor])
        return white

    def whiten_rows(self, H: Array) -> Array:
        """Return L^-1 H, (runs, m, n), for H (runs, m, n)."""
        white = transpose(whiten(self.root, np.ascontiguousarray(transpose(H))))
        if self._any_poor:
            white[self._poor] = self._inverse @ H[self._poor]
        return white

    def scaled(self, weights: Array) -> Array:
        """Return L diag(1 / w) L^T, (runs, m, m), for weights (runs, m)."""
        return (self.root / weights[:, None, :]) @ transpose(self.root)


def semidefinite_solve(A: Array, B: Array) -> Array:
    """Return A^-1 B (runs, m, p) for positive semidefinite A (runs, m, m), B in A's range where A is singular."""
    X: Array
    X, poor, any_poor = kernel_for(A, kernels.roots, "solve")(np.ascontiguousarray(A), np.ascontiguousarray(B))
    if any_poor and A.dtype == DOUBLE:
        X[poor] = Whitener(A[poor]).solve(B[poor])
    return X


NEEDS_NOISE = "the measurement noise is singular; this filter needs noise in every channel (kf, ekf, iekf, ukf do not)"


def not_definite(R: Array, runs: int) -> Mask:
    """Return in which runs (runs,) a covariance (m, m) or (runs, m, m) is singular within rounding, or none."""
    return np.broadcast_to(kernels.roots.cholesky(by_run(R))[1], (runs,))


def _whitening_in_single(P: Array) -> Array:
    """Return L^-1 (runs, n, n), P = L L^T, of a covariance of float32; NaN where a pivot is within its rounding."""
    n = P.shape[1]
    unit = np.eye(n, dtype=SINGLE)
    known = np.einsum("bii->bi", P) == 0
    C = np.ascontiguousarray(P + known[:, :, None] * unit)
    W = kernels.roots.whiten_single(C, unit[None])[0]
    diagonal, variances = np.einsum("bii->bi", W), np.einsum("bii->bi", C)
    sound = (np.finfo(SINGLE).eps * variances * np.square(diagonal) < 1).all(axis=1)
    W[~sound] = np.nan
    return W


def _spectrum(P: Array) -> tuple[Array, Array, Array]:
    """Return standard deviations (runs, n), eigenvalues (runs, n) and vectors (runs, n, n) of the correlations.

    Scaled to correlations, so that metres and metres per second round alike. Eigenvalues within rounding of zero are
    zero; a standard deviation of zero is returned as 1.
    """
    variances = np.einsum("bii->bi", P)
    with np.errstate(invalid="ignore"):
        scale = np.sqrt(np.where(variances == 0, 1.0, variances))
    C = P / (scale[:, :, None] * scale[:, None, :])
    # LAPACK refuses the whole stack for one matrix that is not finite.
    finite = np.isfinite(C).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(np.where(finite[:, None, None], C, np.eye(P.shape[-1])))
    values = np.where(finite[:, None], values, np.nan)
    # A negative eigenvalue shows how much rounding the matrix holds; whatever is as small is no variance either.
    rounding = np.maximum(8 * P.shape[-1] * np.finfo(float).eps, -4 * values[:, :1])
    values = np.where(rounding > 4 * _NEGATIVE, np.nan, np.where(values <= rounding, 0.0, values))
    return scale, values, vectors
