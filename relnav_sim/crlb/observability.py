"""Observability: of which direction of the state do measurements tell least, and how much, beyond what the start knew?

The information of the measurements without the prior, N = sum Phi_k^T H_k^T R^-1 H_k Phi_k about the state at the start
(the observability Gramian; Maybeck, Stochastic Models, Estimation, and Control 1, 1979, section 5.7), scaled by a root
of the prior covariance P = L L^T. In the eigenvectors of L^T N L, with eigenvalues mu, the posterior sigma is
1 / sqrt(1 + mu) times the prior one: 1 where nothing is learned. With relative motion that is linear and without a
manoeuvre, bearings alone leave exactly one such direction, the state itself (Woffinden and Geller, JGCD 32(5), 2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.crlb.recursion import matrix_root

STATE_WORDS = (
    "radial position",
    "along-track position",
    "normal position",
    "radial velocity",
    "along-track velocity",
    "normal velocity",
)
_ITSELF = 0.99
"""Cosine between a direction and the state from which they count as the same."""
_SHARE = 0.1
"""Share of the squared length of a direction from which a component is named."""


@dataclass(frozen=True)
class WeakestDirection:
    """What the measurements tell least about.

    Attributes:
        ratio: Posterior over prior sigma in the weakest direction of the leading states after each epoch, (T,).
        ratios: The same of all their directions at the end, the weakest first, (m,).
        course: The same after each epoch, (T, m).
        directions: The weakest direction after each epoch, as a change of the leading states at the start of one prior
            sigma in that direction, (T, m).
        direction: The weakest direction at the end, as a change of the state at the start, (n,): one prior sigma in
            that direction of the m leading states, and what goes with it of the others.
        sigma_ratio: Posterior over prior sigma of each state by itself at the end, (n,).
    """

    ratio: Array
    ratios: Array
    course: Array
    directions: Array
    direction: Array
    sigma_ratio: Array


def observability(
    transitions: ArrayLike, informations: ArrayLike, covariance: ArrayLike, leading: int | None = None
) -> WeakestDirection:
    """Return in which direction the measurements tell least about the state at the start, and how much.

    A linear test: it asks what small changes of the state along one trajectory do to the measurements. Two trajectories
    far apart with the same measurements, as the mirror images that range alone leaves of coplanar motion, are not seen.
    Process noise is not in it: what fades is not lost here.

    Args:
        transitions: F of the step to each epoch, (T, n, n), or one (n, n) for all. Of forced motion, as under a known
            manoeuvre, the homogeneous part.
        informations: H^T R^-1 H of the measurements of each epoch, along the trajectory that is flown, (T, n, n).
        covariance: Prior covariance at the start, one step before the first epoch, (n, n), positive definite.
        leading: How many states count; those behind them are nuisances, estimated but not asked about. Default: all.

    Raises:
        ValueError: The shapes do not fit.

    Examples:
        A target that drifts at constant velocity past a camera; its scale can't be told from bearings, and a range of
        1 m accuracy is enough:

        >>> import numpy as np
        >>> from relnav_sim.crlb.observability import observability
        >>> F = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
        >>> x, M, ranges = np.array([100.0, -50, 0, 1]), [], []
        >>> for _ in range(100):
        ...     x = F @ x
        ...     r = np.hypot(x[0], x[1])
        ...     bearing, distance = np.array([-x[1], x[0], 0, 0]) / r**2, np.array([x[0], x[1], 0, 0]) / r
        ...     M.append(np.outer(bearing, bearing) / 1e-3**2)
        ...     ranges.append(np.outer(distance, distance))
        >>> prior = np.diag([100.0, 100, 1, 1])
        >>> found = observability(F, np.array(M), prior)
        >>> found.ratios.round(3)[:2]
        array([1.   , 0.003])
        >>> (found.direction / found.direction[0]).round(6)
        array([ 1.  , -0.5 ,  0.  ,  0.01])
        >>> float(observability(F, np.array(M) + ranges, prior).ratio[-1].round(3))
        0.013
    """
    M, P = np.asarray(informations, dtype=float), np.asarray(covariance, dtype=float)
    n = P.shape[-1]
    m = n if leading is None else leading
    if M.ndim != 3 or M.shape[1:] != (n, n) or P.shape != (n, n):
        raise ValueError(f"informations have shape {M.shape}; they must be (T, n, n) with n = {n} of the covariance")
    if np.shape(transitions) not in ((n, n), M.shape):
        raise ValueError(f"transitions have shape {np.shape(transitions)}; they must be (T, n, n) or (n, n)")
    F = np.broadcast_to(np.asarray(transitions, dtype=float), M.shape)
    L = np.linalg.cholesky(P)
    # Rows W with W^T W = I + L^T N L; as a root, small eigenvalues are not lost beside large ones.
    moved = np.empty(M.shape)
    for k, step in enumerate(F):
        moved[k] = step @ (L if k == 0 else moved[k - 1])
    roots = kernels.bound.information_roots(np.eye(n), matrix_root(M) @ moved)
    _, s, rows = np.linalg.svd(roots)
    # The posterior covariance is L V s^-2 V^T L^T, and L[:m] is [L_m 0]: in units of the prior, the first m rows count.
    posterior = rows.swapaxes(1, 2) / s[:, None, :]
    sides, ratios, _ = np.linalg.svd(posterior[:, :m])
    last = L @ posterior[-1]
    u = L[:m, :m] @ sides[-1, :, 0]
    covariances = last @ last.T
    direction = covariances[:, :m] @ np.linalg.solve(covariances[:m, :m], u)
    direction[:m] = u
    return WeakestDirection(
        ratio=ratios[:, 0],
        ratios=ratios[-1],
        course=ratios,
        directions=(L[:m, :m] @ sides[:, :, 0, None])[..., 0],
        direction=direction,
        sigma_ratio=np.sqrt(np.diag(covariances) / np.diag(P)),
    )


def direction_in_words(
    direction: ArrayLike, covariance: ArrayLike, state: ArrayLike, augmented: Sequence[str] = ()
) -> str:
    """Return a direction of the state in words.

    Args:
        direction: A change of position and velocity, RTN, and of the augmented states, (n,).
        covariance: Prior covariance (n, n), in whose sigmas the parts are compared.
        state: The relative state at the start, (6,).
        augmented: Names of the augmented states.
    """
    return directions_in_words(np.asarray(direction, dtype=float)[None], covariance, state, augmented)[0]


def directions_in_words(
    directions: ArrayLike, covariance: ArrayLike, state: ArrayLike, augmented: Sequence[str] = ()
) -> list[str]:
    """Return each of several directions (T, n) in words; otherwise as `direction_in_words`."""
    u, P = np.asarray(directions, dtype=float), np.asarray(covariance, dtype=float)
    whitening = np.linalg.inv(np.linalg.cholesky(P[:6, :6]))
    white, own = u[:, :6] @ whitening.T, whitening @ np.asarray(state, dtype=float)
    lengths = np.linalg.norm(white, axis=1) * np.linalg.norm(own)
    itself = (lengths > 0) & (np.abs(white @ own) > _ITSELF * lengths)
    squares = np.square(u / np.sqrt(np.diag(P)))
    shares = squares / squares[:, :6].sum(axis=1, keepdims=True)
    orders = np.argsort(-shares, axis=1, kind="stable")
    return [_in_words(*each, (*STATE_WORDS, *augmented)) for each in zip(shares, orders, itself, strict=True)]


def _in_words(shares: Array, order: Indices, itself: bool, names: Sequence[str]) -> str:
    named = [names[i] for i in order if shares[i] >= _SHARE]
    parts = f"{', '.join(named[:-1])} and {named[-1]}" if len(named) > 1 else named[0]
    return f"the state itself, that is its scale and with it the range (mostly {parts})" if itself else parts
