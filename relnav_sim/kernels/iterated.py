"""What the filters that search the maximum of the posterior work out at every iterate, run by run.

The two-step filter's y = [x; g(x)] is a Gaussian of (x, c), see `relnav_sim.filters.two_step`: c with covariance V, and
x given c with regression K and covariance P.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel


@kernel(given(3), given(3), given(3), given(2), given(2))
def linearised_reading(H: Array, P: Array, R: Array, d: Array, residual: Array) -> tuple[Array, Array, Array]:
    """Return H P (runs, m, n), S = H P H^T + R (runs, m, m), and the residual + H d (runs, m) of the linearisation.

    Args:
        H: Jacobian at a deviation d from the prediction (runs, m, n).
        P: Covariance of the prediction (runs, n, n).
        R: Measurement noise (runs, m, m) or (1, m, m).
        d: (runs, n).
        residual: z - h there, (runs, m).
    """
    runs, m, n = H.shape
    HP, S, nu = np.empty((runs, m, n)), np.empty((runs, m, m)), np.empty((runs, m))
    for run in range(runs):
        _multiply(H[run], P[run], HP[run])
        _multiply_by_transpose(HP[run], H[run], S[run])
        for i in range(m):
            nu[run, i] = residual[run, i]
            for j in range(n):
                nu[run, i] += H[run, i, j] * d[run, j]
            for j in range(i + 1):
                S[run, i, j] += R[run if len(R) > 1 else 0, i, j]
                S[run, j, i] = S[run, i, j]
    return HP, S, nu


@kernel(given(3), given(3), given(2), given(2), given(2), given(3), given(3))
def misfit(G: Array, K: Array, x: Array, d: Array, beyond: Array, W: Array, U: Array) -> tuple[Array, Array]:
    """Return t and q of the two-step filter's fit (runs, n + m), and their squares |W t|^2 + |U q|^2.

    Args:
        G: Jacobian at the prediction (runs, m, n).
        K: (runs, n, m).
        x: Mean of y_x less the prediction (runs, n).
        d: Deviation of the iterate from the prediction (runs, n).
        beyond: y_g - g(iterate), (runs, m).
        W: W^T W = P^-1, (runs, n, n).
        U: U^T U = V^-1, (runs, m, m).
    """
    runs, m, n = G.shape
    both, cost = np.empty((runs, n + m)), np.empty(runs)
    for run in range(runs):
        t, q = both[run, :n], both[run, n:]
        for i in range(m):
            q[i] = -beyond[run, i]
            for j in range(n):
                q[i] += G[run, i, j] * (x[run, j] - d[run, j])
        for i in range(n):
            t[i] = d[run, i] - x[run, i]
            for j in range(m):
                t[i] -= K[run, i, j] * q[j]
        cost[run] = _square(W[run], t) + _square(U[run], q)
    return both, cost


@kernel(given(3), given(3), given(3), given(3), given(2), given(3), given(3))
def step(D: Array, K: Array, P: Array, V: Array, both: Array, W: Array, U: Array) -> tuple[Array, Array]:
    """Return the Gauss-Newton step of the two-step filter's fit (runs, n), and its squared length (runs,).

    It comes from the update of t by q = E t, E = (I - D K)^-1 D.

    Args:
        D: Change of the Jacobian from the prediction to the iterate (runs, m, n).
        K: (runs, n, m).
        P: (runs, n, n).
        V: (runs, m, m).
        both: t and q there (runs, n + m).
        W: W^T W = P^-1, (runs, n, n).
        U: U^T U = V^-1, (runs, m, m).
    """
    runs, m, n = D.shape
    steps, length = np.empty((runs, n)), np.empty(runs)
    T, E, EP, S = np.empty((m, m)), np.empty((m, n)), np.empty((m, n)), np.empty((m, m))
    w, move, along = np.empty(m), np.empty(n), np.empty(m)
    for run in range(runs):
        _linearise(D[run], K[run], P[run], V[run], T, E, EP, S)
        for i in range(m):
            w[i] = -both[run, n + i]
            for j in range(n):
                w[i] += E[i, j] * both[run, j]
        _solve_definite(S, w)
        for j in range(n):
            move[j] = -both[run, j]
            for i in range(m):
                move[j] += EP[i, j] * w[i]
        for i in range(m):
            along[i] = 0.0
            for j in range(n):
                along[i] += E[i, j] * move[j]
        for j in range(n):
            steps[run, j] = move[j]
            for i in range(m):
                steps[run, j] += K[run, j, i] * along[i]
        length[run] = _square(W[run], move) + _square(U[run], along)
    return steps, length


@kernel(given(3), given(3), given(3), given(3))
def linearise(D: Array, K: Array, P: Array, V: Array) -> tuple[Array, Array, Array]:
    """Return E = (I - D K)^-1 D and E P, (runs, m, n), and S = E P E^T + V, (runs, m, m); shapes as in `step`."""
    runs, m, n = D.shape
    E, EP, S, T = np.empty((runs, m, n)), np.empty((runs, m, n)), np.empty((runs, m, m)), np.empty((m, m))
    for run in range(runs):
        _linearise(D[run], K[run], P[run], V[run], T, E[run], EP[run], S[run])
    return E, EP, S


@inner
def _linearise(D: Array, K: Array, P: Array, V: Array, T: Array, E: Array, EP: Array, S: Array) -> None:
    _turn(D, K, T)
    _solve(T, D, E)
    _multiply(E, P, EP)
    _multiply_by_transpose(EP, E, S)
    for i in range(len(S)):
        for j in range(i + 1):
            S[i, j] += V[i, j]
            S[j, i] = S[i, j]


@kernel(given(3), given(3), given(3), given(3))
def turned(D: Array, K: Array, B: Array, S: Array) -> tuple[Array, Array]:
    """Return T^-T B, (runs, m, n), and T S T^T, (runs, m, m), with T = I - D K: c about another tangent is T c.

    Args:
        D: Change of the Jacobian from the one tangent to the other (runs, m, n).
        K: (runs, n, m).
        B: (runs, m, n).
        S: Symmetric (runs, m, m).
    """
    runs, m, n = D.shape
    solution, scatter = np.empty((runs, m, n)), np.empty((runs, m, m))
    T, transposed, TS = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    for run in range(runs):
        _turn(D[run], K[run], T)
        _multiply(T, S[run], TS)
        _multiply_by_transpose(TS, T, scatter[run])
        for i in range(m):
            for j in range(m):
                transposed[i, j] = T[j, i]
            for j in range(i):
                scatter[run, j, i] = scatter[run, i, j]
        _solve(transposed, B[run], solution[run])
    return solution, scatter


@inner
def _turn(D: Array, K: Array, T: Array) -> None:
    """Set T to I - D K, (m, m)."""
    for i in range(len(T)):
        for j in range(len(T)):
            T[i, j] = 1.0 if i == j else 0.0
            for k in range(len(K)):
                T[i, j] -= D[i, k] * K[k, j]


@inner
def _multiply(A: Array, B: Array, out: Array) -> None:
    """Set out to A B."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                out[i, j] += A[i, k] * B[k, j]


