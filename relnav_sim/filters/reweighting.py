"""The update of the robust filters: a Kalman update whose noise is reweighted until it fits the residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.kalman import joseph_update
from relnav_sim.filters.square_root import NoiseRoot
from relnav_sim.linalg import symmetric
from relnav_sim.measurements.interface import Measurement

Weigh = Callable[[Array, Array], Array]
"""``weigh(e, spread)`` -> positive weights (runs, k), at one for residuals as the noise should give them: whitened
residuals e (runs, k), and the variances (runs, k) that the estimate's own error adds to them."""


def reweighted_update(
    belief: Gaussian,
    z: Array,
    measurement: Measurement,
    epoch: int,
    weigh: Weigh,
    iterations: int,
    weigh_prior: bool = False,
) -> tuple[Gaussian, Innovation]:
    """Return a Kalman update with noise L diag(1 / w) L^T, R = L L^T, by iteratively reweighted least squares.

    The weights follow from the residuals after the update, e = L^-1 (nu - H dx), H taken at the prediction; weights
    of one give the Kalman update. Directions without noise always have the weight of a perfect fit. The covariance is
    that of the last reweighted update. NIS and log-likelihood are those of the unweighted innovation; the extra
    `lowest_weight` is the smallest weight of the measurement.

    Args:
        belief: The prediction.
        z: Measurement (runs, m).
        measurement: Its model.
        epoch: Its epoch.
        weigh: Weights from whitened residuals.
        iterations: Reweighted updates.
        weigh_prior: Reweight the prediction's covariance as well, by L_P^-1 dx. The first residuals are then taken at
            the prediction, not after an unweighted update: where an outlier has drawn that half way, both sides look
            equally bad and the weights cannot tell which is wrong.
    """
    mean, P = belief.mean, belief.covariance
    runs = len(mean)
    nu = measurement.residual(z, measurement.predict(mean, epoch))
    H = measurement.jacobian(mean, epoch)
    R = measurement.noise(mean, epoch)
    noise = NoiseRoot(np.broadcast_to(R, (runs, *R.shape[-2:])))
    white_nu, white_H = noise.whiten(nu), noise.whiten_rows(np.broadcast_to(H, (runs, *H.shape[-2:])))
    spread_of_prior = NoiseRoot(P) if weigh_prior else None
    posterior, innovation = joseph_update(belief, nu, H, R)
    prior = belief
    shift = np.zeros_like(mean) if weigh_prior else posterior.mean - mean
    for _ in range(iterations):
        e = white_nu - np.einsum("bmn,bn->bm", white_H, shift)
        spread = np.einsum("bmn,bmn->bm", white_H @ posterior.covariance, white_H)
        weights = weigh(e, spread)
        if spread_of_prior is not None:
            weights_of_prior = weigh(spread_of_prior.whiten(shift), np.zeros_like(shift))
            prior = Gaussian(mean, symmetric(spread_of_prior.scaled(weights_of_prior)))
        posterior, _ = joseph_update(prior, nu, H, symmetric(noise.scaled(weights)))
        shift = posterior.mean - mean
    extras = {"lowest_weight": weights.min(axis=-1)}
    return posterior, replace(innovation, extras=extras)
