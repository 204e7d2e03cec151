"""A campaign's filter with all that it is fed: measurements, thrust and the chief's fixes, chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar, cast

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.context import FedDynamics
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.fitted_start import fitted_start
from relnav_sim.filters.out_of_sequence import OutOfSequence
from relnav_sim.filters.passes import with_unfit
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.rewinding import RewindableSource
from relnav_sim.filters.run import FilterHistory, advance
from relnav_sim.sensors import relative_sensors
from relnav_sim.sensors.arrivals import most_epochs_late
from relnav_sim.simulation.afterwards import lag_epochs
from relnav_sim.simulation.augmented_states import extension_of
from relnav_sim.simulation.campaign_filter import create_campaign_filter, sensor_forms
from relnav_sim.simulation.chunks import Chunk, in_time, told
from relnav_sim.simulation.dynamics_inputs import SharedByDynamics, arrival, dynamics_context
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.restart import FixRestart
from relnav_sim.simulation.thrust_inputs import ThrustInputs, known_thrust
from relnav_sim.streams import RandomSource

T = TypeVar("T", Array, Integers)
_FED = frozenset({"chief_fixes", "known_thrust"})


@dataclass(frozen=True)
class Shared:
    """What the filters of a block share.

    Attributes:
        thrust: What they are told of thrust.
        by_dynamics: What their dynamics compute once for all of them.
        learned: What their dynamics have learned.
    """

    thrust: ThrustInputs
    by_dynamics: SharedByDynamics
    learned: Learned

    @classmethod
    def fresh(cls, config: CaseConfig, learned: Learned) -> Shared:
        """Return what is shared before any chunk has come."""
        return cls(ThrustInputs(config), SharedByDynamics(config), learned)


class FedFilter:
    """A filter of a campaign, made anew and fed from the first chunk on.

    Args:
        entry: Its settings.
        config: The case.
        source: Seed and numbers of the runs.
        shared: What the filters of the block share.
        late: Sensors whose measurements come with a latency of their own.

    Attributes:
        filter: The filter; another one with the same models may take its place.
        extension: Its augmented states; None without any.
    """

    def __init__(
        self, entry: FilterEntry, config: CaseConfig, source: RandomSource, shared: Shared, late: Collection[str]
    ) -> None:
        self._entry, self._config, self._source = entry, config, source
        self._known = known_thrust(entry, config)
        self._carries_bias = any(extra.kind == "accelerometer_bias" for extra in entry.augment)
        self._thrust_inputs = shared.thrust
        self._shared = shared.by_dynamics.by(entry)
        self._forms = sensor_forms(entry, config)
        self._context = dynamics_context(entry, config, source.seed, shared.learned, len(source.runs), self._shared)
        depth = buffered_epochs(entry, config)
        self._restart: FixRestart | None = None
        if entry.editing is not None and entry.editing.action == "restart":
            self._restart = FixRestart(entry, config, extension_of(entry, config))
        made = create_campaign_filter(entry, config, self._context, late, depth > 0, self._restart)
        self.filter, self._dynamics, self._thrust = made.filter, made.dynamics, made.thrust
        self.extension, self._rewindable = made.extension, made.rewindable
        self._buffer: OutOfSequence | None = None
        if depth:
            self._source = again = RewindableSource(source.seed, source.runs)
            self._buffer = OutOfSequence(self.filter, again, depth, config.clock.step_s)
        self._latest = latest_epochs(entry, config)

    def start(self, prior: Gaussian) -> Any:
        """Return the filter's belief before its first measurement."""
        return self.filter.start(prior, self._source)

    @property
    def shared_cpu_s(self) -> float:
        """CPU time spent on what its dynamics share with others, s."""
        return self._shared.cpu_s

    def advance(
        self,
        belief: Any,
        chunk: Chunk,
        start: Gaussian,
        reached: Callable[[int], None] = lambda epoch: None,
        with_residuals: bool = False,
    ) -> tuple[Any, FilterHistory]:
        """Return the belief at the end of the next chunk, and the history over it.

        Args:
            belief: One epoch before the chunk; at epoch 0 before the first of them, which is the start itself: its
                measurement belongs to that.
            chunk: What arrives.
            start: What is known at epoch 0.
            reached: Told of every epoch that begins.
            with_residuals: As in `filters.run.advance`.
        """
        self._feed(chunk)
        z, first, step_s = told(chunk, self._forms, self._config), chunk.first_epoch, self._config.clock.step_s
        if self._buffer is None and self._latest is not None:
            z = in_time(z, chunk.delays, self._latest)
        if first > 0:
            if self._buffer is not None:
                return self._buffer.advance(belief, z, chunk.delays, first, reached)
            return advance(self.filter, belief, z, first, step_s, reached, with_residuals)
        means, covariances = start.mean[:, None], start.covariance[:, None]
        fitted = 1
        reasons: Mapping[int, str] = {}
        if self._entry.batch_start is not None:
            fitted += round(self._entry.batch_start.duration_s / step_s)
            fit = fitted_start(self.filter, _epochs(z, slice(1, fitted)), start, self._source, step_s)
            means, covariances, reasons = fit.mean, fit.covariance, fit.unfit
            belief = self.filter.start(fit.end, self._source)
        z, delays = _epochs(z, slice(fitted, None)), _epochs(chunk.delays, slice(fitted, None))
        if self._buffer is not None:
            belief, history = self._buffer.advance(belief, z, delays, fitted, reached)
        else:
            belief, history = advance(self.filter, belief, z, fitted, step_s, reached, with_residuals)
        history = history.after(means, covariances)
        return belief, with_unfit(history, reasons, 0) if reasons else history

    def _feed(self, chunk: Chunk) -> None:
        """Tell the dynamics what is known of the next chunk; those that are to go back keep what they were told."""
        if self._rewindable is not None and (self._thrust is not None or self._entry.dynamics.needs & _FED):
            self._rewindable.keep(chunk.first_epoch)
        forces = None
        if self._thrust is not None:
            forces, noise = self._thrust_inputs.of(chunk, self._known, self._carries_bias)
            self._thrust.take(forces, chunk.first_epoch, noise)
        if (arrived := arrival(self._entry, self._context, chunk, forces)) is not None:
            cast(FedDynamics, self._dynamics).feed(arrived)  # they have it: `build_dynamics` looks at that
        if self._restart is not None:
            self._restart.take(chunk)


def buffered_epochs(entry: FilterEntry, config: CaseConfig) -> int:
    """Return the most epochs after its own that a measurement arrives and is gone back for; 0: it does not go back."""
    sensors = relative_sensors(config.sensors, entry.sensors).values()
    drawn = [each.drawn_latency_s for each in sensors if each.drawn_latency_s is not None]
    if entry.out_of_sequence != "buffer" or not drawn:
        return 0
    return max(most_epochs_late(limits, config.clock.step_s) for limits in drawn)


def latest_epochs(entry: FilterEntry, config: CaseConfig) -> int | None:
    """Return the most epochs after its own at which a measurement arrives and a filter still takes it in order.

    None: afterwards all have arrived. With a fixed lag an epoch's estimate is made when the lag is over: what arrives
    later than that, as under a stress of which the filter is not told, is not in it.
    """
    if filter_kinds()[entry.kind].repeats:
        return None
    return 0 if entry.smoother is None else lag_epochs(entry.smoother, config.clock.step_s)


def _epochs(series: Mapping[str, T], epochs: slice) -> dict[str, T]:
    return {name: values[:, epochs] for name, values in series.items()}
