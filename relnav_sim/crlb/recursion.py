"""Posterior Cramér-Rao bound: the least covariance that any filter of a given model can reach.

Tichavský, Muravchik and Nehorai, IEEE Trans. Signal Processing 46(5), 1998, eq. 21. With additive Gaussian process
noise their recursion reads J_k = (Q + F J_{k-1}^-1 F^T)^-1 + M_k, with M_k = E[H^T I H] the information that the
readings of epoch k carry, I the Fisher information of their noise. It is carried here as an upper triangular root of
P = J^-1, which stays positive semidefinite whatever the number of epochs and allows Q = 0: the bound of a perfect
model, for which the recursion is the classical Cramér-Rao bound on a deterministic trajectory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

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
        return symmetric(self._root.swapaxes(-1, -2) @ self._root)

    def advance(self, transition: Array, noise_root: Array, information_root: Array) -> None:
        """Go to the next epoch.

        P's root R (R^T R = P), moved by F and joined by the noise's, is the root of Q + F P F^T with more rows. One
        orthogonal triangularisation then takes the information W^T W in: [[I, 0], [R W^T, R]] = U [[., .], [0, R+]].

        Args:
            transition: F, (models, n, n) or (n, n).
            noise_root: A root of Q, Q = root^T root, (models, n, n) or (n, n).
            information_root: W with M = W^T W, (models, m, n) or (m, n).
        """
        moved = self._root @ transition.swapaxes(-1, -2)
        n, m = moved.shape[-1], information_root.shape[-2]
        array = np.zeros((*moved.shape[:-2], m + 2 * n, m + n))
        array[..., :m, :m] = np.eye(m)
        array[..., m : m + n, m:] = moved
        array[..., m + n :, m:] = noise_root
        array[..., m:, :m] = array[..., m:, m:] @ information_root.swapaxes(-1, -2)
        self._root = np.asarray(np.linalg.qr(array, mode="r"))[..., m:, m:]


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
    recursion = BoundRecursion(covariance)
    bounds = np.empty(M.shape)
    for k, (transition, noise, information) in enumerate(zip(F, matrix_root(Q), matrix_root(M), strict=True)):
        recursion.advance(transition, noise, information)
        bounds[k] = recursion.covariance
    return bounds
