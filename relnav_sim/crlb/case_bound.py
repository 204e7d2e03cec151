"""The Cramér-Rao bound of one case: its truth, its sensors and its filters' models in one recursion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign import Case
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.crlb.case_observability import case_observability
from relnav_sim.crlb.host_frames import HostFrames
from relnav_sim.crlb.information import SensorInformation, joint_information
from relnav_sim.crlb.models import Model, believed_dynamics, model_key, perfect_dynamics
from relnav_sim.crlb.recursion import BoundRecursion, matrix_root
from relnav_sim.crlb.start import start_covariance
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.printable import message_of
from relnav_sim.results.bound import BoundResult
from relnav_sim.sensors import reading_probability, relative_sensors
from relnav_sim.simulation.augmented_states import drawn_extension, extension_of
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.streams import RandomSource
from relnav_sim.truth import truth_trajectory

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
    return BoundResult(seed, case.id, case.filter_ids, None, {}, reason=reason, retry=retry)


def case_bound(case: Case, seed: int, learned: Learned | None = None) -> BoundResult:
    """Return the bounds of perfect models and of the filters' own models at the stored epochs.

    Each filter is bounded by the measurements of its own sensors. The information of a measurement is that of the
    sensor at the true states, with its white noise as simulated and the white errors of attitude and orbit beside it,
    times the probability that there is a measurement, on average over the ensemble of truths. Biases and correlated
    errors are not in it, but for those that a sensor says each run draws: a perfect model has them as unknown states.

    A perfect model has no process noise; its transitions are those of relative motion under the truth's point mass
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
    information = {name: SensorInformation(name, config, truth.relative, frame="perfect") for name in truth.probability}
    every = tuple(information)
    sensors = {name: _sensors_of(entry, config) for name, entry in config.filters.items()}
    sharers: dict[str, list[str]] = {}
    for name, entry in config.filters.items():
        sharers.setdefault(model_key(entry), []).append(name)
    models = {
        ("", of): Model(partial(perfect_dynamics, config), config, drawn_extension(config, of), about_chief=True)
        for of in dict.fromkeys((every, *sensors.values()))
    }
    models |= {
        (key, sensors[names[0]]): Model(
            partial(believed_dynamics, names, config, seed, learned),
            config,
            extension_of(config.filters[names[0]], config),
            about_chief="chief_fixes" in config.filters[names[0]].dynamics.needs,
        )
        for key, names in sharers.items()
    }
    bounds: dict[_Key, Array] = {}
    for keys in _alike(models):
        own = {name: information[name] for name in keys[0][1]}
        found = _side_by_side([models[key] for key in keys], config, truth, information, own)
        bounds |= dict(zip(keys, found, strict=True))
    broken = {key: model.broken for key, model in models.items() if model.broken}
    perfect = {of: bounds["", of] for key, of in models if not key and ("", of) not in broken}
    return BoundResult(
        seed=seed,
        case_id=case.id,
        filter_ids=case.filter_ids,
        perfect=perfect.get(every),
        filters={
            name: bounds[key, of] for key, of in models if key and (key, of) not in broken for name in sharers[key]
        },
        observability=case_observability(config),
        perfect_of={name: perfect[of] for name, of in sensors.items() if of != every and of in perfect},
        reason="; ".join(
            f"{', '.join(sharers.get(key, ['perfect model']))}: {message_of(error)}"
            for (key, _), error in broken.items()
        ),
        retry=any(lacks_memory(error) for error in broken.values()),
    )


_Key = tuple[str, tuple[str, ...]]
"""What tells models of the motion apart, empty of a perfect one, and the sensors whose measurements count."""


def _sensors_of(entry: FilterEntry, config: CaseConfig) -> tuple[str, ...]:
    """Return the sensors that a filter goes by, in the order of the campaign."""
    chosen = relative_sensors(config.sensors, entry.sensors)
    return tuple(name for name in relative_sensors(config.sensors) if name in chosen)


def _alike(models: Mapping[_Key, Model]) -> list[list[_Key]]:
    """Return the keys of models in groups with the same sensors and the same augmented states."""
    groups: list[list[_Key]] = []
    for key, model in models.items():
        for group in groups:
            if group[0][1] == key[1] and models[group[0]].has_states_of(model):
                group.append(key)
                break
        else:
            groups.append([key])
    return groups


