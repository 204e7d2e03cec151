"""Stochastic-search Kalman filter: the variational Gaussian, KL(q|p), by sampled natural gradients."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.gaussian_sampling import (
    SamplingFilter,
    SamplingOptions,
    WhitenedPrior,
    sums_over_samples,
    whitened_prior,
)
from relnav_sim.filters.iekf import search_operations
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    definite_in_single,
    gaussian_numbers,
    unscented_prediction,
)
from relnav_sim.filters.particle_set import standard_normals
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import DOUBLE, SINGLE, CholeskyFactor, cholesky, symmetric, transpose
from relnav_sim.measurements.interface import Measurement, affine, sample_residuals
from relnav_sim.streams import RandomSource, Streams

# A step that takes away more than all but this share of the covariance is halved, at most so many times.
_LEAST_KEPT = 0.01
_HALVINGS = 40
# Ratio of H P H^T to R beyond which differences of whitened residuals hold too few digits for a search. In whitened
# coordinates a residual is a difference of numbers as large as its root. In float32 that leaves 0.001 of a residual at
# 7e7, next to nothing beside what the samples scatter.
_WIDEST = {DOUBLE: 1e12, SINGLE: (1e-3 / float(np.finfo(SINGLE).eps)) ** 2}


class StochasticSearchOptions(SamplingOptions):
    """Options of the stochastic-search filter."""

    iterations: int = Field(
        default=20,
        ge=1,
        description="Natural-gradient steps of length 1/t, t = 1, 2, ...; default that of the authors' code",
    )
    samples: int = Field(
        default=500,
        ge=32,
        description="Number S of samples a gradient; default that of the authors' code (20 x 500 = the 10000 "
        "samples of their other filters)",
    )
    start: Literal["posterior", "prior"] = Field(
        default="posterior",
        description="First iterate. posterior: of the iterated extended Kalman filter, exact where the measurement "
        "is linear; prior: the prediction, as in the authors' code, from which 20 steps leave about a tenth of the "
        "way to the optimum",
    )


def _operations(size: Size, options: Any) -> Operations:
    """Return what a gradient from `samples` costs, `iterations` times, where all states are sampled.

    Each sample is drawn, its whitened misfits to measurement and prior are squared, and it is added to the gradients.
    """
    n, m, width = size.n, size.m, bytes_of(options)
    each = 2 * n * n + (m * m + 2 * m) + (n * n + 2 * n) + (n * n + n) + 4
    once = search_operations(size, 2, width) + definite_in_single(n, width)
    count = unscented_prediction(n) + once + options.iterations * options.samples * each
    return Operations(count, gaussian_numbers(n, m) + options.iterations * options.samples * (2 * n + m + 1), width)


@register_filter("skf", StochasticSearchOptions, cost_us=600.0, overhead_us=4000.0, operations=_operations)
class StochasticSearchFilter(SamplingFilter):
    """Stochastic-search Kalman filter: the Gaussian q that minimises KL(q|p) to the posterior.

    Gultekin and Paisley (IEEE Trans. Signal Processing 65(23), 2017, algorithm 1). The gradients of the evidence
    lower bound are averages over samples of q, with the linearised measurement as control variate: what is sampled
    is only the difference to the extended Kalman filter, so for a linear measurement nothing is random.

    Use it where a unimodal posterior must be followed tightly: KL(q|p) avoids places where p is small, so it
    locks to one of two modes and is overconfident about skew tails; `mkf` covers them. The step lengths 1/t leave
    the noise of the last gradients in the estimate.

    The authors' gradient steps are affine-invariant, so they are taken here in whitened coordinates of the states
    the measurement depends on; the other states follow by regression, exactly. nis and log_likelihood are those of
    the Gaussian innovation; extra `fallback`: 1 where no step kept the covariance positive definite, numbers broke
    down, or the measurement is too precise for the prediction (a million standard deviations), and the iterated
    extended Kalman update was taken.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: StochasticSearchOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options
        self._streams = Streams([])

    def start(self, prior: Gaussian, source: RandomSource) -> Gaussian:
        """Return the prior; the samples come from the stream ``filter.skf.samples``."""
        self._streams = source.streams("filter.skf.samples")
        return prior

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the Gaussian that the search ends at."""
        prior = whitened_prior(belief, self._observed)
        mean, covariance = self._search(prior, belief, z, step)
        posterior = prior.posterior(mean, covariance)
        usable = np.isfinite(posterior.covariance.sum(axis=(1, 2)) + posterior.mean.sum(axis=1))
        model = self.linearise(belief, z, step.epoch)
        seen, noise = (np.einsum("...ii->...i", A) for A in (model.HPH, model.R))
        usable &= (seen <= _WIDEST[self.kind] * noise).all(axis=-1)
        posterior, failed = self.with_fallback(posterior, usable, belief, z, 1.0, step)
        innovation = model.innovation()
        return posterior, replace(innovation, extras={"fallback": 1.0 - usable}, failed=failed)

    def _search(self, prior: WhitenedPrior, belief: Gaussian, z: Array, step: Step) -> tuple[Array, Array]:
        """Return mean (runs, d) and covariance (runs, d, d) of q in the coordinates where the prior is N(0, I)."""
        d, epoch = prior.roots.shape[1], step.epoch
        start = belief if self._options.start == "prior" else self.iterated_update(belief, z, 1.0, step)[0]
        mean, root = prior.coordinates(start)
        covariance = root @ transpose(root)
        # z ~ h linearised at the start and with its noise whitened becomes nu ~ H y + N(0, I).
        model = self.linearise(start, z, epoch)
        noise = CholeskyFactor(np.broadcast_to(self.seen.noise(belief.mean, epoch), model.HPH.shape))
        unit = np.eye(d, dtype=self.kind)
        H = noise.whiten_rows(np.broadcast_to(model.H @ transpose(prior.roots), (*model.residual.shape, d)))
        nu = noise.whiten(model.residual) + np.einsum("bmd,bd->bm", H, mean)
        information = transpose(H) @ H + unit
        score = np.einsum("bmd,bm->bd", H, nu)
        for iteration in range(1, self._options.iterations + 1):
            e = standard_normals(self._streams, d, self._options.samples).astype(self.kind, copy=False)
            y = mean[:, :, None] + root @ e
            states = affine(*prior.samples(mean, root), e)
            sampled = noise.whiten_rows(sample_residuals(self.seen, z, states, epoch))
            linear = nu[:, :, None] - H @ y
            # phi = log p(z|x) less its linearised form, the control variate.
            phi = 0.5 * np.einsum("bmn,bmn->bn", linear - sampled, linear + sampled) / self._options.samples
            first = sums_over_samples(phi, e)
            second = (phi[:, None] * e) @ transpose(e) - phi.sum(axis=1)[:, None, None] * unit
            move = np.einsum("bij,bj->bi", root, first) + np.einsum(
                "bij,bj->bi", covariance, score - np.einsum("bij,bj->bi", information, mean)
            )
            change = symmetric(root @ second @ transpose(root) + covariance - covariance @ information @ covariance) / 2
            length, root = _feasible_step(covariance, change, 1 / iteration)
            mean = mean + length[:, None] * move
            covariance = covariance + length[:, None, None] * change
        return mean, covariance


def _feasible_step(covariance: Array, change: Array, longest: float) -> tuple[Array, Array]:
    """Return the first of longest, longest / 2, ... at which the covariance keeps a hundredth of itself.

    The authors' code asks for a positive definite covariance only; one that is singular but for rounding passes,
    and the search then stands still.

    Returns:
        Lengths (runs,) and the Cholesky factors (runs, d, d) of covariance + length change; NaN where none will do.
    """
    length = np.full(len(covariance), longest, covariance.dtype)
    for _ in range(_HALVINGS):
        kept = cholesky((1 - _LEAST_KEPT) * covariance + length[:, None, None] * change)
        infeasible = np.isnan(kept.sum(axis=(1, 2)))
        if not infeasible.any():
            break
        length = np.where(infeasible, length / 2, length)
    return length, cholesky(covariance + length[:, None, None] * change)
