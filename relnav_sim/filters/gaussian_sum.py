"""Gaussian-sum filter for mixture noise, kept small by Runnalls' merging."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array, Indices
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states
from relnav_sim.filters.components import (
    Linearised,
    component_updates,
    mixture_mean,
    moment_match,
    noise_components,
    normalised,
    predictive_nis,
    without_likelihood,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import factor, log_determinant_of, runs_first, runs_last, symmetric, transpose
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource

# Share of the variances by which singular covariances are widened to compare them, well above their rounding.
_TRIFLE = 1e-12


class GaussianSumOptions(Options):
    """Options of the Gaussian-sum filter."""

    components: int = Field(
        default=4,
        ge=1,
        le=16,
        description="Gaussians kept after each update; the cost grows with its square. 1: collapse to one, which "
        "already removes independent glint",
    )


@dataclass(frozen=True)
class GaussianSum:
    """Weights (runs, c), means (runs, c, n) and covariances (runs, c, n, n); unused components weigh nothing."""

    weights: Array
    means: Array
    covariances: Array

    @property
    def mean(self) -> Array:
        """Mean of the mixture (runs, n)."""
        return mixture_mean(self.weights, self.means)

    @property
    def covariance(self) -> Array:
        """Covariance of the mixture (runs, n, n)."""
        return moment_match(self.weights, self.means, self.covariances)[1]


@register_filter("gaussian_sum", GaussianSumOptions, cost_us=40.0, overhead_us=280.0)
class GaussianSumFilter:
    """Gaussian-sum filter: the posterior under mixture noise as a mixture itself.

    Alspach and Sorenson, IEEE Trans. Automatic Control 17(4), 1972. Every Gaussian of the belief is updated with every
    component of the noise; the closest pairs are then merged (Runnalls, IEEE Trans. Aerospace and Electronic Systems
    43(3), 2007) until the wanted number is left. Use it as the reference for known mixture noise: what it gains over
    `imm` is the memory of several epochs. It needs the mixture (`assumed_noise: mixture`); with Gaussian noise it is
    the extended Kalman filter. Channels that switch by themselves (`shared: false`) make 2^3 noise components of two,
    at ten times the cost.
    """

    stochastic = False
    considers = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianSumOptions) -> None:
        self.dynamics = dynamics
        self._considered = considered_states(dynamics)
        self.measurement = measurement
        self._components = options.components

    def start(self, prior: Gaussian, source: RandomSource) -> GaussianSum:
        """Return the prior as the only component that weighs."""
        runs, n = prior.mean.shape
        c = self._components
        weights = np.zeros((runs, c))
        weights[:, 0] = 1.0
        return GaussianSum(
            weights,
            np.broadcast_to(prior.mean[:, None], (runs, c, n)).copy(),
            np.broadcast_to(prior.covariance[:, None], (runs, c, n, n)).copy(),
        )

    def predict(self, belief: GaussianSum, step: Step) -> GaussianSum:
        """Return every component carried over the step, with F and Q at the mixture's mean."""
        mean = belief.mean
        F = self.dynamics.transition(mean, step)
        Q = self.dynamics.process_noise(mean, step)
        F = F[:, None] if F.ndim == 3 else F
        Q = Q[:, None] if Q.ndim == 3 else Q
        covariances = symmetric(F @ belief.covariances @ transpose(F) + Q)
        return GaussianSum(belief.weights, self.dynamics.propagate(belief.means, step), covariances)

    def update(self, belief: GaussianSum, z: Array, step: Step) -> tuple[GaussianSum, Innovation]:
        """Return the reduced mixture of all updates; the NIS is that of the predictive mixture's moments."""
        epoch = step.epoch
        mean = belief.mean
        weights, noises = noise_components(self.measurement, mean, epoch)
        total = np.einsum("k,...kij->...ij", weights, noises)[..., None, :, :]
        model = Linearised.at(self.measurement, belief.means, epoch)
        nis = predictive_nis(self.measurement, model, belief.weights, belief.covariances, total, z)
        means, covariances, log_likelihoods = component_updates(
            self.measurement, model, belief.means, belief.covariances, noises[..., None, :, :, :], z, self._considered
        )
        runs, n = mean.shape
        with np.errstate(divide="ignore"):
            log_prior = np.log(belief.weights)[:, :, None] + np.log(weights)
        posterior, log_likelihood = normalised((log_prior + log_likelihoods).reshape(runs, -1))
        mixture = GaussianSum(posterior, means.reshape(runs, -1, n), covariances.reshape(runs, -1, n, n))
        innovation = Innovation(nis, log_likelihood, failed=without_likelihood(log_likelihood))
        return reduced(mixture, self._components), innovation


