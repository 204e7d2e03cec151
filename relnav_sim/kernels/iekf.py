"""The iterated extended Kalman filter: the linearisation of a measurement about an iterate."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, kernel, kernel_like, single
from relnav_sim.kernels.lanes import (
    LANES,
    add,
    add_image,
    load,
    load_vectors,
    product,
    product_by_transpose,
    store,
    store_symmetric,
    store_vectors,
)


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
    all_HP, all_S, all_nu = (
        np.empty((runs, m, n), d.dtype),
        np.empty((runs, m, m), d.dtype),
        np.empty((runs, m), d.dtype),
    )
    h, p, hp = np.empty((m, n, LANES), d.dtype), np.empty((n, n, LANES), d.dtype), np.empty((m, n, LANES), d.dtype)
    S, r = np.empty((m, m, LANES), d.dtype), np.empty((m, m, LANES), d.dtype)
    x, nu = np.empty((n, LANES), d.dtype), np.empty((m, LANES), d.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(H, first, used, h)
        load(P, first, used, p)
        load(R, first, used, r)
        load_vectors(d, first, used, x)
        load_vectors(residual, first, used, nu)
        product(h, p, used, hp)
        product_by_transpose(hp, h, used, S)
        add(r, used, S)
        add_image(h, x, used, nu)
        store(hp, first, used, all_HP)
        store_symmetric(S, first, used, all_S)
        store_vectors(nu, first, used, all_nu)
    return all_HP, all_S, all_nu


@kernel_like(
    linearised_reading, given(3, single), given(3, single), given(3, single), given(2, single), given(2, single)
)
def linearised_reading_single(H: Array, P: Array, R: Array, d: Array, residual: Array) -> tuple[Array, Array, Array]:
    """Return the same as `linearised_reading`, in float32."""
    return H, P, d
