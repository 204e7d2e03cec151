"""The two-step filter: what its search for the maximum of the posterior works out at every iterate.

Its y = [x; g(x)] is a Gaussian of (x, c), see `relnav_sim.filters.two_step`: c with covariance V, and x given c with
regression K and covariance P. Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, single
from relnav_sim.kernels.lanes import (
    LANES,
    add,
    add_image,
    back,
    copy,
    factor,
    forward,
    load,
    load_vectors,
    product,
    product_by_transpose,
    solve,
    store,
    store_symmetric,
    store_vectors,
)
from relnav_sim.kernels.roots import squares_of


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
    both, cost = np.empty((runs, n + m), d.dtype), np.empty(runs, d.dtype)
    g, k = np.empty((m, n, LANES), d.dtype), np.empty((n, m, LANES), d.dtype)
    w, u = np.empty((n, n, LANES), d.dtype), np.empty((m, m, LANES), d.dtype)
    tq, apart, total = np.empty((n + m, LANES), d.dtype), np.empty((n, LANES), d.dtype), np.empty(LANES, d.dtype)
    t, q = tq[:n], tq[n:]
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(G, first, used, g)
        load(K, first, used, k)
        load(W, first, used, w)
        load(U, first, used, u)
        for b in range(used):
            for i in range(n):
                apart[i, b] = x[first + b, i] - d[first + b, i]
                t[i, b] = -apart[i, b]
            for i in range(m):
                q[i, b] = -beyond[first + b, i]
        add_image(g, apart, used, q)
        _subtract_image(k, q, used, t)
        squares_of(w, t, u, q, used, total)
        store_vectors(tq, first, used, both)
        for b in range(used):
            cost[first + b] = total[b]
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
    steps, length = np.empty((runs, n), D.dtype), np.empty(runs, D.dtype)
    d, k = np.empty((m, n, LANES), D.dtype), np.empty((n, m, LANES), D.dtype)
    p, v = np.empty((n, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    T, E = np.empty((m, m, LANES), D.dtype), np.empty((m, n, LANES), D.dtype)
    EP, S = np.empty((m, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    w, u, L = np.empty((n, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype), np.zeros((m, m, LANES), D.dtype)
    tq, y = np.empty((n + m, LANES), D.dtype), np.empty((m, 1, LANES), D.dtype)
    move, along, total = np.empty((n, LANES), D.dtype), np.empty((m, LANES), D.dtype), np.empty(LANES, D.dtype)
    t, q, nu = tq[:n], tq[n:], y.reshape(m, LANES)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(D, first, used, d)
        load(K, first, used, k)
        load(P, first, used, p)
        load(V, first, used, v)
        load(W, first, used, w)
        load(U, first, used, u)
        load_vectors(both, first, used, tq)
        _linearise(d, k, p, v, used, T, E, EP, S)
        for b in range(used):
            for i in range(m):
                nu[i, b], along[i, b] = -q[i, b], 0.0
            for j in range(n):
                move[j, b] = -t[j, b]
        add_image(E, t, used, nu)
        factor(S, used, L)
        forward(L, used, y)
        back(L, used, y)
        for i in range(m):
            for j in range(n):
                for b in range(used):
                    move[j, b] += EP[i, j, b] * nu[i, b]
        add_image(E, move, used, along)
        squares_of(w, move, u, along, used, total)
        add_image(k, along, used, move)
        store_vectors(move, first, used, steps)
        for b in range(used):
            length[first + b] = total[b]
    return steps, length


@kernel(given(3), given(3), given(3), given(3))
def linearise(D: Array, K: Array, P: Array, V: Array) -> tuple[Array, Array, Array]:
    """Return E = (I - D K)^-1 D and E P, (runs, m, n), and S = E P E^T + V, (runs, m, m); shapes as in `step`."""
    runs, m, n = D.shape
    all_E, all_EP = np.empty((runs, m, n), D.dtype), np.empty((runs, m, n), D.dtype)
    all_S = np.empty((runs, m, m), D.dtype)
    d, k = np.empty((m, n, LANES), D.dtype), np.empty((n, m, LANES), D.dtype)
    p, v = np.empty((n, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    T, E = np.empty((m, m, LANES), D.dtype), np.empty((m, n, LANES), D.dtype)
    EP, S = np.empty((m, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(D, first, used, d)
        load(K, first, used, k)
        load(P, first, used, p)
        load(V, first, used, v)
        _linearise(d, k, p, v, used, T, E, EP, S)
        store(E, first, used, all_E)
        store(EP, first, used, all_EP)
        store_symmetric(S, first, used, all_S)
    return all_E, all_EP, all_S


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
    solution, scatter = np.empty((runs, m, n), D.dtype), np.empty((runs, m, m), D.dtype)
    d, k = np.empty((m, n, LANES), D.dtype), np.empty((n, m, LANES), D.dtype)
    x, s = np.empty((m, n, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    T, TS = np.empty((m, m, LANES), D.dtype), np.empty((m, m, LANES), D.dtype)
    TST = np.empty((m, m, LANES), D.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(D, first, used, d)
        load(K, first, used, k)
        load(B, first, used, x)
        load(S, first, used, s)
        _turn(d, k, used, T)
        product(T, s, used, TS)
        product_by_transpose(TS, T, used, TST)
        for i in range(m):
            for j in range(m):
                for b in range(used):
                    s[i, j, b] = T[j, i, b]
        solve(s, used, x)
        store(x, first, used, solution)
        store_symmetric(TST, first, used, scatter)
    return solution, scatter


@inner
def _linearise(D: Array, K: Array, P: Array, V: Array, used: int, T: Array, E: Array, EP: Array, S: Array) -> None:
    """Set E, E P and S of `linearise`; T (m, m) is room."""
    _turn(D, K, used, T)
    copy(D, used, E)
    solve(T, used, E)
    product(E, P, used, EP)
    product_by_transpose(EP, E, used, S)
    add(V, used, S)


@inner
def _turn(D: Array, K: Array, used: int, T: Array) -> None:
    """Set T to I - D K, (m, m)."""
    product(D, K, used, T)
    for i in range(len(T)):
        for j in range(len(T)):
            one = 1.0 if i == j else 0.0
            for b in range(used):
                T[i, j, b] = one - T[i, j, b]


@inner
def _subtract_image(A: Array, x: Array, used: int, y: Array) -> None:
    """Take A x, A (p, q), from y (p,)."""
    for i in range(len(A)):
        for j in range(len(x)):
            for b in range(used):
                y[i, b] -= A[i, j, b] * x[j, b]


@kernel_like(
    misfit,
    given(3, single),
    given(3, single),
    given(2, single),
    given(2, single),
    given(2, single),
    given(3, single),
    given(3, single),
)
def misfit_single(G: Array, K: Array, x: Array, d: Array, beyond: Array, W: Array, U: Array) -> tuple[Array, Array]:
    """Return the same as `misfit`."""
    return x, d


@kernel_like(
    step,
    given(3, single),
    given(3, single),
    given(3, single),
    given(3, single),
    given(2, single),
    given(3, single),
    given(3, single),
)
def step_single(D: Array, K: Array, P: Array, V: Array, both: Array, W: Array, U: Array) -> tuple[Array, Array]:
    """Return the same as `step`."""
    return both, both


@kernel_like(linearise, given(3, single), given(3, single), given(3, single), given(3, single))
def linearise_single(D: Array, K: Array, P: Array, V: Array) -> tuple[Array, Array, Array]:
    """Return the same as `linearise`."""
    return D, K, P


@kernel_like(turned, given(3, single), given(3, single), given(3, single), given(3, single))
def turned_single(D: Array, K: Array, B: Array, S: Array) -> tuple[Array, Array]:
    """Return the same as `turned`."""
    return B, S
