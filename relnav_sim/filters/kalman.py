"""The Gaussian update that the Kalman filters share, and the linear Kalman filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.special import chdtri

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states, keep_considered, where_runs
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.filters.square_root_update import degenerate_innovation, drowned_variances, square_root_update
from relnav_sim.linalg import (
    LOG_TWO_PI,
    back,
    diagonal_last,
    factor,
    forward,
    log_determinant_of,
    matrices_last,
    product,
    runs_first,
    runs_last,
    symmetric_last,
)
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import channel_count, present_channels, unit_where_absent
from relnav_sim.options import Options, Tunable
from relnav_sim.streams import RandomSource


class GaussianFilterOptions(Options):
    """Options of every filter with a Gaussian belief."""

    gate_probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Innovation gate: reject a measurement whose NIS exceeds the chi-square quantile of this "
        "probability (0.999, say); default: none, because a gate that is too tight locks a filter out",
    )


class GaussianFilter:
    """Prediction, gating and starting of a filter whose belief is a Gaussian; `correct` is the algorithm's own.

    Attributes:
        considers: Whether the filter can account for states without estimating them.
    """

    stochastic = False
    considers = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianFilterOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        probability = options.gate_probability
        self._considered = considered_states(dynamics)
        self._gate = None if probability is None else ChannelQuantile(measurement, probability)

    def start(self, prior: Gaussian, source: RandomSource) -> Gaussian:
        """Return the prior."""
        return prior

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        F = matrices_last(self.dynamics.transition(belief.mean, step))
        Q = matrices_last(self.dynamics.process_noise(belief.mean, step))
        FP = product(F, runs_last(belief.covariance))
        P = product(F, FP.swapaxes(0, 1)) + Q  # F (F P)^T, because P is symmetric
        return Gaussian(self.dynamics.propagate(belief.mean, step), runs_first(symmetric_last(P)))

    def update(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the corrected belief; runs outside the gate keep their prediction, `rejected` counts them."""
        corrected, innovation = self.correct(belief, z, step)
        corrected = self.keep_considered(belief, corrected)
        if self._gate is None:
            return corrected, innovation
        rejected = innovation.nis > self._gate.of_present()
        extras = {**innovation.extras, "rejected": rejected.astype(float)}
        # What a reading would have done to a run does not count where it is not taken.
        failed = {place: why for place, why in innovation.failed.items() if not rejected[place]}
        return where_runs(~rejected, corrected, belief), replace(innovation, extras=extras, failed=failed)

    def keep_considered(self, predicted: Gaussian, corrected: Gaussian) -> Gaussian:
        """Return the corrected belief with the considered states as predicted."""
        return keep_considered(predicted, corrected, self._considered)

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the belief after the measurement, and its innovation."""
        raise TypeError(f"{type(self).__name__} has no correct(belief, z, step)")


class ChannelQuantile:
    """The chi-square quantile of a normalised innovation, by the number of channels present.

    Args:
        measurement: The filter's.
        probability: Of a normalised innovation that is not larger.
    """

    def __init__(self, measurement: Measurement, probability: float) -> None:
        self._measurement = measurement
        degrees = np.arange(1, measurement.dimension + 1)
        # Without a channel there is nothing to exceed.
        self._by_count = np.concatenate([[np.inf], chdtri(degrees, 1 - probability)])

    def of_present(self) -> Array:
        """Return the quantile for the channels that are present now, () or (runs,)."""
        return np.asarray(self._by_count[channel_count(self._measurement)])


def joseph_update(belief: Gaussian, residual: Array, H: Array, R: Array) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update, exact however wide the prior, and where noise or prediction are singular.

    One Cholesky factor S = L L^T serves all: with W = L^-1 H P and w = L^-1 nu the mean moves by W^T w and the
    covariance becomes P - W^T W, symmetric to the bit where P is. That difference loses as many digits as the prior is
    wider than the noise, so runs where it is a million times as wide get Joseph's form instead (Bucy and Joseph,
    Filtering for Stochastic Processes, 1968), and the update from roots where even S has lost the noise or is singular.
    Each run decides for itself.

    Args:
        belief: The prediction, mean (runs, n) and covariance (runs, n, n).
        residual: z - h(m), angles wrapped, (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise, positive semidefinite, (runs, m, m) or (m, m).

    Returns:
        The posterior and the innovation. Where S is singular, NIS and log-likelihood are those of its range; a
        residual outside it fails the run, because no state explains it.
    """
    # Runs last from here on: every product is then a few elementwise passes over contiguous memory.
    P, H, R, nu = runs_last(belief.covariance), matrices_last(H), matrices_last(R), runs_last(residual)
    HP = product(H, P)
    S = product(HP, H.swapaxes(0, 1)) + R
    L = factor(S)
    white = forward(L, np.concatenate([HP, nu[:, None]], axis=1))
    W, w = white[:, :-1], white[:, -1]
    WT = W.swapaxes(0, 1)
    mean = belief.mean + product(WT, w[:, None])[:, 0].T
    covariance = P - product(WT, W)
    wide, lost = exceeds(S, R, WIDE), nearly_singular(S, L)
    if wide.any():
        KT = back(L, W)
        covariance = np.where(wide, _joseph(P, H, R, KT, HP), covariance)
        lost = lost | (wide & (exceeds(S, R, WIDEST) | _drowned(P, H, KT, covariance)))
    update = Gaussian(mean, runs_first(covariance)), innovation_last(L, w)
    if not lost.any():
        return update
    rows = np.flatnonzero(lost)
    prior, h = Gaussian(belief.mean[rows], belief.covariance[rows]), of_runs(H, rows)
    X = semidefinite_root(prior.covariance)
    exact = square_root_update(prior, h, X, h @ X, of_runs(R, rows), residual[rows], reading_size(prior, h))
    return replace_runs(rows, update, exact)


