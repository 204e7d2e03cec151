"""A case's filters on recorded measurements: what they said, and what tells whether they may be believed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign import Case
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, DispersedStart, FirstFixStart, GivenStart, exact
from relnav_sim.campaign.problems import listed
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.filters.channel_residuals import ChannelResiduals
from relnav_sim.filters.history import FilterHistory
from relnav_sim.filters.recorded_flow import RecordedFlow, joined_flow, recorded_flow
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.smoother import smooth
from relnav_sim.measurements.partial import all_channels, sensors_of
from relnav_sim.recorded.readings import Readings
from relnav_sim.results import layout
from relnav_sim.sensors import readings_layout, relative_sensors
from relnav_sim.sensors.campaign_sensors import reading_names
from relnav_sim.simulation.augmented_states import extension_of
from relnav_sim.simulation.block import filter_block
from relnav_sim.simulation.campaign_filter import filter_channels
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.own_readings import ReplayError
from relnav_sim.simulation.recorded_chunks import last_epoch, on_clock, recorded_chunks
from relnav_sim.simulation.replayed import ReplayedBlock, ReplayedFilter
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

HELD_WARNED = 0.1
"""Sigmas of a measurement by which velocities held constant may put it off, root mean square, without a word."""
HELD_REFUSED = 1.0
"""The same without a refusal."""


def replay_block(
    case: Case,
    seed: int,
    recorded: Sequence[Readings],
    with_truth: bool,
    epochs: int | None = None,
    errors_are_known: bool = True,
) -> ReplayedBlock:
    """Return what the filters of a case make of recorded measurements.

    The measurements take the place of those that `simulate_block` simulates, and nothing else differs: replayed, the
    measurements of a campaign give the campaign's own estimates to the bit.

    Args:
        case: The case.
        seed: The campaign's seed, of which and of the run's number the random numbers of sampling filters are a
            function.
        recorded: The measurements, a run each, by ascending number.
        with_truth: Whether the truth of the campaign is that of the measurements, so that estimates can be scored.
        epochs: Number of epochs that are replayed; None: as many as the measurements ask for, see `last_epoch`.
        errors_are_known: Whether the sensors' errors are those that the campaign draws, so that augmented states can be
            scored too.

    Raises:
        ReplayError: The measurements do not fit the case.
    """
    source = RandomSource(seed, tuple(one.run for one in recorded))
    for one in recorded:
        _check_sensors(case.config, one)
    duration_s = case.config.clock.duration_s
    epochs = last_epoch(case.config, recorded) + 1 if epochs is None else epochs
    readings = on_clock(case.config, recorded, epochs)
    config = shortened(case.config, epochs)
    prior = _prior(config, recorded, readings.z, with_truth)
    trajectory = truth_trajectory(config.truth, duration_s, source) if with_truth else None
    watch = _Collector(config.clock.step_s, nominal_chief(config.truth).mean_motion_rad_s)
    short = Case(case.id, case.label, case.variables, config)
    arriving = watch.counting(recorded_chunks(config, source, readings, trajectory, errors_are_known))
    outcome = filter_block(short, source, arriving, prior=prior, watch=watch)
    held = list(_held_velocities(watch.held, config))
    return ReplayedBlock(
        times_s=config.clock.step_s * np.arange(epochs, dtype=np.float64),
        config=config,
        filters={
            name: watch.replayed(name, entry, config)
            for name, entry in config.filters.items()
            if name not in outcome.broken
        },
        broken=outcome.broken,
        results=(outcome.result,) if with_truth else (),
        longest_late_s=readings.longest_late_s,
        warnings=(
            *_other_starts(config, prior),
            *_never_settled(config),
            *_lost_readings(watch.read, watch.lost),
            *held,
        ),
    )


class _Collector:
    """Keeps what every filter says, and how its dynamics moved its estimates."""

    def __init__(self, step_s: float, mean_motion_rad_s: float) -> None:
        self._step_s = step_s
        self._n = mean_motion_rad_s
        self._histories: dict[str, list[FilterHistory]] = {}
        self._flows: dict[str, list[RecordedFlow]] = {}
        self._smoothed: dict[str, list[FilterHistory]] = {}
        self.read: dict[str, int] = {}
        self.lost: dict[str, int] = {}
        self.held: dict[str, list[Array]] = {}

    def counting(self, arriving: Iterable[Chunk]) -> Iterator[Chunk]:
        """Yield the chunks, and count the measurements that no filter gets, for want of its host's own frame."""
        for chunk in arriving:
            for name, forms in chunk.inputs.items():
                read = np.isfinite(chunk.z[name]).any(axis=2)
                given = np.any([np.isfinite(z).all(axis=2) for z in forms.values()], axis=0)
                whole = np.isfinite(chunk.z[name]).all(axis=2)
                self.read[name] = self.read.get(name, 0) + int(read.sum())
                self.lost[name] = self.lost.get(name, 0) + int((whole & ~given).sum())
            yield chunk

    def __call__(self, name: str, filter: Filter, chunk: Chunk, before: Array, history: FilterHistory) -> None:
        """Take down a chunk of one filter."""
        self._histories.setdefault(name, []).append(history)
        means, first_epoch = history.mean[:, :-1], chunk.first_epoch + 1
        if chunk.first_epoch:
            means, first_epoch = np.concatenate([before[:, None], means], axis=1), chunk.first_epoch
        self._flows.setdefault(name, []).append(recorded_flow(filter.dynamics, means, first_epoch, self._step_s))
        if chunk.late:
            self._take_down_held(filter, chunk, history)

    def afterwards(self, name: str, chunk: Chunk, history: FilterHistory) -> None:
        """Take down what a smoother has made of a chunk."""
        self._smoothed.setdefault(name, []).append(history)

    def _take_down_held(self, filter: Filter, chunk: Chunk, history: FilterHistory) -> None:
        """Take down by how many sigmas late measurements are off because velocities are held constant meanwhile.

        The position some time t ago is taken as r - v t; a t^2 / 2 is left out, with the relative acceleration a that
        Clohessy and Wiltshire's equations have at the estimate.
        """
        measurement = all_channels(filter.measurement)
        for sensor in sensors_of(filter.measurement):
            late_s = chunk.late.get(sensor.name)
            if late_s is None:
                continue
            sigma = history.residuals_by[sensor.name].sigma
            for k in np.flatnonzero((late_s > 0).any(axis=0)):
                mean = np.ascontiguousarray(history.mean[:, k])
                moved = mean.copy()
                moved[:, :3] += 0.5 * late_s[:, k, None] ** 2 * _relative_acceleration(mean, self._n)
                epoch = chunk.first_epoch + int(k)
                shift = measurement.residual(measurement.predict(moved, epoch), measurement.predict(mean, epoch))
                off = np.abs(shift[:, sensor.channels]) / sigma[:, k]
                self.held.setdefault(sensor.name, []).append(off[np.isfinite(off)])

    def replayed(self, name: str, entry: FilterEntry, config: CaseConfig) -> ReplayedFilter:
        """Return everything that a filter has said."""
        parts = self._histories[name]

        def joined(series: Sequence[Array]) -> Array:
            return np.concatenate(series, axis=1)

        mean, covariance = joined([part.mean for part in parts]), joined([part.covariance for part in parts])
        changed = np.full(mean.shape, np.nan)
        # What has been fitted to all measurements is not changed by later ones.
        if not filter_kinds()[entry.kind].repeats:
            changed = _smoothed_change(mean, covariance, joined_flow(self._flows[name]), self._step_s)
        if name in self._smoothed:
            mean, covariance = (
                joined([getattr(part, each) for part in self._smoothed[name]]) for each in ("mean", "covariance")
            )
        nis = [part.believed_nis_by for part in parts]
        sensors = list(nis[0])
        extension = extension_of(entry, config)
        return ReplayedFilter(
            channels=filter_channels(entry, config),
            names=(*layout.COMPONENTS, *(() if extension is None else extension.names)),
            mean=mean,
            sigma=np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)),
            nis={sensor: joined([each[sensor] for each in nis]) for sensor in sensors},
            dof={sensor: np.concatenate([part.dof_by[sensor] for part in parts], axis=1) for sensor in sensors},
            residuals={
                sensor: ChannelResiduals(
                    joined([part.residuals_by[sensor].residual for part in parts]),
                    joined([part.residuals_by[sensor].sigma for part in parts]),
                    np.concatenate([part.residuals_by[sensor].rejected for part in parts], axis=1),
                )
                for sensor in sensors
            },
            smoothed_change=changed,
            failures=tuple(failure for part in parts for failure in part.failures),
        )


