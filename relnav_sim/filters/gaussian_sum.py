"""Gaussian-sum filter for mixture noise, kept small by Runnalls' merging."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, KeepsModels, considered_states
from relnav_sim.filters.components import (
    Linearised,
    component_updates,
    noise_components,
    predicted_components,
    predictive_nis,
    without_likelihood,
)
from relnav_sim.filters.operations import (
    Operations,
    Size,
    covariance_prediction,
    gaussian_numbers,
    innovation_covariance,
    kalman_update,
    triangle,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource


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
        return self._moments[0]

    @property
    def covariance(self) -> Array:
        """Covariance of the mixture (runs, n, n)."""
        return self._moments[1]

    @cached_property
    def _moments(self) -> tuple[Array, Array]:
        return kernels.components.moment_match(self.weights, self.means, self.covariances)


def _operations(size: Size, options: Any) -> Operations:
    """Return what `components` priors, each updated by every component of the noise, cost, and their merging.

    Merging compares all pairs by the determinants of what they would become (Runnalls 2007).
    """
    n, m = size.n, size.m
    priors, posteriors = options.components, options.components * size.noises
    moments = 4 * n * n + 3 * n
    update = priors * covariance_prediction(n) + posteriors * (kalman_update(n, m) + innovation_covariance(n, m))
    merging = posteriors * (posteriors - 1) // 2 * (n**3 // 3 + 8 * triangle(n))
    return Operations(update + 2 * posteriors * moments + merging, posteriors * gaussian_numbers(n, m))


@register_filter("gaussian_sum", GaussianSumOptions, cost_us=3.5, overhead_us=130.0, operations=_operations)
class GaussianSumFilter(KeepsModels):
    """Gaussian-sum filter: the posterior under mixture noise as a mixture itself.

    Alspach and Sorenson, IEEE Trans. Automatic Control 17(4), 1972. Every Gaussian of the belief is updated with every
    component of the noise; the closest pairs are then merged (Runnalls, IEEE Trans. Aerospace and Electronic Systems
    43(3), 2007) until the wanted number is left. Use it as the reference for known mixture noise: what it gains over
    `imm` is the memory of several epochs. It needs the mixture (`assumed_noise: mixture`); with Gaussian noise it is
    the extended Kalman filter. Channels that switch by themselves (`shared: false`) make 2^3 noise components of two,
    at ten times the cost.
    """

    stochastic = False
    double_only = "it mixes several Gaussians, and weighs them in float64"
    considers = True

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
        covariances = predicted_components(self.dynamics, belief.mean, belief.covariances, step)
        return GaussianSum(belief.weights, self.dynamics.propagate(belief.means, step), covariances)

    def update(self, belief: GaussianSum, z: Array, step: Step) -> tuple[GaussianSum, Innovation]:
        """Return the reduced mixture of all updates; the NIS is that of the predictive mixture's moments."""
        epoch = step.epoch
        mean = belief.mean
        weights, noises = noise_components(self.measurement, mean, epoch)
        total = np.einsum("k,...kij->...ij", weights, noises)[..., None, :, :]
        model = Linearised.at(self.measurement, belief.means, epoch)
        nis = predictive_nis(self.measurement, model, belief.weights, belief.covariances, total, z)
        with np.errstate(divide="ignore"):
            log_prior = np.log(belief.weights)[:, :, None] + np.log(weights)
        log_weights, means, covariances, log_likelihood = component_updates(
            self.measurement,
            model,
            log_prior,
            belief.means,
            belief.covariances,
            noises[..., None, :, :, :],
            z,
            considered_states(self.dynamics),
        )
        innovation = Innovation(nis, log_likelihood, failed=without_likelihood(log_likelihood))
        return reduced(GaussianSum(np.exp(log_weights), means, covariances), self._components), innovation


def reduced(mixture: GaussianSum, components: int) -> GaussianSum:
    """Return the mixture with at most so many components, mean and covariance unchanged.

    Greedy: the pair whose merging costs the least Kullback-Leibler bound (Runnalls 2007, eq. 21) goes first.
    """
    if mixture.weights.shape[1] <= components:
        return mixture
    return GaussianSum(*kernels.merging.reduce(mixture.weights, mixture.means, mixture.covariances, components))
