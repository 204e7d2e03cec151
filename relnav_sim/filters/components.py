"""Gaussian mixtures over the state: one Kalman update per component of state and noise, and moment matching."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.filters.belief import Gaussian, keep_considered
from relnav_sim.filters.kalman import innovation_of, joseph_update
from relnav_sim.linalg import CholeskyFactor, transpose
from relnav_sim.models.measurement import Measurement

Array = NDArray[np.float64]


def noise_components(measurement: Measurement, mean: Array, epoch: int) -> tuple[Array, Array]:
    """Return weights (k,) and covariances (k, m, m) or (runs, k, m, m) of the noise; one if it is Gaussian.

    Channels that switch by themselves give every combination of their components.
    """
    mixture = measurement.mixture(mean, epoch)
    if mixture is None:
        R = measurement.noise(mean, epoch)
        return np.ones(1), R[..., None, :, :]
    if mixture.shared:
        return mixture.weights, mixture.covariances
    k, m = mixture.covariances.shape[-3], mixture.covariances.shape[-1]
    choices = np.stack(np.meshgrid(*[np.arange(k)] * m, indexing="ij"), axis=-1).reshape(-1, m)
    variances = np.einsum("...kii->...ki", mixture.covariances)[..., choices, np.arange(m)]
    return mixture.weights[choices].prod(axis=-1), variances[..., None] * np.eye(m)


def component_updates(
    measurement: Measurement,
    means: Array,
    covariances: Array,
    noises: Array,
    z: Array,
    epoch: int,
    considered: tuple[int, ...] = (),
) -> tuple[Array, Array, Array, Array]:
    """Return the extended Kalman update of every state component with every noise component given for it.

    Args:
        measurement: The model of z.
        means: (runs, c, n).
        covariances: (runs, c, n, n).
        noises: (c or 1, k, m, m) or (runs, c or 1, k, m, m).
        z: (runs, m).
        epoch: The epoch.
        considered: Places of the states that are not estimated.

    Returns:
        Means (runs, c, k, n), covariances (runs, c, k, n, n), log-likelihoods (runs, c, k) and NIS (runs, c, k).
    """
    runs, c, n = means.shape
    nu = measurement.residual(z[:, None], measurement.predict(means, epoch))
    m, k = nu.shape[-1], noises.shape[-3]
    H = np.broadcast_to(measurement.jacobian(means, epoch), (runs, c, m, n))
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
    return (
        posterior.mean.reshape(runs, c, k, n),
        posterior.covariance.reshape(runs, c, k, n, n),
        innovation.log_likelihood.reshape(runs, c, k),
        innovation.nis.reshape(runs, c, k),
    )


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
    return mean, covariance + np.einsum("...c,...ci,...cj->...ij", weights, spread, spread)


def nominal_nis(measurement: Measurement, mean: Array, covariance: Array, noises: Array, z: Array, epoch: int) -> Array:
    """Return the normalised innovation squared of a Gaussian with the first noise component, (runs,)."""
    residual = measurement.residual(z, measurement.predict(mean, epoch))
    H = measurement.jacobian(mean, epoch)
    S = H @ covariance @ transpose(H) + noises[..., 0, :, :]
    return innovation_of(CholeskyFactor(S), residual).nis
