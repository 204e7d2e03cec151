"""A filter's estimates improved afterwards: a smoother over all of a run, in the memory of a chunk of epochs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.afterwards_options import SmootherOption
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.filters.failed_runs import FailedRun
from relnav_sim.filters.fixed_interval import fixed_interval
from relnav_sim.filters.fixed_lag import Change, fixed_lag, to_next_border
from relnav_sim.filters.history import FilterHistory
from relnav_sim.filters.segments import Segment
from relnav_sim.filters.step_recorder import StepRecorder
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.spill import Reversed, Spill


def lag_epochs(smoother: SmootherOption, step_s: float) -> int | None:
    """Return how many epochs later a smoother's last measurement is; None: all measurements."""
    return None if smoother == "rts" else round(smoother.fixed_lag.lag_s / step_s)


@dataclass
class _Segments:
    """What the forward pass has left, a segment for each chunk."""

    spill: Spill[Segment] = field(default_factory=Spill)
    lengths: list[int] = field(default_factory=list)

    def append(self, segment: Segment) -> None:
        self.spill.append(segment)
        self.lengths.append(len(segment.mean))

    def __getitem__(self, place: int) -> Segment:
        return self.spill[place]


class Afterwards:
    """Goes through a run with a filter and back again with a smoother.

    Args:
        filter: The filter.
        lag: How many epochs later the last measurement is that an epoch gets; None: all measurements.

    Attributes:
        filter: The filter that is to go through the run.
    """

    def __init__(self, filter: Filter, lag: int | None) -> None:
        self.filter = StepRecorder(filter)
        self._lag = lag
        self._segments = _Segments()
        self._told: Spill[tuple[Chunk, FilterHistory]] = Spill()
        self._last: Gaussian | None = None
        self._failures: list[FailedRun] = []

    def add(self, chunk: Chunk, history: FilterHistory) -> None:
        """Take down the next chunk, as the filter has left it."""
        mean, covariance = history.mean, history.covariance
        before = self._last or Gaussian(mean[:, 0].copy(), covariance[:, 0].copy())
        self._segments.append(self.filter.segment(before, mean, covariance))
        self._last = Gaussian(mean[:, -1].copy(), covariance[:, -1].copy())
        self._failures += history.failures
        # Only what is scored against is kept of the chunk; the estimates are in the segment.
        nothing = np.empty(0)
        self._told.append(
            (
                replace(chunk, z={}, inputs={}, orbits={}, late={}),
                replace(history, mean=nothing, covariance=nothing, failures=()),
            )
        )

    def smoothed(self) -> Iterator[tuple[Chunk, FilterHistory]]:
        """Yield the chunks with the smoothed estimates, from the first on.

        Innovations, likelihoods and counts are those of the pass forward: there are no others. A run that fails on the
        way has no smoothed estimate of the epochs that its failure is part of: of all with a fixed interval, of those
        less than the lag before with a fixed lag.
        """
        failures = tuple(self._stated(failure) for failure in self._failures)
        for place, (mean, covariance) in enumerate(self._estimates()):
            chunk, history = self._told[place]
            last = chunk.first_epoch + len(mean)
            yield (
                chunk,
                replace(
                    history,
                    mean=mean.swapaxes(0, 1),
                    covariance=covariance.swapaxes(0, 1),
                    failures=tuple(one for one in failures if chunk.first_epoch <= one.epoch < last),
                ),
            )

    def _stated(self, failure: FailedRun) -> FailedRun:
        begin = 0 if self._lag is None else max(failure.epoch - self._lag, 0)
        reason = f"the pass forward failed at epoch {failure.epoch}: {failure.reason}"
        return replace(failure, epoch=begin, reason=reason)

    def _estimates(self) -> Iterator[tuple[Array, Array]]:
        """Yield means and covariances, epochs leading, from the first chunk on."""
        # A run that has failed turns to NaN in its own row.
        with np.errstate(all="ignore"):
            if self._lag is None:
                estimates: Spill[tuple[Array, Array]] = Spill()
                for estimate in fixed_interval(self._segments):
                    estimates.append(estimate)
                backwards = Reversed(estimates)
                yield from (backwards[place] for place in range(len(estimates)))
            else:
                changes: Spill[Change] = Spill()
                for change in to_next_border(self._segments, self._lag):
                    changes.append(change)
                yield from fixed_lag(self._segments, Reversed(changes), self._lag)