def reading_size(belief: Gaussian, H: Array) -> Array:
    """Return how large the numbers are that H m is a sum of, (runs, m): its rounding is a share of that."""
    size = np.abs(belief.mean) + np.sqrt(np.abs(np.einsum("bii->bi", belief.covariance)))
    return np.einsum("bij,bj->bi", np.abs(H), size)


def _drowned(P: Array, H: Array, KT: Array, covariance: Array) -> Mask:
    """Return the runs in which a variance is below the rounding of those before; arguments runs last."""
    h = np.broadcast_to(H, (*H.shape[:2], P.shape[2]))
    drowned = drowned_variances(runs_first(P), runs_first(h), runs_first(KT.swapaxes(0, 1)), runs_first(covariance))
    return np.asarray(drowned.any(axis=1))


def replace_runs(
    rows: Indices, update: tuple[Gaussian, Innovation], by: tuple[Gaussian, Innovation]
) -> tuple[Gaussian, Innovation]:
    """Return an update whose runs `rows` are those of another, given for these runs alone."""
    (posterior, innovation), (exact, told) = update, by
    for whole, part in (
        (posterior.mean, exact.mean),
        (posterior.covariance, exact.covariance),
        (innovation.nis, told.nis),
        (innovation.log_likelihood, told.log_likelihood),
    ):
        whole[rows] = part
    return posterior, replace(innovation, failed={int(rows[place]): why for place, why in told.failed.items()})


WIDE = 1e6
"""Ratio of S to R, on the diagonal, from which on the short form of the covariance is not trusted."""
WIDEST = 1e12
"""The same of Joseph's form; S itself keeps four digits of R then."""
_SINGULAR = 1e-12  # share of S that a pivot of its factor must keep, or S is as good as singular


