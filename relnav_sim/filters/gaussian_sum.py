"""Gaussian-sum filter for mixture noise, kept small by Runnalls' merging."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.components import (
    component_updates,
    moment_match,
    noise_components,
    nominal_nis,
    normalised,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import cholesky, log_determinant, transpose
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.measurement import Measurement
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]


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
        return moment_match(self.weights, self.means, self.covariances)[0]

    @property
    def covariance(self) -> Array:
        """Covariance of the mixture (runs, n, n)."""
        return moment_match(self.weights, self.means, self.covariances)[1]


@register_filter("gaussian_sum", GaussianSumOptions, cost_us=60.0)
class GaussianSumFilter:
    """Gaussian-sum filter: the posterior under mixture noise as a mixture itself.

    Alspach and Sorenson, IEEE Trans. Automatic Control 17(4), 1972. Every Gaussian of the belief is updated with every
    component of the noise; the closest pairs are then merged (Runnalls, IEEE Trans. Aerospace and Electronic Systems
    43(3), 2007) until the wanted number is left. The reference for known mixture noise: what it gains over `imm` is
    the memory of several epochs. It needs the mixture (`assumed_noise: mixture`); with Gaussian noise it is the
    extended Kalman filter.
    """

    stochastic = False

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianSumOptions) -> None:
        self.dynamics = dynamics
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
        covariances = F @ belief.covariances @ transpose(F) + Q
        return GaussianSum(belief.weights, self.dynamics.propagate(belief.means, step), covariances)

    def update(self, belief: GaussianSum, z: Array, step: Step) -> tuple[GaussianSum, Innovation]:
        """Return the reduced mixture of all updates.

        The NIS is that of the mixture's moments with the first noise component.
        """
        mean, epoch = belief.mean, step.epoch
        weights, noises = noise_components(self.measurement, mean, epoch)
        means, covariances, log_likelihoods = component_updates(
            self.measurement, belief.means, belief.covariances, noises[..., None, :, :, :], z, epoch
        )
        nis = nominal_nis(self.measurement, mean, belief.covariance, noises, z, epoch)
        runs, n = mean.shape
        with np.errstate(divide="ignore"):
            log_prior = np.log(belief.weights)[:, :, None] + np.log(weights)
        posterior, log_likelihood = normalised((log_prior + log_likelihoods).reshape(runs, -1))
        mixture = GaussianSum(posterior, means.reshape(runs, -1, n), covariances.reshape(runs, -1, n, n))
        return reduced(mixture, self._components), Innovation(nis, log_likelihood)


def reduced(mixture: GaussianSum, components: int) -> GaussianSum:
    """Return the mixture with at most so many components, mean and covariance unchanged.

    Greedy: the pair whose merging costs the least Kullback-Leibler bound (Runnalls 2007, eq. 21) goes first.
    """
    weights, means, covariances = mixture.weights.copy(), mixture.means.copy(), mixture.covariances.copy()
    runs, c = weights.shape
    if c <= components:
        return mixture
    rows = np.arange(runs)
    log_dets = log_determinant(cholesky(covariances))
    alive = np.ones((runs, c), dtype=bool)
    cost = np.full((runs, c, c), np.inf)
    for i, j in combinations(range(c), 2):
        cost[:, i, j] = _merging_cost(weights, means, covariances, log_dets, np.full(runs, i), np.full(runs, j))
    for _ in range(c - components):
        # NaN costs of a broken run must not stop the others.
        best = np.argmin(np.nan_to_num(cost, nan=np.inf).reshape(runs, -1), axis=1)
        keep, drop = best // c, best % c
        weight, mean, covariance = _pair(weights, means, covariances, keep, drop)
        weights[rows, keep], means[rows, keep], covariances[rows, keep] = weight, mean, covariance
        weights[rows, drop] = 0.0
        alive[rows, drop] = False
        log_dets[rows, keep] = log_determinant(cholesky(covariance))
        for other in range(c):
            low, high = np.minimum(keep, other), np.maximum(keep, other)
            fresh = _merging_cost(weights, means, covariances, log_dets, low, high)
            cost[rows, low, high] = np.where(alive[:, other] & (other != keep), fresh, np.inf)
        cost[~alive] = np.inf
        cost.swapaxes(1, 2)[~alive] = np.inf
    # The heaviest components come first; merged ones weigh nothing and fall behind.
    order = np.argsort(-weights, axis=1, kind="stable")[:, :components]
    return GaussianSum(weights[rows[:, None], order], means[rows[:, None], order], covariances[rows[:, None], order])


def _pair(
    weights: Array, means: Array, covariances: Array, i: NDArray[np.intp], j: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Return weight (runs,), mean and covariance of components i and j (runs,) merged."""
    rows = np.arange(len(weights))
    both = np.stack([weights[rows, i], weights[rows, j]], axis=1)
    total = both.sum(axis=1)
    # Two components that weigh nothing merge like equals.
    share = np.where(total[:, None] > 0, both / np.where(total > 0, total, 1.0)[:, None], 0.5)
    mean, covariance = moment_match(
        share,
        np.stack([means[rows, i], means[rows, j]], axis=1),
        np.stack([covariances[rows, i], covariances[rows, j]], axis=1),
    )
    return total, mean, covariance


def _merging_cost(
    weights: Array, means: Array, covariances: Array, log_dets: Array, i: NDArray[np.intp], j: NDArray[np.intp]
) -> Array:
    """Return Runnalls' bound B(i, j), (runs,)."""
    rows = np.arange(len(weights))
    total, _, covariance = _pair(weights, means, covariances, i, j)
    merged = total * log_determinant(cholesky(covariance))
    cost: Array = 0.5 * (merged - weights[rows, i] * log_dets[rows, i] - weights[rows, j] * log_dets[rows, j])
    return cost