def _side_by_side(
    models: Sequence[Model],
    config: CaseConfig,
    truth: _Ensemble,
    every: Mapping[str, SensorInformation],
    own: Mapping[str, SensorInformation],
) -> Iterator[Array]:
    """Yield the bound of each of some models with the same states and the same sensors of their own, (times, 8)."""
    clock, extra = config.clock, models[0].extra
    n = models[0].dimension
    covariances = np.full((clock.stored, len(models), n, n), np.nan)
    start = _start(config, truth, every, extra)
    if start is not None:
        covariances[0] = start
        recursion = BoundRecursion(covariances[0])
        for epochs in _chunks(1, clock.epochs):
            states = truth.relative_mean[epochs - 1]
            steps = [model.at(epochs, truth.chief[epochs - 1], states) for model in models]
            transitions, noises = (np.stack([step[i] for step in steps], axis=1) for i in (0, 1))
            roots = matrix_root(truth.information(own, epochs, extra))
            found = recursion.through(transitions, _noise_roots(noises), roots)
            stored = epochs % clock.store_every == 0
            covariances[epochs[stored] // clock.store_every] = found[stored]
    yield from _deviations(covariances[..., :6, :6]).swapaxes(0, 1)


def _noise_roots(noises: Array) -> Array:
    """Return roots of Q (K, models, n, n), which most often is the same at all epochs."""
    same = bool((noises == noises[:1]).all())
    return np.broadcast_to(matrix_root(noises[:1] if same else noises), noises.shape)


def _deviations(covariance: Array) -> Array:
    """Return the square roots of covariances (..., 6, 6) by quantity: six components and two norms, (..., 8)."""
    variances = np.einsum("...ii->...i", covariance)
    norms = [variances[..., :3].sum(axis=-1), variances[..., 3:].sum(axis=-1)]
    return np.sqrt(np.concatenate([variances, np.stack(norms, axis=-1)], axis=-1))


def _chunks(first: int, end: int) -> Iterator[Integers]:
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
        frames: By sensor whose host's fixes may be missing, the covariance of its orbit frame's error, (T, 6, 6).
    """

    chief: Array
    relative: Array
    relative_mean: Array
    probability: Mapping[str, Array]
    frames: Mapping[str, Array]

    def information(self, sensors: Mapping[str, SensorInformation], epochs: Integers, extra: Extension | None) -> Array:
        """Return the information of some sensors' measurements at some epochs (K,), (K, n, n)."""
        probability = {name: self.probability[name][:, epochs] for name in sensors}
        frames = {name: covariance[epochs] for name, covariance in self.frames.items()}
        return joint_information(sensors, self.relative[:, epochs], probability, epochs, extra, frames)


def _ensemble(config: CaseConfig, seed: int) -> _Ensemble:
    runs = tuple(range(ENSEMBLE if config.truth.is_dispersed else 1))
    trajectory = truth_trajectory(config.truth, config.clock.duration_s, RandomSource(seed, runs))
    chief, relative = [], []
    probability: dict[str, list[Array]] = {name: [] for name in relative_sensors(config.sensors)}
    hosts = HostFrames(config)
    frames: dict[str, list[Array]] = {name: [] for name in hosts.sensors}
    for epochs in _chunks(0, config.clock.epochs):
        truth = trajectory.at(epochs * config.clock.step_s)
        for name, covariance in hosts.advance(epochs, _mean(truth.chief), _mean(truth.deputy)).items():
            frames[name].append(covariance)
        chief.append(_mean(truth.chief))
        relative.append(truth.relative)
        ended = np.isnan(truth.relative[..., :1])
        for name in probability:
            likely = reading_probability(config.sensors, name, truth, int(epochs[0]), config.clock.step_s)
            probability[name].append(np.where(ended, np.nan, likely))
    states = np.concatenate(relative, axis=1)
    chances = {name: np.concatenate(parts, axis=1) for name, parts in probability.items()}
    errors = {name: np.concatenate(parts) for name, parts in frames.items()}
    return _Ensemble(np.concatenate(chief), states, _mean(states), chances, errors)


def _mean(values: Array) -> Array:
    """Return the mean over the leading axis of what is no NaN; NaN where there is nothing."""
    known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0))


def _start(
    config: CaseConfig, truth: _Ensemble, sensors: Mapping[str, SensorInformation], extra: Extension | None
) -> Array | None:
    """Return J_0^-1 (n, n), the covariance of the error with which filters start at best; None where none can."""
    if not isinstance(config.start, FirstFixStart):
        return start_covariance(config.start, None, extra)
    name = fix_sensor(config)
    # A run without a first fix has failed and does not count.
    share = float(truth.probability[name][:, 0].min(axis=-1).mean())
    if not share > 0:
        return None
    fix = truth.information({name: sensors[name]}, np.zeros(1, dtype=np.int64), extra)[0] / share
    return start_covariance(config.start, fix, extra)
