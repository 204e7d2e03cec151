"""The Kalman update from roots, for what the usual form can't: singular noise, known states, extremely wide priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.square_root import semidefinite_root, triangular_root
from relnav_sim.linalg import LOG_TWO_PI, symmetric, transpose

Array = NDArray[np.float64]

CONTRADICTION = "the measurement contradicts what the filter knows exactly (state and sensor without any variance)"
TOO_WIDE = (
    "the prior is so much wider than this precise measurement that a covariance can't hold both; take sr_ukf, which "
    "holds its root, or a tighter start"
)

# A measurement that repeats what is known exactly may differ by this share of its size: rounding, its own and that
# of the epochs that led to the prediction.
_REPEATED = 1e-9


@dataclass(frozen=True)
class Whitened:
    """A residual in units of its own root, L^-1 nu, where L may lack rank.

    Attributes:
        values: (runs, m); zero in the directions without variance.
        dead: The directions without variance (runs, m): the reading tells nothing new there.
        innovation: NIS and log-likelihood in the directions that have variance; a residual in the others that is more
            than rounding contradicts them, which has no probability.
    """

    values: Array
    dead: NDArray[np.bool_]
    innovation: Innovation


def whitened(L: Array, residual: Array, reading: Array) -> Whitened:
    """Return a residual whitened by a root of its covariance that may lack rank.

    Args:
        L: Lower-triangular roots (runs, m, m), diagonal >= 0.
        residual: (runs, m).
        reading: How large the compared readings and their parts are, (runs, m); decides what counts as rounding.
    """
    runs, m = residual.shape
    # A pivot within rounding of zero, measured by the row it was left of and by what the row was computed from.
    rounding = 16 * m * np.finfo(float).eps * (np.sqrt(np.einsum("bij,bij->bi", L, L)) + reading)
    values, dead = np.zeros((runs, m)), np.zeros((runs, m), dtype=bool)
    log_determinant, contradicts = np.zeros(runs), np.zeros(runs, dtype=bool)
    for i in range(m):
        left = residual[:, i] - np.einsum("bj,bj->b", L[:, i, :i], values[:, :i])
        pivot = L[:, i, i]
        dead[:, i] = pivot <= rounding[:, i]
        live = np.where(dead[:, i], 1.0, pivot)
        values[:, i] = np.where(dead[:, i], 0.0, left / live)
        log_determinant += np.where(dead[:, i], 0.0, 2 * np.log(live) + LOG_TWO_PI)
        most = _REPEATED * (reading[:, i] + np.abs(residual).max(axis=1)) + rounding[:, i]
        contradicts |= dead[:, i] & (np.abs(left) > most)
    nis = np.einsum("bi,bi->b", values, values)
    log_likelihood = -0.5 * (nis + log_determinant)
    innovation = Innovation(
        np.where(contradicts, np.inf, nis),
        np.where(contradicts, -np.inf, log_likelihood),
        failed=dict.fromkeys(np.flatnonzero(contradicts).tolist(), CONTRADICTION),
    )
    return Whitened(values, dead, innovation)


@dataclass(frozen=True)
class RootUpdate:
    """An update in terms of roots.

    Attributes:
        gain: K S^(1/2), (runs, n, m): what one unit of the whitened residual moves.
        root: P+^(1/2), (runs, n, n or more).
        residual: The whitened residual.
    """

    gain: Array
    root: Array
    residual: Whitened


def root_update(X: Array, Y: Array, noise_root: Array, nu: Array, reading: Array) -> RootUpdate:
    """Return the update of a prediction given as deviations, by one QR.

    The triangular form of [[Y, R^(1/2)], [X, 0]] is [[S^(1/2), 0], [K S^(1/2), P+^(1/2)]] (Kaminski, Bryson and
    Schmidt, IEEE Trans. Automatic Control 16(6), 1971). Neither S nor P is formed, so that a prior may be wider than
    the noise by all the digits of a number, and singular noise or a singular prior does no harm.

    Args:
        X: Deviations of the state, X X^T = P, (runs, n, q), q >= n.
        Y: The same of the reading, Y X^T = H P, (runs, m, q).
        noise_root: R^(1/2), R positive semidefinite, (runs, m, m).
        nu: Residual (runs, m).
        reading: As in `whitened`.
    """
    (runs, n, _), m = X.shape, nu.shape[1]
    top = np.concatenate([Y, noise_root], axis=2)
    array = triangular_root(np.concatenate([top, np.concatenate([X, np.zeros((runs, n, m))], axis=2)], axis=1))
    residual = whitened(array[:, :m, :m], nu, reading)
    gain, root = array[:, m:, :m], array[:, m:, m:]
    if residual.dead.any():
        # What belongs to a direction that the reading does not tell of stays in the covariance.
        root = np.concatenate([root, gain * residual.dead[:, None]], axis=2)
        gain = gain * ~residual.dead[:, None]
    return RootUpdate(gain, root, residual)


def square_root_update(
    belief: Gaussian, Y: Array, X: Array, R: Array, nu: Array, reading: Array
) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update by `root_update`; a variance that is nothing but its rounding becomes zero.

    Args:
        belief: The prediction.
        Y: As in `root_update`.
        X: As in `root_update`.
        R: Noise covariance, positive semidefinite, (runs, m, m).
        nu: Residual (runs, m).
        reading: As in `whitened`.
    """
    update = root_update(X, Y, semidefinite_root(R), nu, reading)
    P = symmetric(update.root @ transpose(update.root))
    before = np.einsum("bii->bi", belief.covariance)
    rounding = np.square(16 * sum(Y.shape[1:]) * np.finfo(float).eps) * before
    kept = np.einsum("bii->bi", P) > rounding
    P = P * (kept[:, :, None] & kept[:, None, :])
    mean = belief.mean + np.einsum("bnm,bm->bn", update.gain, update.residual.values)
    return Gaussian(mean, P), update.residual.innovation


def unless_too_wide(innovation: Innovation, P: Array, H: Array, R: Array) -> Innovation:
    """Return the innovation with the runs failed whose covariance can't hold how precise the measurement was.

    Where H mixes states, H P H^T is a small difference of large numbers, and digits below theirs are lost whatever
    the arithmetic that found them. After the update it must not exceed R by more than a hundredth.
    """
    error = 2 * np.finfo(float).eps * np.einsum("bij,bjk,bik->bi", np.abs(H), np.abs(P), np.abs(H))
    noise = np.einsum("bii->bi", R)
    lost = ((error > 0.01 * noise) & (noise > 0)).any(axis=1)
    return replace(innovation, failed={**dict.fromkeys(np.flatnonzero(lost).tolist(), TOO_WIDE), **innovation.failed})