def reduced(mixture: GaussianSum, components: int) -> GaussianSum:
    """Return the mixture with at most so many components, mean and covariance unchanged.

    Greedy: the pair whose merging costs the least Kullback-Leibler bound (Runnalls 2007, eq. 21) goes first.
    """
    runs, c = mixture.weights.shape
    if c <= components:
        return mixture
    # Components first and runs last: a component against all others is then elementwise work without copies.
    weights, means, covariances = runs_last(mixture.weights), runs_last(mixture.means), runs_last(mixture.covariances)
    log_dets = _log_determinants(covariances)
    every = (weights, means, covariances, log_dets)
    alive = np.ones((c, runs), dtype=bool)
    # Only pairs i < j have a cost.
    cost = np.full((c, c, runs), np.inf)
    for i in range(c - 1):
        cost[i, i + 1 :] = _merging_costs([part[i] for part in every], [part[i + 1 :] for part in every])
    rows, index = np.arange(runs), np.arange(c)[:, None]
    for _ in range(c - components):
        best = np.argmin(cost.reshape(-1, runs), axis=0)
        keep, drop = best // c, best % c
        merged = _merged([_chosen(part, keep) for part in every[:3]], [_chosen(part, drop) for part in every[:3]])
        pair = (*merged, _log_determinants(merged[2]))
        for part, value in zip(every, pair, strict=True):
            np.put_along_axis(part, _along(part, keep), value[None], axis=0)
        weights[drop, rows] = 0.0
        alive[drop, rows] = False
        fresh = np.where(alive & (index != keep), _merging_costs(pair, every), np.inf)
        cost[np.minimum(keep, index), np.maximum(keep, index), rows] = fresh
        cost[drop, :, rows] = np.inf
        cost[:, drop, rows] = np.inf
    # The heaviest components come first; merged ones weigh nothing and fall behind.
    order = np.argsort(-weights, axis=0, kind="stable")[:components]
    weights, means, covariances = (runs_first(_chosen(part, order)) for part in every[:3])
    return GaussianSum(weights, means, symmetric(covariances))


def _along(part: Array, which: Indices) -> Indices:
    """Return component numbers (runs,) or (p, runs) in the shape that indexes `part` (c, ..., runs) along axis 0."""
    which = np.atleast_2d(which)
    return which.reshape(len(which), *[1] * (part.ndim - 2), -1)


def _chosen(part: Array, which: Indices) -> Array:
    """Return the components `which` of each run: (..., runs) for (runs,), (p, ..., runs) for (p, runs)."""
    chosen = np.take_along_axis(part, _along(part, which), axis=0)
    return chosen if which.ndim == 2 else chosen[0]


def _merged(one: Sequence[Array], others: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Return weight, mean and covariance of one component (..., runs) merged with each of others (p, ..., runs)."""
    (weight, mean, covariance), (weights, means, covariances) = one, others
    total = weight + weights
    # Two components that weigh nothing merge like equals.
    share = np.where(total > 0, weights / np.where(total > 0, total, 1.0), 0.5)[..., None, :]
    apart = means - mean
    merged = share[..., None, :] * covariances
    merged += (1 - share[..., None, :]) * covariance
    merged += (share * (1 - share) * apart)[..., None, :] * apart[..., None, :, :]
    return total, mean + share * apart, merged


def _merging_costs(one: Sequence[Array], others: Sequence[Array]) -> Array:
    """Return Runnalls' bound of one component with each of the others, (p, runs); inf in a broken run."""
    total, _, covariances = _merged(one[:3], others[:3])
    cost = 0.5 * (total * _log_determinants(covariances) - one[0] * one[3] - others[0] * others[3])
    return np.fmin(cost, np.inf)


def _log_determinants(covariances: Array) -> Array:
    """Return log det of (..., n, n, runs): (..., runs); a singular matrix gets a trifle of its variances first."""
    C = np.moveaxis(covariances, (-3, -2), (0, 1))
    result = log_determinant_of(factor(C))
    singular = ~np.isfinite(result)
    if singular.any():
        trifle = np.einsum("ii...->i...", C) * _TRIFLE + np.finfo(float).tiny
        widened = C + np.eye(len(C)).reshape(len(C), len(C), *[1] * (C.ndim - 2)) * trifle
        result = np.where(singular, log_determinant_of(factor(widened)), result)
    return result
