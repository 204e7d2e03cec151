"""Whether the filters of a case can observe the state by their sensors, from the nominal truth and their own models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.containment import Containment
from relnav_sim.crlb.information import SensorInformation, joint_information
from relnav_sim.crlb.observability import WeakestDirection, direction_in_words, directions_in_words, observability
from relnav_sim.crlb.start import start_covariance
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.known_thrust import KnownThrust
from relnav_sim.dynamics.registry import build_dynamics, dynamics_kinds
from relnav_sim.results.observability import NOT_OBSERVABLE, Observability
from relnav_sim.sensors import channels_due, reading_at_every_epoch, reading_probability, relative_sensors
from relnav_sim.simulation.augmented_states import extension_of
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.simulation.thrust_inputs import known_thrust, planned_forces
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, rough_truth, truth_trajectory

MOST_STEPS = 300
"""Steps into which a run is cut, however many epochs it has: each stands for the measurements of all its epochs."""

LEAST_SIGMA = 1e-3
"""Least sigma of the start that counts, as a share of the separation and of the speed at which the orbit turns it: a
start that is known better than any measurement could tell is no want of observability."""

ROUGH = 1e-9
"""Relative error of the truth: centimetres tell nothing of where there are measurements."""


def case_observability(config: CaseConfig) -> dict[str, Observability]:
    """Return what the measurements of its sensors can tell each filter of a case, by name.

    Left out are filters of which it can't be said: nothing to start from, or a model that can't be made or followed.

    Measurements count at the state that a filter's own model reaches from the true start, with the manoeuvres that the
    filter is told of: about any other trajectory a model seems to learn from what it leaves out. Where and when there
    are measurements is taken from the nominal truth. Noise counts by its covariance. In place of learned dynamics,
    which take a training to know, stands ``cw``.

    Args:
        config: The case.
    """
    looked = _Looked.at(config)
    found: dict[str, Observability | None] = {}
    told: dict[tuple[object, ...], Observability | None] = {}
    for name, entry in config.filters.items():
        # A model of the user's own may raise anything, and on a sensor's axis there are no angles.
        with Containment(), np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            extra = extension_of(entry, looked.config)
            motion = _motion(entry, extra, looked)
            states, transitions = _followed(motion, looked, 0 if extra is None else len(extra.names))
            names = tuple(relative_sensors(config.sensors, entry.sensors))
            # Filters that differ in their update, or in noise that their motion does not follow from, are told alike.
            key = states.tobytes(), transitions.tobytes(), names, repr(entry.augmented_states)
            if key not in told:
                told[key] = _observability(names, extra, states, transitions, looked)
            found[name] = told[key]
    return {name: one for name, one in found.items() if one is not None}


@dataclass(frozen=True)
class _Looked:
    """A case at the epochs that are looked at.

    Attributes:
        config: The case, with the longer step.
        every: Epochs of the campaign in one step.
        times_s: Ends of the steps, and 0, (K + 1,), s.
        start: True relative state at the start, (6,).
        chances: By sensor, the expected number of measurements of each channel in the step to each epoch, (1, K + 1,
            m).
        fix: Probability of the channels of the measurement at the start, by sensor, (1, 1, m).
        stored: For each stored epoch of the campaign, the last of these epochs that is no later, (times,).
    """

    config: CaseConfig
    every: int
    times_s: Array
    start: Array
    chances: dict[str, Array]
    fix: dict[str, Array]
    stored: Integers

    @classmethod
    def at(cls, config: CaseConfig) -> _Looked:
        clock = config.clock
        every = max(-(-(clock.epochs - 1) // MOST_STEPS), 1)
        step_s = every * clock.step_s
        times_s = np.asarray(np.arange((clock.epochs - 1) // every + 1) * step_s, dtype=np.float64)
        whole = truth_trajectory(rough_truth(config.truth), clock.duration_s, RandomSource(0, (0,)), ROUGH)
        truth = whole.at(times_s)
        chances, fix, always = {}, {}, reading_at_every_epoch(config.sensors)
        for name, options in relative_sensors(config.sensors).items():
            # Whether a measurement is due at just these epochs does not matter, but how many there are in each step.
            likely = np.nan_to_num(reading_probability(always, name, truth, 0, step_s)[:1])
            fix[name] = likely[:, :1] * (options.offset_s == 0)
            due = channels_due(config.sensors, name, np.arange(1, every * (len(times_s) - 1) + 1), clock.step_s)
            count = due.reshape(-1, every, due.shape[1]).sum(axis=1)
            chances[name] = likely * np.concatenate([np.zeros_like(count[:1]), count])
        return cls(
            config=config.model_copy(update={"clock": clock.model_copy(update={"step_s": step_s})}),
            every=every,
            times_s=times_s,
            start=truth.relative[0, 0],
            chances=chances,
            fix=fix,
            stored=np.minimum(np.arange(clock.stored) * clock.store_every // every, len(times_s) - 1),
        )


def _observability(
    names: tuple[str, ...], extra: Extension | None, states: Array, transitions: Array, looked: _Looked
) -> Observability | None:
    config = looked.config
    P = _prior(looked, extra)
    if P is None or not np.isfinite(states).all():
        return None
    along = states[None, :, :6]
    sensors = {name: SensorInformation(name, config, along, mixture=False) for name in names}
    information = joint_information(sensors, along, looked.chances, np.arange(len(states)), extra)[1:]
    # Where a channel does not exist, as the azimuth on its axis, nothing is told.
    information = np.where(np.isfinite(information).all(axis=(1, 2), keepdims=True), information, 0.0)
    behind = () if extra is None else extra.names
    # A correlated acceleration is process noise, which is left out here as white noise is.
    out = () if extra is None else (*extra.considered, *extra.correlated)
    kept = [i for i in range(6 + len(behind)) if i - 6 not in out]
    rows, columns = np.ix_(kept, kept)
    weakest = observability(transitions[:, rows, columns], information[:, rows, columns], P[rows, columns], leading=6)
    augmented = tuple(behind[i - 6] for i in kept[6:])
    sigmas = np.sqrt(np.diag(P[rows, columns]))
    scaled = weakest.direction / sigmas
    return Observability(
        sensors=names,
        ratio=np.concatenate([[1.0], weakest.ratio])[looked.stored],
        states=("x", "y", "z", "vx", "vy", "vz", *augmented),
        direction=scaled / np.linalg.norm(scaled[:6]),
        sigma_ratio=weakest.sigma_ratio,
        blind=int((weakest.ratios > NOT_OBSERVABLE).sum()),
        weakest=direction_in_words(weakest.direction, P[rows, columns], looked.start, augmented),
        course=_course(weakest, P[:6, :6], looked),
    )


def _course(weakest: WeakestDirection, P: Array, looked: _Looked) -> tuple[tuple[float, str], ...]:
    """Return what the weakest direction is over time in words, each from its first epoch on, s.

    Where several directions are as good as untold, none of them is the weakest: then it says how many.
    """
    course: list[tuple[float, str]] = []
    blind = (weakest.course > NOT_OBSERVABLE).sum(axis=1).tolist()
    named = directions_in_words(weakest.directions, P, looked.start)
    for time_s, untold, direction in zip(looked.times_s[1:].tolist(), blind, named, strict=True):
        words = direction if untold < 2 else f"{untold} of 6 directions"
        if not course or course[-1][1] != words:
            course.append((time_s, words))
    return tuple(course)


def _motion(entry: FilterEntry, extra: Extension | None, looked: _Looked) -> Dynamics:
    """Return the motion that a filter believes in, with the manoeuvres that it is told of, over the longer steps."""
    config = looked.config
    orbit, step_s = nominal_chief(config.truth), config.clock.step_s
    options = entry.dynamics.simpler
    if "training_track" in options.needs:
        options = dynamics_kinds()["cw"].model_validate({"kind": "cw"})
    context = DynamicsContext(orbit, entry.process_noise, step_s, epoch=config.truth.start_epoch)
    motion = build_dynamics(options, context)
    if config.truth.manoeuvres and known_thrust(entry, config) != "none":
        pushed = KnownThrust(motion, orbit, step_s)
        pushed.take(planned_forces(config.truth, looked.times_s, step_s), 0)
        motion = pushed
    return motion if extra is None else extra.dynamics(motion, orbit, step_s)


def _followed(motion: Dynamics, looked: _Looked, behind: int) -> tuple[Array, Array]:
    """Return the states (K + 1, n) that a model reaches from the true start, and its transitions (K, n, n)."""
    n = 6 + behind
    states, transitions = np.zeros((len(looked.times_s), n)), np.zeros((len(looked.times_s) - 1, n, n))
    states[0, :6] = looked.start
    for k in range(1, len(states)):
        before, step = states[k - 1 : k], Step(k, looked.config.clock.step_s)
        transitions[k - 1] = np.reshape(motion.transition(before, step), (n, n))
        states[k] = motion.propagate(before, step)[0]
    return states, transitions


def _prior(looked: _Looked, extra: Extension | None) -> Array | None:
    """Return the covariance (n, n) at the start; None where there is no first fix to start from."""
    start, fix = looked.config.start, None
    if isinstance(start, FirstFixStart):
        name = fix_sensor(looked.config)
        if not looked.fix[name].all():
            return None
        state = looked.start[None, None]
        sensor = SensorInformation(name, looked.config, state, mixture=False)
        fix = sensor.at(state, looked.fix[name], np.zeros(1, dtype=np.int64), extra)[0]
    P = start_covariance(start, fix, extra)
    separation = np.linalg.norm(looked.start[:3])
    turned = nominal_chief(looked.config.truth).mean_motion_rad_s * separation
    least = np.square(LEAST_SIGMA * np.repeat([separation, turned], 3))
    P[:6, :6] += np.diag(np.maximum(least - np.diag(P)[:6], 0.0))
    return P if np.isfinite(P).all() else None
