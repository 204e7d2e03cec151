"""Chunks of recorded measurements: put on the clock of a campaign, and handed on as simulated ones are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.recorded.readings import Readings, SensorReadings
from relnav_sim.sensors import known_orbits, readings_layout, relative_sensors
from relnav_sim.simulation.chunks import Chunk, FrontEnd
from relnav_sim.simulation.own_readings import ReplayError, at_epochs
from relnav_sim.streams import RandomSource
from relnav_sim.truth import Trajectory, Truth

ON_EPOCH = 1e-6
"""Share of a step within which a measurement is one of the epoch itself; calendar dates are no more exact."""


@dataclass(frozen=True)
class ReadingsOnClock:
    """The measurements of some runs on the epochs of a campaign.

    Attributes:
        z: By the measurement's name, (runs, T, m); NaN where there is none.
        late: How long before its epoch each was taken, (runs, T), s; by the measurements that do not lie on the epochs.
    """

    z: Mapping[str, Array]
    late: Mapping[str, Array]

    @cached_property
    def longest_late_s(self) -> float:
        """The longest of these times, s."""
        return max((float(late.max()) for late in self.late.values()), default=0.0)


def on_clock(config: CaseConfig, recorded: Sequence[Readings], epochs: int) -> ReadingsOnClock:
    """Return recorded measurements on a campaign's first epochs.

    A measurement between two epochs counts at the next one, as one with a latency of its own. What a craft reads of its
    own orbit and attitude is carried on to the epoch.

    Args:
        config: The case.
        recorded: The measurements, a run each.
        epochs: Number T of epochs.

    Raises:
        ReplayError: A sensor has two measurements in a step, a measurement is before the start or after the last epoch,
            or an accelerometer's lies between the epochs.
    """
    z: dict[str, Array] = {}
    late: dict[str, Array] = {}
    relative = relative_sensors(config.sensors)
    for name, numbers in readings_layout(config.sensors).items():
        values = np.full((len(recorded), epochs, len(numbers)), np.nan)
        late_s = np.zeros(values.shape[:2])
        for row, one in enumerate(recorded):
            if name in one.sensors:
                places, own_late_s = _placed(name, one.sensors[name], config, epochs)
                values[row, places], late_s[row, places] = one.sensors[name].values, own_late_s
        z[name] = values
        if late_s.any():
            late[name] = late_s
    for name in [name for name in late if name not in relative]:
        z[name] = at_epochs(name, z, late.pop(name), config)
    return ReadingsOnClock(z, late)


def recorded_chunks(
    config: CaseConfig,
    source: RandomSource,
    readings: ReadingsOnClock,
    trajectory: Trajectory | None,
    errors_are_known: bool = True,
) -> Iterator[Chunk]:
    """Yield recorded measurements of a block, a chunk of epochs at a time, as `chunks` yields simulated ones.

    Args:
        config: The case, with the duration that is replayed.
        source: Seed and numbers of the runs.
        readings: The measurements of these runs.
        trajectory: The truth; None: it is not known, and the true states are NaN.
        errors_are_known: Whether the sensors' errors are those that the campaign draws.
    """
    clock = config.clock
    front_end = FrontEnd(config, len(source.runs))
    known = known_orbits(config.sensors)
    for first in range(0, clock.epochs, CHUNK_EPOCHS):
        epochs = np.arange(first, min(first + CHUNK_EPOCHS, clock.epochs))
        times_s = np.asarray(epochs * clock.step_s, dtype=np.float64)
        part = slice(first, first + len(epochs))
        z = {name: np.ascontiguousarray(each[:, part]) for name, each in readings.z.items()}
        truth = _unknown(times_s) if trajectory is None else trajectory.at(times_s)
        chunk = Chunk(
            first,
            truth,
            z,
            {},
            {} if trajectory is None else dict(trajectory.failures),
            late={name: late[:, part] for name, late in readings.late.items()},
            truth_is_known=trajectory is not None,
            errors_are_known=errors_are_known,
        )
        yield front_end.completed(chunk, replace(truth, **{craft: z[name] for craft, name in known.items()}))


def last_epoch(config: CaseConfig, recorded: Sequence[Readings]) -> int:
    """Return the number of the epoch at which a replay ends.

    That is the last of the campaign's clock, unless the measurements end earlier by more than the longest gap that is
    inside them: then it is that of the last measurement, as nobody asks for a prediction of hours.
    """
    step_s, last = config.clock.step_s, config.clock.epochs - 1
    times = np.unique(np.concatenate([np.zeros(1), *(one.times_s for run in recorded for one in run.sensors.values())]))
    gap_s = float(np.diff(times).max(initial=0.0))
    return last if last * step_s - times[-1] <= gap_s * (1 + 1e-9) else min(last, _epoch_of(times[-1:], step_s)[0])


def _epoch_of(times_s: Array, step_s: float) -> Integers:
    """Return at which epochs measurements count, (N,): the next one, where they are not at an epoch."""
    steps = times_s / step_s
    nearest = np.rint(steps)
    return np.where(np.abs(steps - nearest) <= ON_EPOCH, nearest, np.ceil(steps)).astype(np.int64)


def _placed(name: str, one: SensorReadings, config: CaseConfig, epochs: int) -> tuple[Integers, Array]:
    """Return the epochs (N,) of one sensor's measurements and how long before them they were taken, (N,), s."""
    step_s = config.clock.step_s
    if one.times_s[0] < -ON_EPOCH * step_s:
        raise ReplayError(
            f"{one.where(0)}: {name} reads at {one.times_s[0]:.9g} s, before the campaign's start at 0 s; "
            "leave earlier rows out, or begin the campaign earlier"
        )
    places = _epoch_of(one.times_s, step_s)
    if places[-1] >= epochs:
        row = int(np.argmax(places >= epochs))
        end_s = (epochs - 1) * step_s
        raise ReplayError(
            f"{one.where(row)}: {name} reads at {one.times_s[row]:.9g} s, after the campaign's end at {end_s:g} s; "
            f"give --set clock.duration_s={np.ceil(one.times_s[-1] / step_s) * step_s:g}, or leave later rows out"
        )
    twice = np.flatnonzero(np.diff(places) == 0)
    if len(twice):
        row = int(twice[0]) + 1
        raise ReplayError(
            f"{one.where(row)}: {name} reads at {one.times_s[row - 1]:.9g} s and at {one.times_s[row]:.9g} s, both in "
            f"the step that ends at {places[row] * step_s:g} s; choose a smaller clock.step_s, "
            f"{_step_for(np.diff(one.times_s).min(), step_s):g} say"
        )
    late_s = places * step_s - one.times_s
    return places, np.where(np.abs(late_s) <= ON_EPOCH * step_s, 0.0, late_s)


def _step_for(shortest_s: float, step_s: float) -> float:
    """Return the longest part of a campaign's own step in which no two measurements are."""
    return step_s / np.ceil(step_s / shortest_s * (1 - 1e-9))


def _unknown(times_s: Array) -> Truth:
    nothing = np.full((1, len(times_s), 6), np.nan)
    return Truth(times_s, nothing, nothing, nothing)
