"""The Cramér-Rao bound of one case: its truth, its measurement chain and its filters' models in one recursion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relnav_sim.campaign import Case
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.crlb.fisher import ReadingInformation
from relnav_sim.crlb.models import Model, believed_dynamics, model_key, perfect_dynamics
from relnav_sim.crlb.recursion import BoundRecursion, matrix_root
from relnav_sim.dynamics.augmentation.kinds import Extension
from relnav_sim.printable import message_of
from relnav_sim.results.bound import BoundResult
from relnav_sim.sensors import reading_probability, relative_sensors, sensor_measurement
from relnav_sim.sensors.noise import noise_parts, white_law
from relnav_sim.simulation.augmented_states import augmented_measurement, extension_of
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

Array = NDArray[np.float64]

ENSEMBLE = 20
"""Truths over which the information is averaged where the truth is dispersed: those of runs 0 to 19, whether they are
run or not, so that no bound depends on the number of runs."""


def bound_surviving(case: Case, seed: int, learned: Learned) -> BoundResult:
    """Return the bounds of a case; what can't be computed is left out with the reason, and nothing is raised.

    Args:
        case: The case with all its filters.
        seed: The campaign's seed.
        learned: What is learned already.
    """
    try:
        return case_bound(case, seed, learned)
    except Exception as error:  # whatever the cause, it must not end the campaign
        return failed_bound(case, seed, message_of(error), retry=lacks_memory(error))


def failed_bound(case: Case, seed: int, reason: str, retry: bool) -> BoundResult:
    """Return the result of a case that has no bounds; `retry` where another attempt may succeed."""
    return BoundResult(seed, case.id, case.filter_ids, None, {}, reason, retry)


def case_bound(case: Case, seed: int, learned: Learned | None = None) -> BoundResult:
    """Return the bound of a perfect model and the bounds of the filters' own models at the stored epochs.

    The information of a reading is that of the campaign's radar at the true states, with its white noise as simulated
    and the white errors of attitude and orbit beside it, times the probability that there is a reading, on average
    over the ensemble of truths. Biases and correlated errors are not in it.

    The perfect model has no process noise; its transitions are those of relative motion under the truth's point mass
    and zonal harmonics, about the true chief's orbit and along the true relative motion. A filter's model has the
    transitions of its own dynamics along the same states (about the true orbit of the chief where it estimates that)
    and its own process noise. Transitions are those at the ensemble's mean state: their spread is of the size of
    separation over orbit radius, as is its effect.

    Args:
        case: The case with all its filters.
        seed: The campaign's seed.
        learned: What is learned already; it saves time and changes no bit. Default: nothing.
    """
    config = case.config
    learned = learned or Learned()
    truth = _ensemble(config, seed)
    information = _Information(config, truth)
    sharers: dict[str, list[str]] = {}
    for name, entry in config.filters.items():
        sharers.setdefault(model_key(entry), []).append(name)
    models = {"": Model(partial(perfect_dynamics, config), config, about_chief=True)}
    models |= {
        key: Model(
            partial(believed_dynamics, names, config, seed, learned),
            config,
            extension_of(config.filters[names[0]], config),
            about_chief="chief_fixes" in config.filters[names[0]].dynamics.needs,
        )
        for key, names in sharers.items()
    }
    bounds: dict[str, Array] = {}
    for keys in _with_the_same_states(models):
        bounds |= dict(zip(keys, _side_by_side([models[key] for key in keys], config, truth, information), strict=True))
    broken = {key: model.broken for key, model in models.items() if model.broken}
    return BoundResult(
        seed=seed,
        case_id=case.id,
        filter_ids=case.filter_ids,
        perfect=None if "" in broken else bounds[""],
        filters={name: bounds[key] for key, names in sharers.items() if key not in broken for name in names},
        reason="; ".join(
            f"{', '.join(sharers.get(key, ['perfect model']))}: {message_of(error)}" for key, error in broken.items()
        ),
        retry=any(lacks_memory(error) for error in broken.values()),
    )


def _with_the_same_states(models: Mapping[str, Model]) -> list[list[str]]:
    """Return the keys of models in groups with the same extra states."""
    groups: list[list[str]] = []
    for key, model in models.items():
        for group in groups:
            if models[group[0]].has_states_of(model):
                group.append(key)
                break
        else:
            groups.append([key])
    return groups


def _side_by_side(
    models: Sequence[Model], config: CaseConfig, truth: _Ensemble, information: _Information
) -> Iterator[Array]:
    """Yield the bound of each of some models with the same states, (times, 8)."""
    clock, extra = config.clock, models[0].extra
    n = models[0].dimension
    covariances = np.full((clock.stored, len(models), n, n), np.nan)
    start = _start(config, truth, information, extra)
    if start is not None:
        covariances[0] = start
        recursion = BoundRecursion(covariances[0])
        for epochs in _chunks(1, clock.epochs):
            states = truth.relative_mean[epochs - 1]
            steps = [model.at(epochs, truth.chief[epochs - 1], states) for model in models]
            transitions, noises = (np.stack([step[i] for step in steps], axis=1) for i in (0, 1))
            noise_roots, roots = matrix_root(noises), matrix_root(information.at(epochs, extra))
            for k, epoch in enumerate(epochs):
                recursion.advance(transitions[k], noise_roots[k], roots[k])
                if epoch % clock.store_every == 0:
                    covariances[epoch // clock.store_every] = recursion.covariance
    yield from _deviations(covariances[..., :6, :6]).swapaxes(0, 1)


def _deviations(covariance: Array) -> Array:
    """Return the square roots of covariances (..., 6, 6) by quantity: six components and two norms, (..., 8)."""
    variances = np.einsum("...ii->...i", covariance)
    norms = [variances[..., :3].sum(axis=-1), variances[..., 3:].sum(axis=-1)]
    return np.sqrt(np.concatenate([variances, np.stack(norms, axis=-1)], axis=-1))


def _chunks(first: int, end: int) -> Iterator[NDArray[np.int64]]:
    for start in range(first, end, CHUNK_EPOCHS):
        yield np.arange(start, min(start + CHUNK_EPOCHS, end))


@dataclass(frozen=True)
class _Ensemble:
    """The truth of a case at all epochs; NaN where a trajectory has ended.

    Attributes:
        chief: ECI state of the chief, mean over the ensemble, (T, 6).
        relative: Relative states, RTN, (b, T, 6).
        relative_mean: Their mean, (T, 6).
        probability: By sensor, the probability of each channel, (b, T, m); NaN where a trajectory has ended.
    """

    chief: Array
    relative: Array
    relative_mean: Array
    probability: Mapping[str, Array]


def _ensemble(config: CaseConfig, seed: int) -> _Ensemble:
    runs = tuple(range(ENSEMBLE if config.truth.is_dispersed else 1))
    trajectory = truth_trajectory(config.truth, config.clock.duration_s, RandomSource(seed, runs))
    chief, relative = [], []
    probability: dict[str, list[Array]] = {name: [] for name in relative_sensors(config.sensors)}
    for epochs in _chunks(0, config.clock.epochs):
        truth = trajectory.at(epochs * config.clock.step_s)
        chief.append(_mean(truth.chief))
        relative.append(truth.relative)
        ended = np.isnan(truth.relative[..., :1])
        for name in probability:
            likely = reading_probability(config.sensors, name, truth, int(epochs[0]), config.clock.step_s)
            probability[name].append(np.where(ended, np.nan, likely))
    states = np.concatenate(relative, axis=1)
    chances = {name: np.concatenate(parts, axis=1) for name, parts in probability.items()}
    return _Ensemble(np.concatenate(chief), states, _mean(states), chances)


def _mean(values: Array) -> Array:
    """Return the mean over the leading axis of what is no NaN; NaN where there is nothing."""
    known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0))


class _SensorInformation:
    """The information of one sensor's readings along an ensemble of truths, E[H^T I H]."""

    def __init__(self, name: str, config: CaseConfig, truth: _Ensemble) -> None:
        options = relative_sensors(config.sensors)[name]
        orbit, step_s = nominal_chief(config.truth), config.clock.step_s
        self._name, self._config, self._truth = name, config, truth
        self._model = sensor_measurement(
            name, config.sensors, orbit, step_s, assumed_noise="nominal", assumed_latency="none"
        )
        self._alone = np.flatnonzero(~np.array(options.needs_direction()))
        law = white_law(noise_parts(options.noise), len(options.channels))
        self._reading: ReadingInformation | None = None
        if len(law.weights) > 1:
            self._own = np.diag(np.square(law.nominal * options.sigmas))
            attitude = np.concatenate([self._attitude(states) for states in truth.relative])
            self._reading = ReadingInformation(law.weights, law.scales * options.sigmas, attitude)

    def _attitude(self, states: Array) -> Array:
        """Return the covariance that the attitude's error adds to the angles, (N, 2, 2)."""
        R = self._model.noise(states, 0) - self._own
        return np.asarray(np.broadcast_to(R[..., 1:, 1:], (len(states), 2, 2)))

    def _noise_information(self, states: Array) -> Array:
        """Return the Fisher information (N, m, m) that noise leaves about the channels."""
        if self._reading is not None:
            return self._reading.at(self._attitude(states))
        R = self._model.noise(states, 0)
        return np.asarray(np.linalg.inv(np.broadcast_to(R, (len(states), *R.shape[-2:]))))

    def at(self, epochs: NDArray[np.int64], extra: Extension | None = None) -> Array:
        """Return the information of the readings at some epochs, (K, n, n); 0 where no trajectory goes on.

        Args:
            epochs: (K,).
            extra: States behind the six that readings depend on too; they count as 0.
        """
        states, probability = self._truth.relative[:, epochs], self._truth.probability[self._name][:, epochs]
        flat = states.reshape(-1, 6)
        H, noise = self._jacobian(flat, extra), self._noise_information(flat)
        whole = probability.min(axis=-1)
        total = self._weighed(H, noise, whole)
        if len(self._alone):
            # What is left of a reading without direction.
            part = probability[..., self._alone].min(axis=-1) - whole
            if (part > 0).any():
                kept = np.asarray(np.linalg.inv(np.linalg.inv(noise)[:, self._alone[:, None], self._alone]))
                total = total + self._weighed(H[:, self._alone], kept, part)
        going = np.maximum((~np.isnan(whole)).sum(axis=0), 1)
        return np.asarray(total / going[:, None, None])

    def _weighed(self, H: Array, noise: Array, probability: Array) -> Array:
        """Return the sum (K, n, n) over the ensemble of the information times its probability (b, K)."""
        n = H.shape[-1]
        information = (H.swapaxes(1, 2) @ noise @ H).reshape(*probability.shape, n, n)
        # Where nothing is measured the information may be anything, as of a target on the radar's axis.
        weighed = np.where(probability[..., None, None] > 0, probability[..., None, None] * information, 0.0)
        return np.asarray(weighed.sum(axis=0))

    def _jacobian(self, states: Array, extra: Extension | None) -> Array:
        """Return H (N, m, n) at states (N, 6)."""
        if extra is None:
            H = self._model.jacobian(states, 0)
        else:
            whole = np.concatenate([states, np.zeros((len(states), len(extra.names)))], axis=1)
            H = augmented_measurement(extra, self._name, self._model, self._config).jacobian(whole, 0)
        return np.broadcast_to(H, (len(states), *H.shape[-2:]))


