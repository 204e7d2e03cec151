"""Gaussian mixtures over the state: one Kalman update per component of state and noise, and moment matching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian, keep_considered, where_runs
from relnav_sim.filters.kalman import innovation_of, joseph_update
from relnav_sim.linalg import symmetric, transpose
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
    """The measurement at the components' means: z expected there (runs, c, m), and H (m, n) or (runs, c, m, n)."""

    expected: Array
    H: Array

    @classmethod
    def at(cls, measurement: Measurement, means: Array, epoch: int) -> Linearised:
        """Return it for means (runs, c, n)."""
        return cls(measurement.predict(means, epoch), measurement.jacobian(means, epoch))


def component_updates(
    measurement: Measurement,
    model: Linearised,
    means: Array,
    covariances: Array,
    noises: Array,
    z: Array,
    considered: tuple[int, ...] = (),
) -> tuple[Array, Array, Array]:
    """Return the extended Kalman update of every state component with every noise component given for it.

    Args:
        measurement: The model of z.
        model: The same at the means.
        means: (runs, c, n).
        covariances: (runs, c, n, n).
        noises: (c or 1, k, m, m) or (runs, c or 1, k, m, m).
        z: (runs, m).
        considered: Places of the states that are not estimated.

    Returns:
        Means (runs, c, k, n), covariances (runs, c, k, n, n) and log-likelihoods (runs, c, k); minus infinity, with the
        prediction's mean and covariance, where an update gives no number.
    """
    runs, c, n = means.shape
    nu = measurement.residual(z[:, None], model.expected)
    m, k = nu.shape[-1], noises.shape[-3]
    H = np.broadcast_to(model.H, (runs, c, m, n))
    flat = runs * c * k
    prior = Gaussian(
        np.broadcast_to(means[:, :, None], (runs, c, k, n)).reshape(flat, n),
        np.broadcast_to(covariances[:, :, None], (runs, c, k, n, n)).reshape(flat, n, n),
    )
    posterior, innovation = joseph_update(
        prior,
        np.broadcast_to(nu[:, :, None], (runs, c, k, m)).reshape(flat, m),
        np.broadcast_to(H[:, :, None], (runs, c, k, m, n)).reshape(flat, m, n),
        np.broadcast_to(noises, (runs, c, k, m, m)).reshape(flat, m, m),
    )
    posterior = keep_considered(prior, posterior, considered)
    log_likelihood = innovation.log_likelihood
    log_likelihood[list(innovation.failed)] = -np.inf  # a component that can't go on weighs nothing
    # With weight zero a component must still be finite: zero times NaN would spoil the others' moments.
    sound = np.isfinite(log_likelihood + posterior.mean.sum(axis=1) + posterior.covariance.sum(axis=(1, 2)))
    if not sound.all():
        posterior, log_likelihood = where_runs(sound, posterior, prior), np.where(sound, log_likelihood, -np.inf)
    return (
        posterior.mean.reshape(runs, c, k, n),
        posterior.covariance.reshape(runs, c, k, n, n),
        log_likelihood.reshape(runs, c, k),
    )


def without_likelihood(log_likelihood: Array) -> dict[int, str]:
    """Return the runs (by place) that no component explains, with the reason; log p(z) (runs,) is not finite there."""
    return {place: NO_COMPONENT for place in np.flatnonzero(~np.isfinite(log_likelihood)).tolist()}


def normalised(log_weights: Array) -> tuple[Array, Array]:
    """Return weights summing to one over the last axis, and the log of their sum before."""
    total = np.logaddexp.reduce(log_weights, axis=-1)
    return np.exp(log_weights - total[..., None]), total


def mixture_mean(weights: Array, means: Array) -> Array:
    """Return the mean (..., n) of mixtures: (..., c), (..., c, n)."""
    mean: Array = np.einsum("...c,...cn->...n", weights, means)
    return mean


def moment_match(weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Return mean (..., n) and covariance (..., n, n) of mixtures: (..., c), (..., c, n), (..., c, n, n)."""
    mean = mixture_mean(weights, means)
    spread = means - mean[..., None, :]
    covariance = np.einsum("...c,...cij->...ij", weights, covariances)
    return mean, symmetric(covariance + np.einsum("...c,...ci,...cj->...ij", weights, spread, spread))


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
        covariances: (runs, c, n, n).
        noise: Covariance of the noise of each component, (c or 1, m, m) or (runs, c or 1, m, m).
        z: (runs, m).
    """
    expected, H = model.expected, model.H
    # Taken from one of them on, so that angles are averaged on the same turn.
    offsets = measurement.residual(expected, expected[:, :1])
    shift, S = moment_match(weights, offsets, H @ covariances @ transpose(H) + noise)
    nu = measurement.residual(z, expected[:, 0] + shift)
    return innovation_of(S, nu, np.abs(z) + np.abs(z - nu)).nis
