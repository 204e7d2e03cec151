"""The Gaussian update that the Kalman filters share, and the linear Kalman filter."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import chdtri

from relnav_sim.filters.belief import Gaussian, Innovation, considered_states, keep_considered, where_runs
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import (
    LOG_TWO_PI,
    CholeskyFactor,
    back,
    factor,
    forward,
    log_determinant_of,
    matrices_last,
    product,
    runs_first,
    runs_last,
)
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.measurement import Measurement
from relnav_sim.options import Options, Tunable
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]


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
        self._gate = None if probability is None else float(chdtri(measurement.dimension, 1 - probability))

    def start(self, prior: Gaussian, source: RandomSource) -> Gaussian:
        """Return the prior."""
        return prior

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        F = matrices_last(self.dynamics.transition(belief.mean, step))
        Q = matrices_last(self.dynamics.process_noise(belief.mean, step))
        FP = product(F, runs_last(belief.covariance))
        P = product(F, FP.swapaxes(0, 1)) + Q  # F (F P)^T, because P is symmetric
        return Gaussian(self.dynamics.propagate(belief.mean, step), runs_first(P))

    def update(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the corrected belief; runs outside the gate keep their prediction, `rejected` counts them."""
        corrected, innovation = self.correct(belief, z, step)
        corrected = self.keep_considered(belief, corrected)
        if self._gate is None:
            return corrected, innovation
        rejected = innovation.nis > self._gate
        extras = {**innovation.extras, "rejected": rejected.astype(float)}
        return (
            where_runs(~rejected, corrected, belief),
            Innovation(innovation.nis, innovation.log_likelihood, extras),
        )

    def keep_considered(self, predicted: Gaussian, corrected: Gaussian) -> Gaussian:
        """Return the corrected belief with the considered states as predicted."""
        return keep_considered(predicted, corrected, self._considered)

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the belief after the measurement, and its innovation."""
        raise TypeError(f"{type(self).__name__} has no correct(belief, z, step)")


def joseph_update(belief: Gaussian, residual: Array, H: Array, R: Array) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update, with a covariance that stays positive definite however wide the prior.

    One Cholesky factor S = L L^T serves all: with W = L^-1 H P and w = L^-1 nu the mean moves by W^T w and the
    covariance becomes P - W^T W. That difference loses as many digits as the prior is wider than the noise, so runs
    where it is a million times as wide get Joseph's form instead (Bucy and Joseph, Filtering for Stochastic Processes,
    1968). Each run decides for itself.

    Args:
        belief: The prediction, mean (runs, n) and covariance (runs, n, n).
        residual: z - h(m), angles wrapped, (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise (runs, m, m) or (m, m).
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
    wide = _is_wide(S, R)
    if wide.any():
        covariance = np.where(wide, _joseph(P, H, R, back(L, W), HP), covariance)
    return Gaussian(mean, runs_first(covariance)), innovation_last(L, w)


WIDE = 1e6
"""Ratio of S to R, on the diagonal, from which on the short form of the covariance is not trusted."""


def _is_wide(S: Array, R: Array) -> NDArray[np.bool_]:
    wide = S[0, 0] > WIDE * R[0, 0]
    for i in range(1, len(S)):
        wide = wide | (S[i, i] > WIDE * R[i, i])
    return wide


def _joseph(P: Array, H: Array, R: Array, KT: Array, HP: Array) -> Array:
    """Return (I - K H) P (I - K H)^T + K R K^T, runs last, multiplied out with M = (I - K H) P."""
    K = KT.swapaxes(0, 1)
    M = P - product(K, HP)
    P = M + product(product(K, R) - product(M, H.swapaxes(0, 1)), KT)
    return (P + P.swapaxes(0, 1)) / 2


def innovation_of(factor: CholeskyFactor, residual: Array) -> Innovation:
    """Return NIS and log-likelihood of a residual (runs, m) whose covariance has the given factor."""
    L = factor.lower_last
    return innovation_last(L, forward(L, runs_last(residual)))


def innovation_last(L: Array, white: Array) -> Innovation:
    """Return the same of L (m, m, runs) and the whitened residual L^-1 nu (m, runs), runs last."""
    nis = product(white[None], white[:, None])[0, 0]
    return Innovation(nis, -0.5 * (nis + len(white) * LOG_TWO_PI + log_determinant_of(L)))


class KalmanOptions(GaussianFilterOptions):
    """Options of the linear Kalman filter."""

    r_scale: Annotated[float, Tunable(0.1, 100, scales_noise=True)] = Field(
        default=1.0,
        gt=0,
        description="Factor on R; r_scale = 1/alpha gives exactly what the one-step alpha-divergence filter tends "
        "to with many samples on a linear measurement",
    )


@register_filter("kf", KalmanOptions, measurement="cartesian", overhead_us=170.0)
class KalmanFilter(GaussianFilter):
    """Linear Kalman filter (Kalman 1960) on the radar measurement converted to Cartesian coordinates.

    The baseline of every comparison: with linear dynamics and the converted measurement nothing is
    approximated but the noise. Use it when range times angle error is small against the range.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: KalmanOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._r_scale = options.r_scale

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the Kalman update with the measurement matrix at the prediction."""
        H = self.measurement.jacobian(belief.mean, step.epoch)
        R = self.measurement.noise(belief.mean, step.epoch) * self._r_scale
        residual = self.measurement.residual(z, self.measurement.predict(belief.mean, step.epoch))
        return joseph_update(belief, residual, H, R)
