"""What each source leaves in a filter's error, from one epoch to the next."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, kernel


@kernel(given(3), given(3), given(1), given(1), given(3))
def variances(M: Array, g: Array, phi: Array, v: Array, P0: Array) -> Array:
    """Return the variances of the states that S sources leave, (S, T, n).

    The covariance of [e; s] in its blocks P = E[e e^T], c = E[e s] and v = E[s^2], with h = M phi c + v g / 2:
    P <- M P M^T + h g^T + g h^T, which holds both cross terms and v g g^T, and c <- phi M c + v g.

    Args:
        M: Transition of the error to each epoch, (T, n, n); that to the first is not looked at.
        g: What a source's number s does to the error at each epoch, (S, T, n).
        phi: How much of s is left after an epoch, (S,).
        v: Variance of s, (S,).
        P0: Covariance of the error at the first epoch, (S, n, n).
    """
    S, T, n = g.shape
    found = np.empty((S, T, n))
    P, MP, c, h = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(n)
    for s in range(S):
        for i in range(n):
            c[i] = v[s] * g[s, 0, i]
            for j in range(n):
                P[i, j] = P0[s, i, j]
            found[s, 0, i] = P[i, i]
        for k in range(1, T):
            for i in range(n):
                h[i] = 0.0
                for j in range(n):
                    h[i] += M[k, i, j] * c[j]
                    MP[i, j] = 0.0
                for a in range(n):
                    for j in range(n):
                        MP[i, j] += M[k, i, a] * P[a, j]
            for i in range(n):
                c[i] = phi[s] * h[i] + v[s] * g[s, k, i]
                h[i] = phi[s] * h[i] + 0.5 * v[s] * g[s, k, i]
            for i in range(n):
                for j in range(i + 1):
                    total = h[i] * g[s, k, j] + g[s, k, i] * h[j]
                    for a in range(n):
                        total += MP[i, a] * M[k, j, a]
                    P[i, j] = P[j, i] = total
                found[s, k, i] = P[i, i]
    return found


@kernel(given(3), given(3), given(2))
def means(M: Array, b: Array, m0: Array) -> Array:
    """Return the errors of the states that S sources are, (S, T, n): m <- M m + b.

    Args:
        M: As in `variances`.
        b: What a source does to the error at each epoch, (S, T, n); that at the first is not looked at.
        m0: The errors at the first epoch, (S, n).
    """
    S, T, n = b.shape
    found = np.empty((S, T, n))
    for s in range(S):
        for i in range(n):
            found[s, 0, i] = m0[s, i]
        for k in range(1, T):
            for i in range(n):
                total = b[s, k, i]
                for j in range(n):
                    total += M[k, i, j] * found[s, k - 1, j]
                found[s, k, i] = total
    return found
