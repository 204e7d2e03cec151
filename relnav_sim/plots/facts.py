"""What a report needs to know of a case: per-run figures of every filter, in the axes of the report.

Tables, summary and figures all start here, so that each of them counts failed runs, chooses the span and
names the axes in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import MATTERS_PERCENT
from relnav_sim.plots.axes import Axes
from relnav_sim.plots.commands import run_command
from relnav_sim.plots.filter_facts import FilterFacts, filter_facts
from relnav_sim.plots.manoeuvres import manoeuvre_times
from relnav_sim.plots.run_figures import Span, headline_span
from relnav_sim.plots.sensor_times import Windows, own_outages
from relnav_sim.results.block import ResultsError
from relnav_sim.results.settings import case_setting
from relnav_sim.statistics.convergence_seen import seen_until_s

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_ONLY_CASE = "base"


@dataclass(frozen=True)
class FailedRun:
    """A run that failed: when, and why in words."""

    run: int
    filter: str
    epoch: int
    reason: str


@dataclass(frozen=True)
class CaseFacts:
    """One case.

    Attributes:
        index: Its number, from 0.
        label: What it varies, in words.
        axes: The axes of every figure.
        times_s: Stored epochs (K,), s; empty where no run has been computed.
        settle_s: Start of the span ``settled``, s.
        convergence_m: A run has converged once its position error stays below this, m ...
        hold_s: ... for this long, s.
        convergence_until_s: The latest time at which a run of this length can be seen to converge, s; NaN where the
            result does not say.
        planned_runs: Runs that the campaign asked for.
        filters: The filters that have runs.
        waiting: Names of the filters that have none yet.
        all_filters: Names of the filters of all cases, which set the colours.
        failures: The failed runs.
        command: What reads the campaign as it was: ``relnav run FILE`` with its changes.
        own_outages: Fixed outages of sensors of their host's own state, by name; no filter takes their measurements.
        manoeuvres_s: When manoeuvres begin, s; empty where the file's are damaged.
        step_s: Time between epochs, s; NaN where the result does not say.
        matters_percent: Differences in position RMS below this do not matter, percent.
    """

    index: int
    label: str
    axes: Axes
    times_s: Array
    settle_s: float
    convergence_m: float
    hold_s: float
    convergence_until_s: float
    planned_runs: int
    filters: tuple[FilterFacts, ...]
    waiting: tuple[str, ...]
    all_filters: tuple[str, ...]
    failures: tuple[FailedRun, ...]
    command: str
    own_outages: Mapping[str, Windows] = field(default_factory=dict)
    manoeuvres_s: tuple[float, ...] = ()
    step_s: float = np.nan
    matters_percent: float = MATTERS_PERCENT

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors of its filters, as far as the result tells them apart."""
        return tuple(dict.fromkeys(name for item in self.filters for name in item.sensors))

    @property
    def dimension(self) -> int | None:
        """How many channels every update of every filter had; None where that varies, or there was no update."""
        found = set().union(*(item.dimensions() for item in self.filters))
        return found.pop() if len(found) == 1 and 0 not in found else None

    @property
    def mixes_dimensions(self) -> bool:
        """Whether updates had different numbers of channels, so that only the NIS per degree of freedom compares."""
        return self.dimension is None and any(item.dimensions() for item in self.filters)

    def trace_command(self, run: int) -> str:
        """Return the command that computes one run of the case again and stores every step."""
        return f"{self.command} --only {self.index}:{run} --trace"

    @property
    def span(self) -> Span:
        """The span that headline figures are taken over: settled, unless nothing lies after settling."""
        return headline_span(self.filters)

    @property
    def shows_convergence(self) -> bool:
        """Whether a run is long enough to converge at all."""
        return not self.convergence_until_s <= 0

    @property
    def converged_at_once(self) -> bool:
        """Whether every run of every filter had converged by the first epoch, so that times say nothing."""
        times = [item.convergence_s[item.ok] for item in self.filters]
        return bool(times) and all(bool((each <= self.step_s * (1 + 1e-9)).all()) for each in times)

    @property
    def not_judged(self) -> str:
        """Why convergence cannot be judged, where a run is too short for it."""
        return f"Convergence cannot be judged: it is to last {self.hold_s:g} s, and no run is longer than that."

    @property
    def by_accuracy(self) -> tuple[FilterFacts, ...]:
        """The filters with a completed run, the smallest position RMS first; last those that are known only later."""
        span = self.span
        held = [(bool(item.known_when), item.mean_rms(span), item) for item in self.filters if item.completed]
        # A mean over runs of a diverged filter can overflow; such a filter goes last, not first.
        return tuple(item for *_, item in sorted(held, key=lambda each: (each[0], not np.isfinite(each[1]), each[1])))

    @property
    def when(self) -> str:
        """The headline span in words."""
        return f"t ≥ {self.settle_s:g} s" if self.span == "settled" else "all epochs"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the filters that have runs."""
        return tuple(item.name for item in self.filters)

    def filter(self, name: str) -> FilterFacts:
        """Return the facts of one filter.

        Raises:
            KeyError: It has no run in this case.
        """
        for item in self.filters:
            if item.name == name:
                return item
        raise KeyError(f"filter {name!r} has no run in case {self.label!r}; there are {', '.join(self.names)}")


def case_facts(results: Results, case: int | str | CaseFacts, axes: Axes = "rtn") -> CaseFacts:
    """Return what a report needs to know of a case.

    Args:
        results: An opened result.
        case: Its number from 0, its label or its id; facts already read are returned as they are.
        axes: The axes of the report.
    """
    if isinstance(case, CaseFacts):
        return case
    index = results.case_index(case)
    header = results.headers[index]
    held = [name for name in header.filters if len(results.case_runs(index, name))]
    label = header.label
    if results.nominal == (index,) and label == _ONLY_CASE:
        label = "all runs"
    settle_s = float(case_setting(results, index, "statistics.settle_s", 0.0))
    times_s = results.time_s(index) if held else np.empty(0)
    return CaseFacts(
        index=index,
        label=label,
        axes=axes,
        times_s=times_s,
        settle_s=settle_s,
        convergence_m=float(case_setting(results, index, "statistics.convergence_m", np.nan)),
        hold_s=float(case_setting(results, index, "statistics.convergence_hold_s", np.nan)),
        convergence_until_s=seen_until_s(results, index),
        planned_runs=results.planned_runs,
        filters=tuple(filter_facts(results, index, name, axes, times_s >= settle_s) for name in held),
        waiting=tuple(name for name in header.filters if name not in held),
        all_filters=results.filters,
        failures=tuple(
            FailedRun(failure.run, failure.filter, failure.epoch, failure.reason)
            for _, failure in results.failures(index)
        ),
        command=run_command(results) + (" --stress" if header.stress else ""),
        own_outages=_own_outages(results, index),
        manoeuvres_s=_manoeuvres(results, index, times_s),
        step_s=float(case_setting(results, index, "clock.step_s", np.nan)),
        matters_percent=float(case_setting(results, index, "statistics.matters_percent", MATTERS_PERCENT)),
    )


def _manoeuvres(results: Results, index: int, times_s: Array) -> tuple[float, ...]:
    with suppress(ResultsError):  # the figure about them says so
        return tuple(manoeuvre_times(results, index, times_s)) if len(times_s) else ()
    return ()


def _own_outages(results: Results, index: int) -> Mapping[str, Windows]:
    with suppress(TypeError, ValueError):  # damaged: no reason to have no report
        return own_outages(results, index)
    return {}
