"""The Kalman update from roots, for what the usual form can't: singular noise, known states, extremely wide priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.square_root import not_definite, semidefinite_root, triangular_root
from relnav_sim.linalg import LOG_TWO_PI, log_determinant, symmetric, transpose

CONTRADICTION = "the measurement contradicts what the filter knows exactly (state and sensor without any variance)"
TOO_WIDE = (
    "the prior is so much wider than this precise measurement that a covariance can't hold both; take sr_ukf, which "
    "holds its root, or a tighter start"
)

_EPS = float(np.finfo(float).eps)
# A measurement that repeats what is known exactly may differ by this share of its size: rounding, its own and that
# of the epochs that led to the prediction.
REPEATED = 1e-9


@dataclass(frozen=True)
class RootUpdate:
    """An update in terms of roots.

    Attributes:
        gain: K S^(1/2), (runs, n, m): what one unit of the whitened residual moves.
        root: P+^(1/2), (runs, n, n).
        innovation_root: S^(1/2), lower triangular, (runs, m, m); the identity for channels that tell nothing new.
        white: The whitened residual (runs, m), zero in these channels.
        innovation: NIS and log-likelihood of the others. A residual in a channel that tells nothing new, beyond
            rounding, contradicts what is known, which has no probability.
    """

    gain: Array
    root: Array
    innovation_root: Array
    white: Array
    innovation: Innovation


def root_update(X: Array, Y: Array, noise_root: Array, nu: Array, reading: Array) -> RootUpdate:
    """Return the update of a prediction given as deviations, by one QR.

    The triangular form of [[Y, R^(1/2)], [X, 0]] is [[S^(1/2), 0], [K S^(1/2), P+^(1/2)]] (Kaminski, Bryson and
    Schmidt, IEEE Trans. Automatic Control 16(6), 1971). Neither S nor P is formed, so that a prior may be wider than
    the noise by all the digits of a number, and singular noise or a singular prior does no harm: a channel without
    variance of its own, given those before it, is left out.

    Args:
        X: Deviations of the state, X X^T = P, (runs, n, q), q >= n.
        Y: The same of the measurement, Y X^T = H P, (runs, m, q).
        noise_root: R^(1/2), R positive semidefinite, (runs, m, m), or (1, m, m) for all runs.
        nu: Residual (runs, m).
        reading: How large the compared measurements and their parts are, (runs, m); decides what counts as rounding.
    """
    X, Y, N, nu, reading = map(np.ascontiguousarray, (X, Y, noise_root, nu, reading))
    gain, root, L, white, nis, log_likelihood, dead, any_dead = kernels.roots.update(X, Y, N, nu, reading)
    if not any_dead:
        return RootUpdate(gain, root, L, white, Innovation(nis, log_likelihood))
    (_, n, _), m = X.shape, nu.shape[1]
    failed = {}
    for run in np.flatnonzero(dead).tolist():
        top, noise = np.concatenate([Y[run], N[run if len(N) > 1 else 0]], axis=1), np.zeros((n, N.shape[2]))
        rounding = rounding_of((_row_norms(top) + reading[run])[None])[0]
        most = REPEATED * (reading[run] + np.abs(nu[run]).max()) + rounding
        bottom = np.concatenate([X[run], noise], axis=1)
        kept, T, told, contradicts = _informative(top, bottom, nu[run], rounding, most)
        r = len(kept)
        L[run], gain[run], white[run] = np.eye(m), 0.0, 0.0
        L[run][np.ix_(kept, kept)], gain[run][:, kept], white[run, kept] = T[:r, :r], T[r:, :r], told
        # As in the kernel: what is left with nothing but the rounding of its deviations is known.
        left = _row_norms(T[r:, r:]) > 16 * (n + m) * _EPS * _row_norms(X[run])
        root[run] = T[r:, r:] * left[:, None]
        nis[run] = white[run] @ white[run]
        log_likelihood[run] = -0.5 * (nis[run] + log_determinant(L[run]) + LOG_TWO_PI * r)
        if contradicts:
            nis[run], log_likelihood[run], failed[run] = np.inf, -np.inf, CONTRADICTION
    return RootUpdate(gain, root, L, white, Innovation(nis, log_likelihood, failed=failed))


def rounding_of(size: Array) -> Array:
    """Return the standard deviation that rounding alone leaves to measurements made of numbers of a size (runs, m)."""
    return 16 * size.shape[1] * _EPS * size


def _informative(
    top: Array, bottom: Array, nu: Array, rounding: Array, most: Array
) -> tuple[list[int], Array, list[float], bool]:
    """Return which channels of one run tell something new, the triangular form and the whitened residual of these.

    The last value says whether another channel contradicts what is known.

    Args:
        top: [Y, R^(1/2)], (m, q).
        bottom: [X, 0], (n, q).
        nu: (m,).
        rounding: Of a pivot, (m,).
        most: Of a residual in a channel that is known, (m,).
    """
    kept, contradicts = list(range(len(nu))), False
    while True:
        T = triangular_root(np.concatenate([top[kept], bottom])[None])[0]
        white: list[float] = []
        for i, channel in enumerate(kept):
            left = nu[channel] - T[i, :i] @ np.array(white)
            if T[i, i] <= rounding[channel]:
                contradicts = contradicts or bool(abs(left) > most[channel])
                kept.remove(channel)
                break
            white.append(left / T[i, i])
        else:
            return kept, T, white, contradicts


def _row_norms(A: Array) -> Array:
    """Return the norms of the rows of A (p, q)."""
    return np.sqrt(np.einsum("ij,ij->i", A, A))


def degenerate_innovation(S: Array, residual: Array, reading: Array) -> Innovation:
    """Return NIS and log-likelihood of residuals (runs, m) in the range of their covariance S (runs, m, m)."""
    runs, m = residual.shape
    return root_update(
        np.zeros((runs, 0, m)), semidefinite_root(S), np.zeros((runs, m, 0)), residual, reading
    ).innovation


def square_root_update(
    belief: Gaussian, H: Array, X: Array, Y: Array, R: Array, nu: Array, reading: Array
) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update by `root_update`; runs in which the covariance can't hold its digits fail.

    Args:
        belief: The prediction.
        H: Jacobian (runs, m, n), for the sizes of what is rounded.
        X: As in `root_update`.
        Y: As in `root_update`.
        R: Noise covariance, positive semidefinite, (runs, m, m).
        nu: Residual (runs, m).
        reading: As in `root_update`.
    """
    update = root_update(X, Y, semidefinite_root(R), nu, reading)
    P = symmetric(update.root @ transpose(update.root))
    mean = belief.mean + np.einsum("bnm,bm->bn", update.gain, update.white)
    L = update.innovation_root
    K = transpose(np.asarray(np.linalg.solve(transpose(L), transpose(update.gain)), dtype=np.float64))
    drowned = drowned_variances(belief.covariance, H, K, P)
    exact = not_definite(R, len(nu))
    known = drowned & exact[:, None]
    P = np.where(known[:, :, None] | known[:, None, :], 0.0, P)
    lost = ~exact & (drowned.any(axis=1) | _drowned_sums(H, P, R))
    innovation = update.innovation
    failed = dict.fromkeys(np.flatnonzero(lost).tolist(), TOO_WIDE) | dict(innovation.failed)
    return Gaussian(mean, P), replace(innovation, failed=failed)


def drowned_variances(P: Array, H: Array, K: Array, updated: Array) -> Mask:
    """Return which variances (runs, n) an update leaves below the rounding of the covariance that it began with.

    The posterior is A P A^T + K R K^T, A = I - K H, and P is known to its rounding only. Noise-free measurements
    leave such variances where the state is known exactly; noise that is drowned in them can't be told any more.

    Args:
        P: Covariance before (runs, n, n).
        H: (runs, m, n).
        K: Gain (runs, n, m).
        updated: Covariance after.
    """
    before = np.abs(np.einsum("bii->bi", P))
    moved = np.einsum("bij,bj->bi", np.abs(np.eye(P.shape[1]) - K @ H), np.sqrt(before))
    return (np.einsum("bii->bi", updated) < 8 * _EPS * np.square(moved)) & (before > 0)


def _drowned_sums(H: Array, P: Array, R: Array) -> Mask:
    """Return the runs in which H P H^T, a small difference of large numbers, is not held to a hundredth of R."""
    error = 2 * _EPS * np.einsum("bij,bjk,bik->bi", np.abs(H), np.abs(P), np.abs(H))
    return np.asarray((error > 0.01 * np.einsum("bii->bi", R)).any(axis=1))
