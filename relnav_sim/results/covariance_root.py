"""Covariances as they are stored: the lower triangle of the Cholesky factor, row by row, in single precision.

The factor and not the covariance itself: what is rounded stays a covariance, positive definite, and loses half as many
digits where states are strongly correlated.
"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array

STATES = 6


def covariance_roots(covariance: Array) -> Array:
    """Return the factors of covariances (..., 6, 6), (..., 21); NaN in those that are not positive definite."""
    flat = np.ascontiguousarray(covariance).reshape(-1, STATES, STATES)
    roots = kernels.statistics.covariance_roots(flat)
    return roots.reshape(*covariance.shape[:-2], roots.shape[-1])


def covariances(roots: Array) -> Array:
    """Return the covariances P = L L^T (..., 6, 6) of stored factors (..., 21); NaN where the factor is NaN."""
    L = np.zeros((*roots.shape[:-1], STATES, STATES))
    L[..., *np.tril_indices(STATES)] = roots
    return L @ L.swapaxes(-1, -2)