def _relative_acceleration(states: Array, n: float) -> Array:
    """Return the relative acceleration (runs, 3) at states (runs, ...), RTN, by Clohessy and Wiltshire (1960)."""
    x, _, z, vx, vy, _ = states[:, :6].T
    return np.stack([3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z], axis=1)


def _smoothed_change(mean: Array, covariance: Array, flow: RecordedFlow, step_s: float) -> Array:
    """Return by how much smoothing changes the estimates (runs, T, n), in sigmas of that change; NaN where it can't.

    The covariance of x_f - x_s is P_f - P_s where the filter is optimal (McReynolds' filter-smoother consistency test,
    in Wright, Optimal Orbit Determination, 2013).
    """
    nothing = np.empty(mean.shape[:2])
    smoothed = smooth(FilterHistory(mean, covariance, nothing, nothing, {}), flow, step_s)
    before, after = (np.diagonal(P, axis1=-2, axis2=-1) for P in (covariance, smoothed.covariance))
    gained = before - after
    with np.errstate(all="ignore"):
        # Less than that is rounding.
        return np.where(gained > 1e-9 * before, (mean - smoothed.mean) / np.sqrt(gained), np.nan)


def _check_sensors(config: CaseConfig, recorded: Readings) -> None:
    """Refuse measurements of sensors that the campaign does not have, and a lack of those that it needs."""
    sensors = {reading: sensor for reading, (sensor, _) in reading_names(config.sensors).items()}
    for name, each in relative_sensors(config.sensors).items():
        if each.drawn_latency_s is not None:
            raise ReplayError(
                f"{name} draws a latency for each measurement, and files of measurements do not say when they arrived; "
                f"leave it out: --set sensors.{name}.drawn_latency_s=null"
            )
    names = readings_layout(config.sensors)
    if unknown := [name for name in recorded.sensors if name not in names]:
        known = listed(list(names), "and")
        raise ReplayError(f"there are measurements of {unknown[0]}, which the campaign does not have; it has {known}")
    for name in names:
        if name in recorded.sensors or name in relative_sensors(config.sensors):
            continue
        if name not in sensors:
            raise ReplayError(
                f"run {recorded.run} has no {name}, in whose frame measurements of directions are given where that "
                "craft has no receiver or no star tracker; give its states, or the sensors and their measurements"
            )
        sensor = sensors[name]
        raise ReplayError(
            f"run {recorded.run} has no measurements of {name}, by which a craft knows its own "
            f"{config.sensors[sensor].role}; give their file, or leave the sensor out: --set sensors.{sensor}=null"
        )
    for name, entry in config.filters.items():
        own = list(relative_sensors(config.sensors, entry.sensors))
        if not any(sensor in recorded.sensors for sensor in own):
            raise ReplayError(
                f"run {recorded.run} has no measurements of {listed(own, 'or')}, by which the filter {name} goes; "
                "give their file, or choose other filters with --filter"
            )


