"""One block of runs of one case: simulate, filter, count. A pure function of the case, the seed and the runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign import Case
from relnav_sim.campaign.afterwards import tells_innovations
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.containment import Containment
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.run import FilterHistory
from relnav_sim.kernels.compiling import working_cpu_s
from relnav_sim.results.block import BlockResult, Failure, FilterResult
from relnav_sim.sensors import relative_sensors
from relnav_sim.simulation.afterwards import Afterwards, lag_epochs
from relnav_sim.simulation.augmented_states import AugmentedTrack, extended_prior
from relnav_sim.simulation.breakdown import Breakdown, breakdown
from relnav_sim.simulation.campaign_filter import filter_channels, sensor_forms
from relnav_sim.simulation.chunks import Chunk, chunks
from relnav_sim.simulation.fed_filter import FedFilter, Shared
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory
from relnav_sim.simulation.repeated import Repeated
from relnav_sim.simulation.start import starting_belief
from relnav_sim.statistics.channel_whiteness import ChannelWhiteness
from relnav_sim.statistics.consistency import normalised_errors
from relnav_sim.statistics.editing import EditingAccumulator
from relnav_sim.statistics.errors import ErrorAccumulator, ScoringRules
from relnav_sim.statistics.readings import NisOfSensors
from relnav_sim.streams import RandomSource

_NO_FIX = "no measurement at 0 s that gives a position, where the start is the first fix"


@dataclass(frozen=True)
class BlockOutcome:
    """What became of a block.

    Attributes:
        result: The results of the filters that ran through.
        broken: Why the others did not, by the filter's name.
    """

    result: BlockResult
    broken: dict[str, Breakdown]


def simulate_block(
    case: Case, seed: int, runs: Sequence[int], case_index: int = 0, learned: Learned | None = None
) -> BlockOutcome:
    """Return the results of some runs of one case.

    A filter that raises an exception is left behind; the others go on. Want of memory is no fault of the filter, and
    ends the block.

    Args:
        case: The case.
        seed: The campaign's seed.
        runs: Numbers of the runs, ascending.
        case_index: Number of the case in its campaign, passed on to the result.
        learned: What is learned already; it saves time and changes no bit. Default: nothing.
    """
    source = RandomSource(seed, tuple(runs))
    return filter_block(case, source, chunks(case.config, source), case_index, learned)


def filter_block(
    case: Case,
    source: RandomSource,
    arriving: Iterable[Chunk],
    case_index: int = 0,
    learned: Learned | None = None,
    prior: Gaussian | None = None,
    watch: Watch | None = None,
) -> BlockOutcome:
    """Return the results of the filters of a case on measurements, be they simulated or recorded.

    Args:
        case: The case.
        source: Seed and numbers of the runs.
        arriving: What arrives, a chunk of epochs after the other. Where the truth is not known the result holds no
            filter, as nothing can be scored.
        case_index: As in `simulate_block`.
        learned: As in `simulate_block`.
        prior: Where all filters start; None: where the case says.
        watch: Told of every chunk that a filter has filtered; None: nobody looks. Filters that are watched take down
            their residuals.
    """
    config, runs = case.config, source.runs
    tracks: list[FilterTrack] = []
    times: list[Array] = []
    relative: list[Array] = []
    for chunk in arriving:
        if not tracks:
            prior = prior or starting_belief(config, chunk, source)
            shared = Shared.fresh(config, learned or Learned())
            tracks = [
                FilterTrack(name, entry, config, prior, source, shared, frozenset(chunk.late), watch)
                for name, entry in config.filters.items()
            ]
        for track in tracks:
            track.add(chunk)
        stored = _stored(config, chunk)
        times.append(chunk.truth.times_s[stored])
        relative.append(chunk.truth.relative[:, stored])
    for track in tracks:
        track.finish()
    ended = dict(chunk.ended)
    is_dispersed = config.flown.truth.is_dispersed
    if not is_dispersed and ended:
        ended = dict.fromkeys(range(len(runs)), ended[0])
    assert prior is not None  # there is a chunk at least
    no_fix = np.flatnonzero(np.isnan(prior.mean).any(axis=1))
    reasons = ended | {int(place): _NO_FIX for place in no_fix}
    sound = [track for track in tracks if track.broken is None]
    result = BlockResult(
        case_index=case_index,
        case_id=case.id,
        runs=tuple(runs),
        time_s=np.concatenate(times),
        relative=np.concatenate(relative, axis=1),
        filters={track.name: track.result() for track in sound if chunk.truth_is_known},
        failures=tuple(failure for track in sound for failure in _explained(track.failures(runs), runs, reasons)),
        shared_truth=not is_dispersed,
    )
    return BlockOutcome(result, {track.name: track.broken for track in tracks if track.broken is not None})


class Watch(Protocol):
    """Looks at what filters make of each chunk."""

    def __call__(self, name: str, filter: Filter, chunk: Chunk, before: Array, history: FilterHistory) -> None:
        """Take a look.

        Args:
            name: The filter's name.
            filter: The filter, whose dynamics are still those of the chunk.
            chunk: What has arrived.
            before: Mean one epoch before the chunk, (runs, n); at epoch 0 that of the start.
            history: What it said at the chunk's epochs.
        """
        ...

    def afterwards(self, name: str, chunk: Chunk, history: FilterHistory) -> None:
        """Take a look at what a smoother has made of a chunk, once all of them have been filtered."""
        ...


class FilterTrack:
    """A filter on its way through a block: its belief and its statistics so far.

    Args:
        name: The filter's name in the campaign.
        entry: Its settings.
        config: The case.
        prior: Where it starts.
        source: Seed and numbers of the runs.
        shared: What the filters of the block share.
        late: Sensors whose measurements come with a latency of their own.
        watch: Told of every chunk; None: nobody looks.

    Attributes:
        name: The filter's name in the campaign.
        broken: The exception that ended it; None while it goes on.
    """

    def __init__(
        self,
        name: str,
        entry: FilterEntry,
        config: CaseConfig,
        prior: Gaussian,
        source: RandomSource,
        shared: Shared,
        late: Collection[str] = (),
        watch: Watch | None = None,
    ) -> None:
        self.name = name
        self._watch = watch
        self.broken: Breakdown | None = None
        sensors = relative_sensors(config.sensors, entry.sensors).values()
        plugins = (filter_kinds()[entry.kind].factory, type(entry.dynamics), *map(type, sensors))
        packages = {plugin.__module__.partition(".")[0] for plugin in plugins}
        self._packages = packages - {"relnav_sim"} or packages
        self._epoch = 0
        self._prior = prior
        self._errors = ErrorAccumulator(len(source.runs), scoring_rules(config))
        self._augmented: AugmentedTrack | None = None
        self._afterwards: Afterwards | None = None
        self._repeated: Repeated | None = None
        self._editing: EditingAccumulator | None = None
        if entry.editing is not None:
            sensors_read = tuple(sensor_forms(entry, config))
            self._editing = EditingAccumulator(
                len(source.runs), self._errors.rules, sensors_read, entry.editing.max_rejects
            )
        self._whiteness: ChannelWhiteness | None = None
        if config.statistics.whiteness and tells_innovations(entry):
            channels = filter_channels(entry, config)
            names = tuple(f"{sensor} {channel.label}" for sensor, own in channels.items() for channel in own)
            self._whiteness = ChannelWhiteness(len(source.runs), names, self._errors.rules.settled_epoch)
        self._cpu_s = self._first_cpu_s = self._afterwards_cpu_s = 0.0
        self._steps = self._first_steps = 0
        with self._breaking_alone():
            self._fed = FedFilter(entry, config, source, shared, late)
            if entry.smoother is not None:
                self._afterwards = Afterwards(self._fed.filter, lag_epochs(entry.smoother, config.clock.step_s))
                self._fed.filter = self._afterwards.filter
            if filter_kinds()[entry.kind].repeats:
                self._repeated = Repeated(
                    lambda: FedFilter(entry, config, source, Shared.fresh(config, shared.learned), late)
                )
            if self._fed.extension is not None:
                self._prior = extended_prior(prior, self._fed.extension, config)
                self._augmented = AugmentedTrack(self._fed.extension, entry, config.flown, self._errors.rules, source)
            # A copy: the prior is what all filters start from, and this one's epoch 0.
            own = Gaussian(self._prior.mean.copy(), self._prior.covariance.copy())
            self._belief = self._fed.start(own)

    def add(self, chunk: Chunk) -> None:
        """Filter the next chunk of measurements and count its errors, unless the filter is broken.

        Where the truth is not known there is nothing to count.
        """
        if self.broken is not None:
            return
        with self._breaking_alone():
            if self._repeated is not None:
                self._repeated.add(chunk)
                return
            begin = working_cpu_s() - self._fed.shared_cpu_s
            before = np.asarray(self._belief.mean).copy() if self._watch is not None else None
            self._belief, history = self._fed.advance(
                self._belief, chunk, self._prior, self._reached, self._watch is not None or self._whiteness is not None
            )
            self._cpu_s += working_cpu_s() - self._fed.shared_cpu_s - begin - history.residuals_cpu_s
            self._steps += history.nis.size
            if not self._first_steps:
                self._first_cpu_s, self._first_steps = self._cpu_s, self._steps
            if self._afterwards is not None:
                self._afterwards.add(chunk, history)
            elif chunk.truth_is_known:
                self._score(chunk, history)
            if self._watch is not None and before is not None:
                self._watch(self.name, self._fed.filter, chunk, before, history)

    def finish(self) -> None:
        """Count the errors of a row whose estimates are known only once all of the run has been read."""
        if self.broken is not None:
            return
        with self._breaking_alone():
            begin = working_cpu_s()
            for chunk, history in self._known_afterwards():
                self._afterwards_cpu_s += working_cpu_s() - begin
                if chunk.truth_is_known:
                    self._score(chunk, history)
                begin = working_cpu_s()
        self._afterwards = self._repeated = None  # with what they have kept

    def _filtering_cpu_s(self) -> float:
        """Return the processor time of all steps, s; the first chunk at the cost of the others where they are as many.

        In it memory is touched for the first time: of filters alike, the first of a process took three times as long.
        """
        later = self._steps - self._first_steps
        if later < self._first_steps:
            return self._cpu_s + self._afterwards_cpu_s
        return (self._cpu_s - self._first_cpu_s) * self._steps / later + self._afterwards_cpu_s

    def _known_afterwards(self) -> Iterator[tuple[Chunk, FilterHistory]]:
        """Yield the chunks with estimates that the whole run has told, from the first on."""
        if self._afterwards is not None:
            for chunk, history in self._afterwards.smoothed():
                if self._watch is not None:
                    self._watch.afterwards(self.name, chunk, history)
                yield chunk, history
        if self._repeated is not None:
            before = self._prior.mean
            watched = self._watch is not None
            for fed, chunk, history in self._repeated.results(self._prior, self._reached, watched):
                self._steps += history.nis.size
                if self._watch is not None:
                    self._watch(self.name, fed.filter, chunk, before, history)
                before = history.mean[:, -1]
                yield chunk, history

    def _score(self, chunk: Chunk, history: FilterHistory) -> None:
        """Count the errors of a chunk."""
        error = history.mean[..., :6] - chunk.truth.relative
        covariance = history.covariance[..., :6, :6]
        if self._augmented is not None:
            # A run whose augmented states are lost has failed, though position may not show it until a measurement.
            error[~np.isfinite(history.mean[..., 6:]).all(axis=-1)] = np.nan
        self._errors.add(
            chunk.truth.times_s,
            error,
            covariance,
            history.nis,
            history.log_likelihood,
            history.extras,
            {failure.run: (failure.epoch, failure.reason) for failure in history.failures},
            NisOfSensors(history.nis_by, history.dof_by),
        )
        if self._augmented is not None:
            self._augmented.add(chunk, history, self._errors.failed_epoch)
        if self._editing is not None:
            nees, _, _ = normalised_errors(np.ascontiguousarray(error), covariance)
            self._editing.add(chunk.first_epoch, nees[0], history.edits_by, self._errors.failed_epoch)
        if self._whiteness is not None:
            residuals = np.concatenate([one.normalised for one in history.residuals_by.values()], axis=2)
            self._whiteness.add(chunk.first_epoch, residuals, self._errors.failed_epoch)

    @contextmanager
    def _breaking_alone(self) -> Iterator[None]:
        """Keep what a filter of the user's own may raise and undo what it changes: that must not end the campaign."""
        with Containment() as contained:
            yield
        if contained.error is not None:
            if lacks_memory(contained.error):
                raise contained.error
            self.broken = breakdown(contained.error, self._epoch, self._packages)

    def _reached(self, epoch: int) -> None:
        self._epoch = epoch

    def result(self) -> FilterResult:
        """Return the statistics and the stored series; a filter is charged all of what its dynamics share."""
        result = self._errors.result(1e6 * (self._filtering_cpu_s() + self._fed.shared_cpu_s) / self._steps)
        if self._augmented is not None:
            result = replace(result, augmented=self._augmented.result())
        if self._editing is not None:
            result = replace(result, editing=self._editing.result())
        return result if self._whiteness is None else replace(result, by_channel=self._whiteness.result())

    def failures(self, runs: Sequence[int]) -> tuple[Failure, ...]:
        """Return what failed, by run."""
        return self._errors.failures(self.name, runs)


def scoring_rules(config: CaseConfig) -> ScoringRules:
    """Return how a case's errors are turned into figures."""
    clock, statistics = config.clock, config.statistics
    return ScoringRules(
        step_s=clock.step_s,
        epochs=clock.epochs,
        store_every=clock.store_every,
        settle_s=statistics.settle_s,
        convergence_m=statistics.convergence_m,
        convergence_hold_s=statistics.convergence_hold_s,
        store_covariance=clock.store_covariance,
    )


def _explained(failures: Sequence[Failure], runs: Sequence[int], causes: Mapping[int, str]) -> list[Failure]:
    """Return failures with the true cause, by place in the block, where no filter is to blame."""
    reasons = {runs[place]: reason for place, reason in causes.items()}
    return [replace(failure, reason=reasons.get(failure.run, failure.reason)) for failure in failures]


def _stored(config: CaseConfig, chunk: Chunk) -> slice:
    """Return which epochs of the chunk are stored: every n-th of the run, from its start."""
    every = config.clock.store_every
    return slice(-chunk.first_epoch % every, None, every)
