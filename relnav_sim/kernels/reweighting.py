"""Steps of a Kalman update whose noise is reweighted until it fits the residuals.

Kernels that end in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import given, inner, kernel, kernel_like, single
from relnav_sim.kernels.lanes import (
    LANES,
    factor,
    forward,
    forward_vectors,
    load,
    load_vectors,
    product,
    store,
    store_symmetric,
    store_vectors,
)
from relnav_sim.kernels.roots import mark_poor


@kernel(given(2), given(3), given(3))
def whitened(nu: Array, H: Array, R: Array) -> tuple[Array, Array, Array, Mask]:
    """Return L (runs, m, m) of R = L L^T, L^-1 nu (runs, m), L^-1 H (runs, m, n), and where R is singular (runs,).

    Singular within rounding: a pivot of L says so, or is not a number; the rest of such a run does not count.

    Args:
        nu: Residuals (runs, m).
        H: Jacobians (runs or 1, m, n).
        R: Measurement noise (runs or 1, m, m).
    """
    runs, m = nu.shape
    n = H.shape[2]
    root, white = np.empty((runs, m, m), nu.dtype), np.empty((runs, m), nu.dtype)
    rows, singular = np.empty((runs, m, n), nu.dtype), np.empty(runs, dtype=np.bool_)
    r, L = np.empty((m, m, LANES), nu.dtype), np.zeros((m, m, LANES), nu.dtype)
    w, h = np.empty((m, LANES), nu.dtype), np.empty((m, n, LANES), nu.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(R, first, used, r)
        load(H, first, used, h)
        load_vectors(nu, first, used, w)
        factor(r, used, L)
        forward(L, used, h)
        forward_vectors(L, used, w)
        store(L, first, used, root)
        store(h, first, used, rows)
        store_vectors(w, first, used, white)
        mark_poor(r, L, first, used, singular)
    return root, white, rows, singular


@kernel(given(2), given(3), given(2), given(3))
def residuals(white: Array, rows: Array, dx: Array, P: Array) -> tuple[Array, Array]:
    """Return e = w - W dx and the variances of W dx, the diagonal of W P W^T, (runs, m) both.

    Args:
        white: Whitened residuals w at the prediction, (runs, m).
        rows: Whitened Jacobians W (runs, m, n).
        dx: Estimates less the prediction (runs, n).
        P: Covariances of the estimates (runs, n, n).
    """
    runs, m, n = rows.shape
    e, spread = np.empty((runs, m), dx.dtype), np.empty((runs, m), dx.dtype)
    w, h, x = np.empty((m, LANES), dx.dtype), np.empty((m, n, LANES), dx.dtype), np.empty((n, LANES), dx.dtype)
    p, hp, s = np.empty((n, n, LANES), dx.dtype), np.empty((m, n, LANES), dx.dtype), np.empty((m, LANES), dx.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(white, first, used, w)
        load(rows, first, used, h)
        load_vectors(dx, first, used, x)
        load(P, first, used, p)
        take_residuals(h, x, p, used, hp, w, s)
        store_vectors(w, first, used, e)
        store_vectors(s, first, used, spread)
    return e, spread


@inner
def take_residuals(h: Array, x: Array, p: Array, used: int, hp: Array, w: Array, s: Array) -> None:
    """Do as `residuals` in lanes: take W dx from w (m,), and set s (m,) to its variances; hp (m, n) is room."""
    product(h, p, used, hp)
    for i in range(len(w)):
        for b in range(used):
            s[i, b] = 0.0
        for j in range(len(x)):
            for b in range(used):
                w[i, b] -= h[i, j, b] * x[j, b]
                s[i, b] += hp[i, j, b] * h[i, j, b]


@kernel(given(3), given(2))
def scaled(root: Array, weights: Array) -> Array:
    """Return L diag(1 / w) L^T (runs, m, m), symmetric to the bit, of roots L (runs, m, m) and weights w (runs, m)."""
    runs, m = weights.shape
    R, r = np.empty((runs, m, m), root.dtype), np.zeros((m, m, LANES), root.dtype)
    L, w = np.empty((m, m, LANES), root.dtype), np.empty((m, LANES), root.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(root, first, used, L)
        load_vectors(weights, first, used, w)
        scale(L, w, used, r)
        store_symmetric(r, first, used, R)
    return R


@inner
def scale(L: Array, w: Array, used: int, r: Array) -> None:
    """Do as `scaled` in lanes: set the lower triangle of r (m, m)."""
    m = len(w)
    for i in range(m):
        for j in range(i + 1):
            for b in range(used):
                r[i, j, b] = 0.0
            for k in range(m):
                for b in range(used):
                    r[i, j, b] += L[i, k, b] / w[k, b] * L[j, k, b]


@kernel_like(whitened, given(2, single), given(3, single), given(3, single))
def whitened_single(nu: Array, H: Array, R: Array) -> tuple[Array, Array, Array, Mask]:
    """Return the same as `whitened`."""
    return R, nu, H, nu[:, 0] > 0


@kernel_like(residuals, given(2, single), given(3, single), given(2, single), given(3, single))
def residuals_single(white: Array, rows: Array, dx: Array, P: Array) -> tuple[Array, Array]:
    """Return the same as `residuals`."""
    return white, white


@kernel_like(scaled, given(3, single), given(2, single))
def scaled_single(root: Array, weights: Array) -> Array:
    """Return the same as `scaled`."""
    return root
