"""The Gaussian update that the Kalman filters share, and the linear Kalman filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import chdtri

from relnav_sim.filters.belief import Gaussian, Innovation, where_runs
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import LOG_TWO_PI, CholeskyFactor, symmetric, transpose
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.measurement import Measurement
from relnav_sim.options import Options
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
    """Prediction, gating and starting of a filter whose belief is a Gaussian; `correct` is the algorithm's own."""

    stochastic = False

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianFilterOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        probability = options.gate_probability
        self._gate = None if probability is None else float(chdtri(measurement.dimension, 1 - probability))

    def start(self, prior: Gaussian, source: RandomSource) -> Gaussian:
        """Return the prior."""
        return prior

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        F = self.dynamics.transition(belief.mean, step)
        Q = self.dynamics.process_noise(belief.mean, step)
        P = F @ belief.covariance @ transpose(F) + Q
        return Gaussian(self.dynamics.propagate(belief.mean, step), P)

    def update(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the corrected belief; runs outside the gate keep their prediction, `rejected` counts them."""
        corrected, innovation = self.correct(belief, z, step)
        if self._gate is None:
            return corrected, innovation
        rejected = innovation.nis > self._gate
        extras = {**innovation.extras, "rejected": rejected.astype(float)}
        return (
            where_runs(~rejected, corrected, belief),
            Innovation(innovation.nis, innovation.log_likelihood, extras),
        )

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the belief after the measurement, and its innovation."""
        raise TypeError(f"{type(self).__name__} has no correct(belief, z, step)")


def joseph_update(belief: Gaussian, residual: Array, H: Array, R: Array) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update with Joseph's covariance, positive definite however wide the prior.

    Bucy and Joseph, Filtering for Stochastic Processes, 1968: P = (I - K H) P (I - K H)^T + K R K^T, multiplied out
    with M = (I - K H) P, which saves two products of n x n matrices.

    Args:
        belief: The prediction, mean (runs, n) and covariance (runs, n, n).
        residual: z - h(m), angles wrapped, (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise (runs, m, m) or (m, m).
    """
    P = belief.covariance
    HP = H @ P
    factor = CholeskyFactor(HP @ transpose(H) + R)
    KT = factor.solve(HP)
    K = transpose(KT)
    mean = belief.mean + np.einsum("bmn,bm->bn", KT, residual)
    M = P - K @ HP
    covariance = symmetric(M + (K @ R - M @ transpose(H)) @ KT)
    return Gaussian(mean, covariance), innovation_of(factor, residual)


def innovation_of(factor: CholeskyFactor, residual: Array) -> Innovation:
    """Return NIS and log-likelihood of a residual (runs, m) whose covariance has the given factor."""
    nis = np.square(factor.whiten(residual)).sum(axis=-1)
    constant = residual.shape[-1] * LOG_TWO_PI + factor.log_determinant()
    return Innovation(nis, -0.5 * (nis + constant))


class KalmanOptions(GaussianFilterOptions):
    """Options of the linear Kalman filter."""

    r_scale: float = Field(
        default=1.0,
        gt=0,
        description="Factor on R; r_scale = 1/alpha gives exactly what the one-step alpha-divergence filter tends "
        "to with many samples on a linear measurement",
    )


@register_filter("kf", KalmanOptions, measurement="cartesian")
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