@inner
def _multiply_by_transpose(A: Array, B: Array, out: Array) -> None:
    """Set out to A B^T."""
    for i in range(len(A)):
        for j in range(len(B)):
            out[i, j] = 0.0
            for k in range(A.shape[1]):
                out[i, j] += A[i, k] * B[j, k]


@inner
def _square(W: Array, a: Array) -> float:
    """Return |W a|^2."""
    total = 0.0
    for i in range(len(W)):
        entry = 0.0
        for j in range(len(a)):
            entry += W[i, j] * a[j]
        total += entry * entry
    return total


@inner
def _solve_definite(A: Array, x: Array) -> None:
    """Replace x by A^-1 x, by Cholesky's factor of the lower triangle of A, which is overwritten."""
    n = len(A)
    for i in range(n):
        for j in range(i + 1):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] = math.sqrt(A[i, i]) if i == j else A[i, j] / A[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]


@inner
def _solve(A: Array, B: Array, X: Array) -> None:
    """Set X (m, n) to A^-1 B, by elimination with row exchanges; A is overwritten, X is NaN where it is singular."""
    m, n = B.shape
    for i in range(m):
        for j in range(n):
            X[i, j] = B[i, j]
    for k in range(m):
        pivot = k
        for i in range(k + 1, m):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        # Zero here, it makes all that follows NaN.
        inverse = 1 / A[pivot, k] if A[pivot, k] != 0 else math.nan
        for j in range(m):
            A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        for j in range(n):
            X[k, j], X[pivot, j] = X[pivot, j], X[k, j]
            X[k, j] *= inverse
        for j in range(k + 1, m):
            A[k, j] *= inverse
        for i in range(k + 1, m):
            for j in range(k + 1, m):
                A[i, j] -= A[i, k] * A[k, j]
            for j in range(n):
                X[i, j] -= A[i, k] * X[k, j]
    for k in range(m - 1, -1, -1):
        for j in range(n):
            for i in range(k + 1, m):
                X[k, j] -= A[k, i] * X[i, j]


@kernel(given(3), given(2), given(3), given(2))
def squares(W: Array, a: Array, U: Array, b: Array) -> Array:
    """Return |W a|^2 + |U b|^2, (runs,), for W (runs, n, n), a (runs, n), U (runs, m, m), b (runs, m)."""
    total = np.empty(len(a))
    for run in range(len(a)):
        total[run] = _square(W[run], a[run]) + _square(U[run], b[run])
    return total