def nearly_singular(S: Array, L: Array) -> Mask:
    """Return where S (m, m, runs), finite, is as good as singular: a pivot of its factor L is next to nothing."""
    pivots = diagonal_last(L)
    # Written so that a pivot that is not a number counts.
    sound = pivots * pivots > _SINGULAR * diagonal_last(S)
    if sound.all():
        return np.zeros(S.shape[-1], dtype=bool)
    # A run that has diverged stays as it is.
    return np.asarray(~sound.all(axis=0) & np.isfinite(S.sum(axis=(0, 1))))


def exceeds(S: Array, R: Array, ratio: float) -> Mask:
    """Return where S (m, m, runs) is so many times as wide as R (m, m, runs or 1) in any channel."""
    return np.asarray((diagonal_last(S) > ratio * diagonal_last(R)).any(axis=0))


def of_runs(A: Array, rows: Indices) -> Array:
    """Return the matrices (rows, p, q) of some runs from (p, q, runs or 1)."""
    return runs_first(np.broadcast_to(A[..., rows] if A.shape[-1] > 1 else A, (*A.shape[:2], len(rows))))


def _joseph(P: Array, H: Array, R: Array, KT: Array, HP: Array) -> Array:
    """Return (I - K H) P (I - K H)^T + K R K^T, runs last, multiplied out with M = (I - K H) P."""
    K = KT.swapaxes(0, 1)
    M = P - product(K, HP)
    return symmetric_last(M + product(product(K, R) - product(M, H.swapaxes(0, 1)), KT))


def innovation_of(S: Array, residual: Array, reading: Array) -> Innovation:
    """Return NIS and log-likelihood of a residual, in the range of its covariance where that is singular.

    Args:
        S: Its covariance (runs, m, m).
        residual: (runs, m).
        reading: How large the compared readings are, (runs, m); only decides what counts as rounding.
    """
    last = runs_last(S)
    L = factor(last)
    innovation = innovation_last(L, forward(L, runs_last(residual)))
    singular = nearly_singular(last, L)
    if not singular.any():
        return innovation
    rows = np.flatnonzero(singular)
    told = degenerate_innovation(S[rows], residual[rows], reading[rows])
    innovation.nis[rows], innovation.log_likelihood[rows] = told.nis, told.log_likelihood
    return innovation


def innovation_last(L: Array, white: Array) -> Innovation:
    """Return the same of L (m, m, runs) and the whitened residual L^-1 nu (m, runs), runs last."""
    nis = product(white[None], white[:, None])[0, 0]
    return Innovation(nis, -0.5 * (nis + len(white) * LOG_TWO_PI + log_determinant_of(L)))


def scaled_noise(measurement: Measurement, mean: Array, epoch: int, factor: float) -> Array:
    """Return R times a factor, (m, m) or (runs, m, m), that leaves the variances of absent channels at 1."""
    R, present = measurement.noise(mean, epoch) * factor, present_channels(measurement)
    return R if present is None else unit_where_absent(R, present)


class KalmanOptions(GaussianFilterOptions):
    """Options of the linear Kalman filter."""

    r_scale: Annotated[float, Tunable(0.1, 100, scales_noise=True)] = Field(
        default=1.0,
        gt=0,
        description="Factor on R; r_scale = 1/alpha gives exactly what the one-step alpha-divergence filter tends "
        "to with many samples on a linear measurement",
    )


@register_filter("kf", KalmanOptions, measurement="cartesian", overhead_us=170.0, linear_only=True)
class KalmanFilter(GaussianFilter):
    """Linear Kalman filter (Kalman 1960) on linear measurements: a radar's are converted to Cartesian coordinates.

    The baseline of every comparison: with linear dynamics and the converted measurement nothing is
    approximated but the noise. Use it when range times angle error is small against the range.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: KalmanOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._r_scale = options.r_scale

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the Kalman update with the measurement matrix at the prediction."""
        H = self.measurement.jacobian(belief.mean, step.epoch)
        R = scaled_noise(self.measurement, belief.mean, step.epoch, self._r_scale)
        residual = self.measurement.residual(z, self.measurement.predict(belief.mean, step.epoch))
        return joseph_update(belief, residual, H, R)
