"""Posterior Cramér-Rao bound: the least covariance that any filter of a given model can reach.

Tichavský, Muravchik and Nehorai, IEEE Trans. Signal Processing 46(5), 1998, eq. 21. With additive Gaussian process
noise their recursion reads J_k = (Q + F J_{k-1}^-1 F^T)^-1 + M_k, with M_k = E[H^T I H] the information that the
measurements of epoch k carry, I the Fisher information of their noise. It is carried here as an upper triangular root
of P = J^-1, which stays positive semidefinite whatever the number of epochs and allows Q = 0: the bound of a perfect
model, for which the recursion is the classical Cramér-Rao bound on a deterministic trajectory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.linalg import symmetric


class BoundRecursion:
    """The bound of some models at one epoch after another.

    Args:
        covariance: J^-1 at the start, (models, n, n) or (n, n), positive semidefinite.
    """

    def __init__(self, covariance: ArrayLike) -> None:
        self._root = matrix_root(covariance)

    @property
    def covariance(self) -> Array:
        """J^-1 now, (models, n, n) or (n, n)."""
        return _squared(self._root)

    def advance(self, transition: Array, noise_root: Array, information_root: Array) -> None:
        """Go to the next epoch.

        Args:
            transition: F, (models, n, n) or (n, n).
            noise_root: A root of Q, Q = root^T root, (models, n, n) or (n, n).
            information_root: W with M = W^T W, (m, n).
        """
        self.through(transition[None], noise_root[None], information_root[None])

    def through(self, transitions: Array, noise_roots: Array, information_roots: Array) -> Array:
        """Go on through some epochs, and return J^-1 after each, (K, models, n, n) or (K, n, n).

        Args:
            transitions: F to each epoch, (K, models, n, n) or (K, n, n).
            noise_roots: Roots of Q, (K, models, n, n) or (K, n, n).
            information_roots: W of each epoch, (K, m, n).
        """
        K, n = len(information_roots), self._root.shape[-1]
        F, Q = (np.ascontiguousarray(A).reshape(K, -1, n, n) for A in (transitions, noise_roots))
        root = np.ascontiguousarray(self._root).reshape(-1, n, n)
        roots = kernels.bound.covariance_roots(root, F, Q, np.ascontiguousarray(information_roots))
        roots = roots.reshape(K, *self._root.shape)
        self._root = roots[-1]
        return _squared(roots)


def _squared(root: Array) -> Array:
    return symmetric(root.swapaxes(-1, -2) @ root)


def matrix_root(A: ArrayLike) -> Array:
    """Return W (..., n, n) with W^T W = A for symmetric positive semidefinite matrices, singular ones too."""
    values, vectors = np.linalg.eigh(symmetric(np.asarray(A, dtype=float)))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[..., None] * vectors.swapaxes(-1, -2))


def posterior_cramer_rao(
    transitions: ArrayLike, process_noises: ArrayLike, informations: ArrayLike, covariance: ArrayLike
) -> Array:
    """Return the bound on the covariance of the estimation error after each epoch, (T, n, n).

    Its square roots bound the rms error of any filter that is unbiased over the ensemble: sqrt of the trace of the
    position block is the bound on the rms position error.

    Args:
        transitions: F of the step to each epoch, (T, n, n), or one (n, n) for all; E[F] over the ensemble of states
            where it depends on them.
        process_noises: Q of the same steps, (T, n, n) or (n, n); 0 for a perfect model.
        informations: E[H^T I H] at each epoch, (T, n, n); 0 where nothing is measured.
        covariance: Covariance of the error at the start, one step before the first epoch, (n, n).

    Raises:
        ValueError: The shapes do not fit.
    """
    M = np.asarray(informations, dtype=float)
    n = np.shape(covariance)[-1]
    if M.ndim != 3 or M.shape[1:] != (n, n) or np.shape(covariance) != (n, n):
        raise ValueError(f"informations have shape {M.shape}; they must be (T, n, n) with n = {n} of the covariance")
    try:
        F, Q = (np.broadcast_to(np.asarray(A, dtype=float), M.shape) for A in (transitions, process_noises))
    except ValueError:
        raise ValueError(
            f"transitions and process_noises must be (T, n, n) or (n, n) with T, n = {M.shape[:2]}"
        ) from None
    return BoundRecursion(covariance).through(F, matrix_root(Q), matrix_root(M))
