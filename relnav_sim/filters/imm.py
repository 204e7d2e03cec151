"""Interacting multiple models over the components of the measurement noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

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
    cholesky,
    covariance_prediction,
    gaussian_numbers,
    innovation_covariance,
    kalman_update,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import present_channels
from relnav_sim.options import Options, Tunable
from relnav_sim.streams import RandomSource


class ImmOptions(Options):
    """Options of the interacting-multiple-model filter."""

    persistence: Annotated[float, Tunable(0, 0.95, log=False)] = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="How far the noise component of one epoch stays for the next: the transition matrix is "
        "persistence I + (1 - persistence) 1 w^T with the mixture's weights w. Default 0: independent epochs; 0.9 "
        "for bursts of glint about ten epochs long",
    )


@dataclass(frozen=True)
class ModelBank:
    """One Gaussian per model: log probabilities (runs, k), means (runs, k, n), covariances (runs, k, n, n)."""

    log_weights: Array
    means: Array
    covariances: Array

    @property
    def mean(self) -> Array:
        """Mean over the models (runs, n)."""
        return self._moments[0]

    @property
    def covariance(self) -> Array:
        """Covariance over the models (runs, n, n)."""
        return self._moments[1]

    @cached_property
    def _moments(self) -> tuple[Array, Array]:
        return kernels.components.moment_match(np.exp(self.log_weights), self.means, self.covariances)


def _operations(size: Size, options: Any) -> Operations:
    """Return what a filter for each component of the noise costs, with their mixing and their moments."""
    n, m, c = size.n, size.m, size.noises
    filters = covariance_prediction(n) + kalman_update(n, m) + innovation_covariance(n, m)
    mixing = (c + 1) * (4 * n * n + 3 * n + 3) + n * n + n + 5
    predictive = cholesky(m) + 2 * m * m + 5 * m + 4
    return Operations(c * (filters + mixing) + predictive, c * gaussian_numbers(n, m))


@register_filter("imm", ImmOptions, cost_us=1.4, overhead_us=110.0, operations=_operations)
class InteractingModelsFilter(KeepsModels):
    """Interacting multiple models: one extended Kalman filter per component of the measurement noise.

    Blom and Bar-Shalom, IEEE Trans. Automatic Control 33(8), 1988. The models share the dynamics and differ in R; a
    Markov chain says how the components follow each other. Use it when the noise is a known mixture and glint comes
    in bursts; with independent epochs it is the Gaussian-sum filter with one component kept. It needs the mixture
    (`assumed_noise: mixture`); with Gaussian noise it is the extended Kalman filter.
    """

    stochastic = False
    double_only = "it mixes several Gaussians, and weighs them in float64"
    considers = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ImmOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        self._persistence = options.persistence

    def start(self, prior: Gaussian, source: RandomSource) -> ModelBank:
        """Return the prior in every model, with the mixture's weights."""
        weights, _ = noise_components(self.measurement, prior.mean, 0)
        runs, n = prior.mean.shape
        k = len(weights)
        return ModelBank(
            np.broadcast_to(np.log(weights), (runs, k)).copy(),
            np.broadcast_to(prior.mean[:, None], (runs, k, n)).copy(),
            np.broadcast_to(prior.covariance[:, None], (runs, k, n, n)).copy(),
        )

    def predict(self, belief: ModelBank, step: Step) -> ModelBank:
        """Return the models mixed by the Markov chain and carried over the step."""
        weights, _ = noise_components(self.measurement, belief.means[:, 0], step.epoch)
        k = len(weights)
        chain = self._persistence * np.eye(k) + (1 - self._persistence) * weights
        predicted, means, covariances = kernels.components.mix(
            belief.log_weights, chain, belief.means, belief.covariances
        )
        # Mixing leaves the overall mean as it is.
        carried = predicted_components(self.dynamics, belief.mean, covariances, step)
        return ModelBank(predicted, self.dynamics.propagate(means, step), carried)

    def update(self, belief: ModelBank, z: Array, step: Step) -> tuple[ModelBank, Innovation]:
        """Return every model's update, reweighted by its likelihood.

        The NIS is that of the predictive mixture's moments; `outlier_probability` is one minus the posterior
        probability of the first component, the nominal noise.
        """
        _, noises = noise_components(self.measurement, belief.means[:, 0], step.epoch)
        model = Linearised.at(self.measurement, belief.means, step.epoch)
        nis = predictive_nis(self.measurement, model, np.exp(belief.log_weights), belief.covariances, noises, z)
        # Each model is updated with its own noise only.
        own = noises[..., :, None, :, :]
        log_weights, means, covariances, log_likelihood = component_updates(
            self.measurement,
            model,
            belief.log_weights,
            belief.means,
            belief.covariances,
            own,
            z,
            considered_states(self.dynamics),
        )
        weights = np.exp(log_weights)
        nominal = weights[:, 0]
        if present_channels(self.measurement) is not None:
            # Models that differ in absent channels only are the same model of this measurement.
            alike = (noises == noises[..., :1, :, :]).all(axis=(-2, -1))
            nominal = np.where(alike, weights, 0.0).sum(axis=1)
        extras = {"outlier_probability": 1 - nominal}
        bank = ModelBank(log_weights, means, covariances)
        return bank, Innovation(nis, log_likelihood, extras, without_likelihood(log_likelihood))
