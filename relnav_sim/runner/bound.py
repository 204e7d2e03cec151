"""The Cramér-Rao bound of one case: its truth, its measurement chain and its filters' models in one recursion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relnav_sim.campaign import Case
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.gp import GpOptions
from relnav_sim.models.nonlinear_j2 import NonlinearJ2Dynamics
from relnav_sim.models.radar import PolarRadar
from relnav_sim.results.bound import BoundResult
from relnav_sim.runner.block import create_campaign_filter
from relnav_sim.runner.simulation import STRETCH_EPOCHS
from relnav_sim.sensors import measurement_model, reading_probability
from relnav_sim.sensors.noise import noise_parts, white_law
from relnav_sim.statistics.bound import BoundRecursion, matrix_root
from relnav_sim.statistics.fisher import ReadingInformation
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

Array = NDArray[np.float64]

ENSEMBLE = 20
"""Truths over which the information is averaged where the truth is dispersed: those of runs 0 to 19, run or not, so
that the bound does not depend on the number of runs."""


@dataclass(frozen=True)
class _Ensemble:
    """The truth of a case at all epochs.

    Attributes:
        chief: ECI state of the chief, mean over the ensemble, (T, 6).
        relative: Relative states, RTN, (b, T, 6).
        probability: Probability of a measurement, (b, T).
    """

    chief: Array
    relative: Array
    probability: Array


def case_bound(case: Case, seed: int, case_index: int = 0) -> BoundResult:
    """Return the bound of a perfect model and the bounds of the filters' own models at the stored epochs.

    The information of a reading is that of the campaign's radar at the true states, its noise white as simulated and
    joined by the white errors of attitude and orbit; the average over the ensemble of truths weighs a reading with
    its probability. Biases and correlated errors are not in it: the bound is that of a chain without them.

    The perfect model has no process noise; its transitions are those of relative motion under a point mass and J2,
    about the true chief's orbit and along the true relative motion. A filter's model has the transitions of its own
    dynamics at the true states (with the true orbit of the chief where it estimates it) and its own process noise.

    Args:
        case: The case.
        seed: The campaign's seed.
        case_index: Number of the case, passed on to the result.
    """
    config = case.config
    clock = config.clock
    truth = _ensemble(config, seed)
    models: dict[str, _Model] = {}
    model_of = {}
    for name, entry in config.filters.items():
        model_of[name] = key = _model_key(entry)
        if key not in models:
            models[key] = _Model(create_campaign_filter(entry, config, seed).dynamics, clock.step_s)
    perfect = NonlinearJ2Dynamics(_true_orbit(config), np.zeros((6, 6)), clock.step_s)
    chain = [_Model(perfect, clock.step_s), *models.values()]

    information = _Information(config, truth)
    start = _start(config, truth, information)
    bounds = [start]
    recursion = BoundRecursion(np.broadcast_to(start, (len(chain), 6, 6)))
    mean = truth.relative.mean(axis=0)
    for epochs in _stretches(1, clock.epochs):
        roots = matrix_root(information.at(epochs))
        F = np.empty((len(epochs), len(chain), 6, 6))
        Q = np.empty((len(epochs), len(chain), 6, 6))
        for i, model in enumerate(chain):
            F[:, i], Q[:, i] = model.at(epochs, truth.chief, mean)
        noise_roots = matrix_root(Q)
        for k, epoch in enumerate(epochs):
            recursion.advance(F[k], noise_roots[k], roots[k])
            if epoch % clock.store_every == 0:
                bounds.append(recursion.covariance)
    covariance = np.stack([np.broadcast_to(bound, (len(chain), 6, 6)) for bound in bounds], axis=1)
    deviations = _deviations(covariance)
    place = {key: i for i, key in enumerate(models, start=1)}
    return BoundResult(
        case_index=case_index,
        case_id=case.id,
        perfect=deviations[0],
        filters={name: deviations[place[key]] for name, key in model_of.items()},
    )


def _deviations(covariance: Array) -> Array:
    """Return the square roots of covariances (..., 6, 6) by quantity: six components and two norms, (..., 8)."""
    variances = np.einsum("...ii->...i", covariance)
    norms = [variances[..., :3].sum(axis=-1), variances[..., 3:].sum(axis=-1)]
    return np.sqrt(np.concatenate([variances, np.stack(norms, axis=-1)], axis=-1))


def _model_key(entry: FilterEntry) -> str:
    """Return what tells the model of a filter apart: most filters of a campaign share theirs."""
    if isinstance(entry.dynamics, GpOptions):
        return entry.model_dump_json()
    return entry.dynamics.model_dump_json() + entry.process_noise.model_dump_json()


def _stretches(first: int, end: int) -> Iterator[NDArray[np.int64]]:
    for start in range(first, end, STRETCH_EPOCHS):
        yield np.arange(start, min(start + STRETCH_EPOCHS, end))


def _ensemble(config: CaseConfig, seed: int) -> _Ensemble:
    runs = tuple(range(ENSEMBLE if config.truth.is_dispersed else 1))
    trajectory = truth_trajectory(config.truth, config.clock.duration_s, RandomSource(seed, runs))
    chief, relative, probability = [], [], []
    for epochs in _stretches(0, config.clock.epochs):
        truth = trajectory.at(epochs * config.clock.step_s)
        chief.append(truth.chief.mean(axis=0))
        relative.append(truth.relative)
        probability.append(reading_probability(config.sensors, truth, int(epochs[0]), config.clock.step_s))
    return _Ensemble(np.concatenate(chief), np.concatenate(relative, axis=1), np.concatenate(probability, axis=1))


def _true_orbit(config: CaseConfig):
    """Return the constants by which the perfect model goes: without J2 where the truth has none."""
    orbit = nominal_chief(config.truth)
    return orbit if config.truth.forces.zonals >= 2 else replace(orbit, j2=0.0)


class _Model:
    """Transitions and process noise of one model along the truth."""

    def __init__(self, dynamics: Dynamics, step_s: float) -> None:
        self._dynamics = dynamics
        self._step_s = step_s

    def at(self, epochs: Array, chief: Array, relative: Array) -> tuple[Array, Array]:
        """Return F and Q of the steps that end at `epochs`, (K, 6, 6) each.

        Args:
            epochs: (K,).
            chief: ECI states of the chief at all epochs, (T, 6).
            relative: Relative states, RTN, at all epochs, (T, 6).
        """
        begin = epochs - 1
        states = relative[begin]
        if isinstance(self._dynamics, NonlinearJ2Dynamics):
            # The epochs take the place of runs: each has a chief of its own, and a step is a step.
            along = self._dynamics.with_chief(chief[begin, None], first_epoch=0)
            step = Step(1, self._step_s)
            return along.transition(states, step), along.process_noise(states, step)
        steps = [Step(int(epoch), self._step_s) for epoch in epochs]
        pairs = [
            (self._dynamics.transition(state[None], step), self._dynamics.process_noise(state[None], step))
            for state, step in zip(states, steps, strict=True)
        ]
        F, Q = (np.stack([np.reshape(pair[i], (6, 6)) for pair in pairs]) for i in (0, 1))
        return F, Q


class _Information:
    """The information E[H^T I H] of the measurement chain along an ensemble of truths."""

    def __init__(self, config: CaseConfig, truth: _Ensemble) -> None:
        radar = config.sensors.radar
        assert radar is not None  # a campaign has one: its filters need it
        model = measurement_model("polar", "nominal", config.sensors, nominal_chief(config.truth))
        assert isinstance(model, PolarRadar)
        self._model = model
        self._truth = truth
        law = white_law(noise_parts(radar.noise), 3)
        self._own = np.diag(np.square(law.nominal * radar.sigmas))
        every = max(truth.relative.shape[1] // 1000, 1)
        attitude = self._attitude(truth.relative.reshape(-1, 6))
        self._reading = ReadingInformation(law.weights, law.scales * radar.sigmas, attitude)

    def _attitude(self, states: Array) -> Array:
        """Return the covariance that the attitude's error adds to the angles, (N, 2, 2)."""
        total = np.broadcast_to(self._model.noise(states, 0), (len(states), 3, 3))
        return total[:, 1:, 1:] - self._own[1:, 1:]

    def at(self, epochs: Array) -> Array:
        """Return the information of the readings at some epochs, (K, 6, 6)."""
        states, probability = self._truth.relative[:, epochs], self._truth.probability[:, epochs]
        b, K = probability.shape
        flat = states.reshape(-1, 6)
        H = self._model.jacobian(flat, 0)
        information = H.swapaxes(1, 2) @ self._reading.at(self._attitude(flat)) @ H
        weighed = np.where(probability[..., None, None] > 0, information.reshape(b, K, 6, 6), 0.0)
        return (probability[..., None, None] * weighed).mean(axis=0)


def _start(config: CaseConfig, truth: _Ensemble, information: _Information) -> Array:
    """Return J_0^-1 (6, 6), the covariance with which the filters could start; NaN where no run can."""
    start = config.start
    if isinstance(start, FirstFixStart):
        share = truth.probability[:, 0].mean()  # runs without a first fix have failed and do not count
        if share == 0:
            return np.full((6, 6), np.nan)
        J = information.at(np.array([0])) / share
        J[0, 3:, 3:] += np.diag(1 / np.square(start.velocity_sigma_m_s))
        return np.asarray(np.linalg.inv(J[0]))
    return np.diag(np.square([*start.position_sigma_m, *start.velocity_sigma_m_s]))