def _prior(
    config: CaseConfig, recorded: Sequence[Readings], z: Mapping[str, Array], with_truth: bool
) -> Gaussian | None:
    """Return where all filters start; None: where the campaign says."""
    starts = [one.start for one in recorded if one.start is not None]
    if len(starts) == len(recorded):
        return Gaussian(
            np.stack([start.mean for start in starts]).astype(float),
            np.stack([start.covariance for start in starts]).astype(float),
        )
    if starts:
        raise ReplayError("some files say where the filters start and others do not; give runs of one kind")
    if isinstance(config.start, DispersedStart) and not with_truth:
        raise ReplayError(
            "the campaign starts its filters at the truth plus an error (start: dispersed), and the truth is not "
            "known; give it start: {kind: given, ...}, or kind: first_fix"
        )
    if isinstance(config.start, FirstFixStart):
        name = fix_sensor(config)
        missing = np.flatnonzero(~np.isfinite(z[name][:, 0, :3]).all(axis=1))
        if len(missing):
            raise ReplayError(
                f"run {recorded[missing[0]].run} has no whole measurement of {name} at 0 s, at which its filters start "
                "(start: first_fix); begin the campaign at such a measurement, or give it start: {kind: given, ...}"
            )
    return None


def _other_starts(config: CaseConfig, prior: Gaussian | None) -> Iterator[str]:
    """Yield a sentence where the files say otherwise than the campaign where the filters start."""
    if prior is None or not isinstance(config.start, GivenStart):
        return
    given = np.array([*config.start.position_m, *config.start.velocity_m_s])
    if (np.abs(prior.mean - given) > 1e-9 * np.abs(given).max()).any():
        yield "filters start where the files of measurements say, not at the campaign's start"


def _never_settled(config: CaseConfig) -> Iterator[str]:
    settle_s, end_s = config.statistics.settle_s, config.clock.duration_s
    if settle_s >= end_s:
        yield (
            f"nothing is settled: the replay ends at {end_s:g} s, statistics.settle_s is {settle_s:g} s; give a "
            "smaller one, or 0"
        )


def shortened(config: CaseConfig, epochs: int) -> CaseConfig:
    """Return the case with so many epochs."""
    if epochs == config.clock.epochs:
        return config
    duration_s = float(exact(config.clock.step_s) * (epochs - 1))
    return config.model_copy(update={"clock": config.clock.model_copy(update={"duration_s": duration_s})})


def _lost_readings(read: Mapping[str, int], lost: Mapping[str, int]) -> Iterator[str]:
    for name, count in lost.items():
        if count:
            yield (
                f"{count} of {read[name]} measurements of {name} are lost to the filters: their host does not know its "
                "own orbit or attitude then; where its receiver has gaps, give it a period_s or an outage, and its own "
                "orbit filter carries it over them"
            )


def _held_velocities(held: Mapping[str, Sequence[Array]], config: CaseConfig) -> Iterator[str]:
    """Yield a sentence on sensors whose late measurements suffer from velocities that are held constant.

    Raises:
        ReplayError: They suffer by more than their own sigma.
    """
    for name, parts in held.items():
        off = float(np.sqrt(np.mean(np.square(np.concatenate(parts)))))
        if off <= HELD_WARNED:
            continue
        step_s = config.clock.step_s * np.sqrt(HELD_WARNED / off)
        sentence = (
            f"measurements of {name} lie up to {config.clock.step_s:g} s before the epochs at which they count, and "
            f"velocities held constant meanwhile put them off by {off:.2g} sigma; choose a clock.step_s of "
            f"{step_s:.2g} or less"
        )
        if off > HELD_REFUSED:
            raise ReplayError(sentence)
        yield sentence