class _Information:
    """The information of some sensors' readings together; their errors count as independent."""

    def __init__(self, config: CaseConfig, truth: _Ensemble) -> None:
        self._sensors = {name: _SensorInformation(name, config, truth) for name in relative_sensors(config.sensors)}

    def at(
        self, epochs: NDArray[np.int64], extra: Extension | None = None, names: Sequence[str] | None = None
    ) -> Array:
        """Return the information at some epochs, (K, n, n), of the sensors of these names; None: of all."""
        each = [self._sensors[name].at(epochs, extra) for name in (self._sensors if names is None else names)]
        return each[0] if len(each) == 1 else np.asarray(sum(each))


def _start(config: CaseConfig, truth: _Ensemble, information: _Information, extra: Extension | None) -> Array | None:
    """Return J_0^-1 (n, n), the covariance of the error with which filters start at best; None where none can."""
    start = config.start
    behind = np.zeros(0) if extra is None else extra.sigma
    if isinstance(start, FirstFixStart):
        name = fix_sensor(config)
        # A run without a first fix has failed and does not count.
        share = float(truth.probability[name][:, 0].min(axis=-1).mean())
        if not share > 0:
            return None
        J = information.at(np.zeros(1, dtype=np.int64), extra, [name])[0] / share
        J[3:, 3:] += np.diag(1 / np.square([*start.velocity_sigma_m_s, *behind]))
        return np.asarray(np.linalg.inv(J))
    return np.diag(np.square([*start.position_sigma_m, *start.velocity_sigma_m_s, *behind]))
