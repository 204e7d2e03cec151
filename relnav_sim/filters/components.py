"""Gaussian mixtures over the state: one Kalman update per component of state and noise, and moment matching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, keep_considered
from relnav_sim.filters.kalman import innovation_of, joseph_update
from relnav_sim.linalg import by_run
from relnav_sim.measurements.interface import Measurement, joint_components

NO_COMPONENT = "no component of the mixture gives the measurement a finite likelihood"


def noise_components(measurement: Measurement, mean: Array, epoch: int) -> tuple[Array, Array]:
    """Return weights (k,) and covariances (k, m, m) or (runs, k, m, m) of the noise; one if it is Gaussian.

    Channels that switch by themselves give every combination of their components.
    """
    mixture = measurement.mixture(mean, epoch)
    if mixture is None:
        R = measurement.noise(mean, epoch)
        return np.ones(1), R[..., None, :, :]
    return joint_components(mixture)


@dataclass(frozen=True)
class Linearised:
    """The measurement at the components' means: z expected there (runs, c, m), and H (runs, c, m, n)."""

    expected: Array
    H: Array

    @classmethod
    def at(cls, measurement: Measurement, means: Array, epoch: int) -> Linearised:
        """Return it for means (runs, c, n)."""
        expected, H = measurement.predict(means, epoch), measurement.jacobian(means, epoch)
        return cls(expected, np.ascontiguousarray(np.broadcast_to(H, (*expected.shape, means.shape[-1]))))


def predicted_components(dynamics: Dynamics, mean: Array, covariances: Array, step: Step) -> Array:
    """Return the covariances (runs, c, n, n) carried over a step, with F and Q at the mixture's mean (runs, n)."""
    runs, c, n, _ = covariances.shape
    F, Q = by_run(dynamics.transition(mean, step)), by_run(dynamics.process_noise(mean, step))
    F, Q = (A if len(A) == 1 else A.repeat(c, axis=0) for A in (F, Q))
    return kernels.kalman.predict(covariances.reshape(-1, n, n), F, Q).reshape(runs, c, n, n)


def component_updates(
    measurement: Measurement,
    model: Linearised,
    log_weights: Array,
    means: Array,
    covariances: Array,
    noises: Array,
    z: Array,
    considered: tuple[int, ...] = (),
) -> tuple[Array, Array, Array, Array]:
    """Return the extended Kalman update of every state component with every noise component given for it.

    Args:
        measurement: The model of z.
        model: The same at the means.
        log_weights: Before the measurement, (runs, c, k).
        means: (runs, c, n).
        covariances: (runs, c, n, n).
        noises: (c or 1, k, m, m) or (runs, c or 1, k, m, m).
        z: (runs, m).
        considered: Places of the states that are not estimated.

    Returns:
        Log-weights (runs, c k), means (runs, c k, n), covariances (runs, c k, n, n) and the log-likelihood of the
        mixture (runs,). A component whose update gives no number has no weight, and the prediction's moments.
    """
    runs, c, n = means.shape
    nu = measurement.residual(z[:, None], model.expected)
    m, k = nu.shape[-1], noises.shape[-3]
    if k > 1:
        nu, x, P, H = (A.repeat(k, axis=1) for A in (nu, means, covariances, model.H))
    else:
        x, P, H = means, covariances, model.H
    R = np.broadcast_to(noises, (runs, c, k, m, m))
    prior = Gaussian(x.reshape(-1, n), P.reshape(-1, n, n))
    posterior, innovation = joseph_update(prior, nu.reshape(-1, m), H.reshape(-1, m, n), R.reshape(-1, m, m))
    posterior = keep_considered(prior, posterior, considered)
    log_likelihood = innovation.log_likelihood
    if innovation.failed:
        log_likelihood[list(innovation.failed)] = -np.inf  # a component that can't go on weighs nothing
    x, P = posterior.mean.reshape(runs, -1, n), posterior.covariance.reshape(runs, -1, n, n)
    weights, total = kernels.components.reweigh(
        log_weights.reshape(runs, -1), x, P, log_likelihood.reshape(runs, -1), means, covariances
    )
    return weights, x, P, total


def without_likelihood(log_likelihood: Array) -> dict[int, str]:
    """Return the runs (by place) that no component explains, with the reason; log p(z) (runs,) is not finite there."""
    return {place: NO_COMPONENT for place in np.flatnonzero(~np.isfinite(log_likelihood)).tolist()}


def normalised(log_weights: Array) -> tuple[Array, Array]:
    """Return weights summing to one over the last axis, and the log of their sum before."""
    total = np.logaddexp.reduce(log_weights, axis=-1)
    return np.exp(log_weights - total[..., None]), total


def predictive_nis(
    measurement: Measurement, model: Linearised, weights: Array, covariances: Array, noise: Array, z: Array
) -> Array:
    """Return nu^T S^-1 nu of the predictive mixture's moments, (runs,).

    With zhat_i = h(x_i) and S_i = H_i P_i H_i^T + R_i, the mixture has mean zbar = sum w_i zhat_i and covariance
    S = sum w_i (S_i + (zhat_i - zbar)(zhat_i - zbar)^T); nu = z - zbar. Where the model is right its mean is m, but it
    is not chi-square.

    Args:
        measurement: The model of z.
        model: The same at the components' means.
        weights: w, (runs, c).
        covariances: (runs, c, n, n), in C order.
        noise: Covariance of the noise of each component, (c or 1, m, m) or (runs, c or 1, m, m).
        z: (runs, m).
    """
    expected, H = model.expected, model.H
    # Taken from one of them on, so that angles are averaged on the same turn.
    offsets = np.ascontiguousarray(measurement.residual(expected, expected[:, :1]))
    R = np.ascontiguousarray(np.broadcast_to(noise, (*offsets.shape, offsets.shape[-1])))
    shift, S = kernels.components.expected_reading(weights, offsets, H, covariances, R)
    nu = measurement.residual(z, expected[:, 0] + shift)
    return innovation_of(S, nu, np.abs(z) + np.abs(z - nu)).nis
