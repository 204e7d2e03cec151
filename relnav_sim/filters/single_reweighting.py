"""The update of the robust filters in float32."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.single_precision import SingleGaussian, SinglePrecision
from relnav_sim.filters.square_root import NEEDS_NOISE


def reweighted_in_single(
    single: SinglePrecision,
    belief: Gaussian | SingleGaussian,
    z: Array,
    epoch: int,
    weigh: Callable[[Array, Array], Array],
    iterations: int,
) -> tuple[SingleGaussian, Innovation]:
    """Return what `reweighting.reweighted_update` does, in float32; R must have noise in every channel.

    Args:
        single: The filter's arithmetic.
        belief: The prediction.
        z: Reading (runs, m).
        epoch: Its epoch.
        weigh: Weights from whitened residuals and the variances that the estimate adds to them.
        iterations: Reweighted updates.
    """
    prior = single.own(belief)
    nu, H, R = single.linearised(z, prior, epoch)
    root, white, rows, singular = kernels.reweighting.whitened_single(nu, H, R)
    posterior, unweighted = single.joseph_update(prior, nu, H, R)
    failed = dict(unweighted.failed)
    for _ in range(iterations):
        e, spread = kernels.reweighting.residuals_single(white, rows, posterior.x - prior.x, posterior.P)
        weights: Array = np.ascontiguousarray(weigh(e, spread), dtype=np.float32)
        posterior, weighted = single.joseph_update(prior, nu, H, kernels.reweighting.scaled_single(root, weights))
    failed |= dict(weighted.failed) | dict.fromkeys(np.flatnonzero(singular).tolist(), NEEDS_NOISE)
    extras = {"lowest_weight": weights.min(axis=-1).astype(np.float64)}
    return posterior, replace(unweighted, extras=extras, failed=failed)
