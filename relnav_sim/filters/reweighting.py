"""The update of the robust filters: a Kalman update whose noise is reweighted until it fits the residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.kalman import GaussianFilterOptions, joseph_update, of_runs
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    covariance_prediction,
    definite_in_single,
    gaussian_numbers,
    linearised_update,
    mean_in_single,
    product,
    triangle,
    whitening,
)
from relnav_sim.filters.square_root import NEEDS_NOISE, NoiseRoot
from relnav_sim.linalg import SINGLE, by_run, kernel_for, symmetric
from relnav_sim.measurements.interface import Measurement, linearised

Weigh = Callable[[Array, Array], Array]
"""``weigh(e, spread)`` -> positive weights (runs, k), at one for residuals as the noise should give them: whitened
residuals e (runs, k), and the variances (runs, k) that the estimate's own error adds to them."""


class ReweightingOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the filters whose noise is reweighted."""

    @model_validator(mode="after")
    def _prior_in_double(self) -> Self:
        if self.arithmetic == "float32" and getattr(self, "weigh_prior", False):
            raise ValueError("weigh_prior is computed in float64 only; leave it or arithmetic: float32 out")
        return self


@dataclass(frozen=True)
class Reweighted:
    """A reweighted update.

    Args:
        posterior: The belief of the last one.
        unweighted: The innovation by the noise as the measurement gives it.
        weighted: The same by the noise of the last update.
        weights: Of the measurement in the last update, (runs, m).
        failed: Why runs can't go on, by their places.
    """

    posterior: Gaussian
    unweighted: Innovation
    weighted: Innovation
    weights: Array
    failed: Mapping[int, str]


def reweighted_update(
    belief: Gaussian,
    z: Array,
    measurement: Measurement,
    epoch: int,
    weigh: Weigh,
    iterations: int,
    weigh_prior: bool = False,
) -> tuple[Gaussian, Innovation]:
    """Return the update of `reweighted` about the prediction, and the innovation.

    NIS and log-likelihood are those of the unweighted innovation; the extra `lowest_weight` is the smallest weight of
    the measurement.
    """
    update = reweighted(belief, *linearised(measurement, z, belief.mean, epoch), weigh, iterations, weigh_prior)
    extras = {"lowest_weight": update.weights.min(axis=-1)}
    return update.posterior, replace(update.unweighted, extras=extras, failed=update.failed)


def reweighted(
    belief: Gaussian,
    nu: Array,
    H: Array,
    R: Array,
    weigh: Weigh,
    iterations: int,
    weigh_prior: bool = False,
) -> Reweighted:
    """Return a Kalman update with noise L diag(1 / w) L^T, R = L L^T, by iteratively reweighted least squares.

    The weights follow from the residuals after the update, e = L^-1 (nu - H dx), H taken at the prediction; weights
    of one give the Kalman update. Directions without noise always have the weight of a perfect fit; in float32 they
    fail the run, as does a covariance that is lost. The covariance is that of the last reweighted update.

    Args:
        belief: The prediction.
        nu: Residuals z - h(m), (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise (runs, m, m) or (m, m).
        weigh: Weights from whitened residuals.
        iterations: Reweighted updates.
        weigh_prior: Reweight the prediction's covariance as well, by L_P^-1 dx. The first residuals are then taken at
            the prediction, not after an unweighted update: where an outlier has drawn that half way, both sides look
            equally bad and the weights cannot tell which is wrong.
    """
    mean, P = belief.mean, belief.covariance
    kind = mean.dtype
    nu, H, R = np.ascontiguousarray(nu), by_run(H, kind), by_run(R, kind)
    root, white, rows, failed = _whitened(nu, H, R)
    spread_of_prior = NoiseRoot(P) if weigh_prior else None
    posterior, unweighted = joseph_update(belief, nu, H, R)
    prior = belief
    shift = np.zeros_like(mean) if weigh_prior else posterior.mean - mean
    residuals, scaled = (kernel_for(nu, kernels.reweighting, name) for name in ("residuals", "scaled"))
    for _ in range(iterations):
        e, spread = residuals(white, rows, shift, np.ascontiguousarray(posterior.covariance))
        weights: Array = np.ascontiguousarray(weigh(e, spread), dtype=kind)
        if spread_of_prior is not None:
            weights_of_prior = weigh(spread_of_prior.whiten(shift), np.zeros_like(shift))
            prior = Gaussian(mean, symmetric(spread_of_prior.scaled(weights_of_prior)))
        posterior, weighted = joseph_update(prior, nu, H, scaled(root, weights))
        shift = posterior.mean - mean
    failed |= unweighted.failed
    if kind == SINGLE:
        failed |= weighted.failed
    return Reweighted(posterior, unweighted, weighted, weights, failed)


def reweighted_operations(size: Size, options: Any) -> Operations:
    """Return what a filter costs whose noise is reweighted `iterations` times; the weights themselves do not count."""
    n, m, width = size.n, size.m, bytes_of(options)
    update = linearised_update(n, m, width)
    single = mean_in_single(n, width) + definite_in_single(n, width)
    again = product(m, n, n) + 4 * m * n + 3 * m * triangle(m) + update
    count = covariance_prediction(n) + single + whitening(m, n + 1) + update + options.iterations * again
    return Operations(count, gaussian_numbers(n, m), width)


def _whitened(nu: Array, H: Array, R: Array) -> tuple[Array, Array, Array, dict[int, str]]:
    """Return a root L of R, (runs, m, m), L^-1 nu and L^-1 H, and which runs fail.

    Directions without noise whiten to zero in float64, and fail in float32.
    """
    root, white, rows, singular = kernel_for(nu, kernels.reweighting, "whitened")(nu, H, R)
    places = np.flatnonzero(singular)
    if nu.dtype == SINGLE:
        return root, white, rows, dict.fromkeys(places.tolist(), NEEDS_NOISE)
    if len(places):
        noise = NoiseRoot(of_runs(R, places))
        root[places], white[places] = noise.root, noise.whiten(nu[places])
        rows[places] = noise.whiten_rows(of_runs(H, places))
    return root, white, rows, {}
