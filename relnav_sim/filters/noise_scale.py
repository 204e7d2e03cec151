"""The scale of the measurement noise that explains innovations: one at a time, or a window of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.filters.belief import Gaussian
from relnav_sim.linalg import CholeskyFactor, transpose

# Newton's method on 1/f stops changing b in the 14th digit after 6 to 9 steps (measured, modes over ten decades).
_NEWTON_STEPS = 12


def modes(nu: Array, M: Array, R: Array) -> tuple[Array, Array]:
    """Return s and d, both (runs, m), with nu^T (M + b R)^-1 nu = sum s / (d + b) for every b.

    M and R are made diagonal together: with R = L L^T and L^-1 M L^-T = V diag(d) V^T, s = (V^T L^-1 nu)^2.

    Args:
        nu: Innovations (runs, m).
        M: Covariance of the predicted measurement, H P H^T, (runs, m, m).
        R: Covariance of the noise, (runs, m, m).
    """
    factor = CholeskyFactor(R)
    A = factor.whiten_rows(transpose(factor.whiten_rows(M)))
    # LAPACK's eigensolver does not take NaN: a run that has broken down keeps its NaN in s alone.
    broken = ~np.isfinite(A.sum(axis=(1, 2)))
    d, V = np.linalg.eigh(np.where(broken[:, None, None], 0.0, A))
    s = np.square(np.einsum("bij,bi->bj", V, factor.whiten(nu)))
    return s, np.maximum(d, 0.0)


def scale_for(s: Array, d: Array, target: float | Array, least: float, most: float) -> Array:
    """Return the b in [least, most] at which sum s / (d + b) over the last axis comes down to `target`, (runs,).

    f(b) = sum s / (d + b) falls with b; 1/f is concave and nearly straight, so Newton's method on it climbs to the
    solution from the left without overshooting, as in trust-region methods (More and Sorensen, SIAM J. Scientific
    and Statistical Computing 4(3), 1983). Where f is below the target at `least` already, that is the answer.
    """
    b, target = np.full(len(s), least, s.dtype), np.asarray(target, dtype=s.dtype)
    with np.errstate(invalid="ignore"):  # 0 / 0 where s = 0: below any target
        for _ in range(_NEWTON_STEPS):
            inverse = 1 / (d + b[:, None])
            f = (s * inverse).sum(axis=1)
            slope = (s * inverse**2).sum(axis=1)
            climb = np.where(f > target, f / slope * (f / target - 1), 0.0)
            b = np.minimum(b + climb, most)
    return b


@dataclass(frozen=True)
class WindowedBelief:
    """A Gaussian with its last W innovations, newest last.

    Args:
        mean: (runs, n).
        covariance: (runs, n, n).
        s: Squares of their modes, (runs, W, m); see `modes`.
        d: Eigenvalues of their modes, (runs, W, m).
        lagged: Product of each whitened innovation with the one before, (runs, W).
        power: Squared length of each whitened innovation, (runs, W).
        white: The newest whitened innovation of each channel, (runs, m).
        channels: How many channels each innovation had, (runs, W).
        count: How many innovations there were, (runs,).
        scale: The factor b on R in use, (runs,).
    """

    mean: Array
    covariance: Array
    s: Array
    d: Array
    lagged: Array
    power: Array
    white: Array
    channels: Array
    count: Array
    scale: Array


def empty_window(prior: Gaussian, window: int, m: int) -> WindowedBelief:
    """Return the belief before the first measurement, with R taken as it is."""
    runs = len(prior.mean)
    entries, numbers = np.zeros((runs, window, m)), np.zeros((runs, window))
    return WindowedBelief(
        prior.mean,
        prior.covariance,
        entries,
        entries,
        numbers,
        numbers,
        np.zeros((runs, m)),
        numbers,
        np.zeros(runs),
        np.ones(runs),
    )


def push(
    belief: WindowedBelief, nu: Array, M: Array, R: Array, present: Mask | None, least: float, most: float
) -> tuple[WindowedBelief, Array]:
    """Return the belief with one more innovation and the factor on R that brings the window's mean NIS to m.

    Absent channels have no innovation: they count neither in the mean nor in the correlation, in which a channel is
    compared with the last measurement that had it.

    The factor is left as it was until the window is full, and while the innovations are correlated: that tells of a
    wrong motion model or process noise, which a larger R would make worse (Mehra, IEEE Trans. Automatic Control
    15(2), 1970). Correlated means a lag-1 autocorrelation, all channels together, beyond 2 / sqrt(W).

    Returns:
        The belief, and 1.0 where the innovations count as white (runs,).
    """
    s, d = modes(nu, M, R)
    white = CholeskyFactor(M + belief.scale[:, None, None] * R).whiten(nu)
    belief = replace(
        belief,
        s=_appended(belief.s, s),
        d=_appended(belief.d, d),
        lagged=_appended(belief.lagged, (white * belief.white).sum(axis=1)),
        power=_appended(belief.power, np.square(white).sum(axis=1)),
        white=white if present is None else np.where(present, white, belief.white),
        channels=_appended(belief.channels, np.full(len(nu), nu.shape[1]) if present is None else present.sum(axis=1)),
        count=belief.count + 1,
    )
    runs, W, _ = belief.s.shape
    is_white = np.abs(belief.lagged.sum(axis=1)) < 2 / np.sqrt(W) * belief.power.sum(axis=1)
    wanted = scale_for(belief.s.reshape(runs, -1), belief.d.reshape(runs, -1), belief.channels.sum(axis=1), least, most)
    scale = np.where(is_white & (belief.count >= W), wanted, belief.scale)
    return replace(belief, scale=scale), is_white.astype(float)


def _appended(window: Array, newest: Array) -> Array:
    return np.concatenate([window[:, 1:], newest[:, None].astype(window.dtype, copy=False)], axis=1)
