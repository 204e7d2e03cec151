"""Which filter of a case is best, and do the others differ from it significantly?

The headline figure is the RMS over time of the position error of each run. Filters of a campaign share their
random numbers, so they are compared run by run: the interval of the mean difference decides, not whether
two intervals overlap.

All pairs of a case are one family of comparisons, adjusted for multiplicity: the best filter is chosen from the same
figures, so to compare only with it would count a lucky filter's luck against the others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.statistics.intervals import (
    NO_INTERVAL,
    Comparison,
    Interval,
    fewest_runs_to_decide,
    mean_interval,
    paired_differences,
)


@dataclass(frozen=True)
class Pair:
    """Two filters of a case on their common runs.

    Attributes:
        first: The filter with the larger mean.
        second: The other.
        comparison: First minus second; verdict, p-value and interval are adjusted for all pairs of the case.
        percent: The difference in percent of the second's mean on those runs.
        simultaneous: The same with an interval that holds for all pairs of the case together, decided or not.
    """

    first: str
    second: str
    comparison: Comparison
    percent: Interval
    simultaneous: Interval = NO_INTERVAL


@dataclass(frozen=True)
class Standing:
    """One filter in the order of its case.

    Attributes:
        facts: The filter.
        position: Position RMS, mean over its completed runs, m.
        velocity: Velocity RMS, mean over its completed runs, m/s.
        against_best: Its position RMS minus the best filter's on the same runs, m, as in the case's pairs; None for
            the best itself and where no run is common.
        percent: The same in percent of the best filter's mean on those runs; NaN likewise.
    """

    facts: FilterFacts
    position: Interval
    velocity: Interval
    against_best: Comparison | None
    percent: Interval

    @property
    def name(self) -> str:
        """The filter's name."""
        return self.facts.name

    @property
    def told_apart(self) -> bool:
        """Whether the filter is worse than the best beyond doubt at this number of runs."""
        return self.against_best is not None and self.against_best.verdict == "worse"


@dataclass(frozen=True)
class Ranking:
    """The filters of one case with a completed run, best first; empty where there is none.

    Attributes:
        case: The case.
        standings: The filters; last those that no comparison is made with: whose sensors can't observe the state, or
            whose estimates are known only later, where others are known in flight.
        position: All pairs that have runs in common, by the RMS of the position error, m.
        velocity: The same by the RMS of the velocity error, m/s; a family of its own.
    """

    case: CaseFacts
    standings: tuple[Standing, ...]
    position: tuple[Pair, ...] = ()
    velocity: tuple[Pair, ...] = ()

    @property
    def best(self) -> Standing:
        """The filter with the smallest position RMS."""
        return self.standings[0]

    @property
    def ranked(self) -> tuple[Standing, ...]:
        """The filters that are compared: whose sensors can observe the state, and that can be flown, if any can."""
        compared = _compared(self.case)
        return tuple(item for item in self.standings if item.name in compared)

    @property
    def known_later(self) -> tuple[Standing, ...]:
        """The filters that are not compared with those in flight, as their estimates are known only later."""
        ranked = {item.name for item in self.ranked}
        return tuple(i for i in self.standings if i.facts.observable and i.facts.known_when and i.name not in ranked)

    @property
    def undecided(self) -> tuple[Standing, ...]:
        """The filters without a significant difference from the best."""
        return tuple(item for item in self.ranked[1:] if not item.told_apart)

    @property
    def compared_runs(self) -> int:
        """The most runs that two of the filters have in common."""
        return max((pair.comparison.difference.runs for pair in self.position), default=0)

    @property
    def fewest_runs(self) -> int:
        """The number of runs below which no pair can be decided, however large its difference."""
        return fewest_runs_to_decide(len(self.position))

    @property
    def has_too_few_runs(self) -> bool:
        """Whether no pair can be decided, however large its difference."""
        return len(self.ranked) > 1 and self.compared_runs < self.fewest_runs

    def of(self, name: str) -> Standing | None:
        """Return a filter's standing, None where it has no completed run."""
        return next((item for item in self.standings if item.name == name), None)


def rank(case: CaseFacts) -> Ranking:
    """Return the filters of a case in the order of their position RMS over the headline span."""
    order = [item.name for item in case.by_accuracy]
    among = _compared(case)
    order.sort(key=lambda name: name not in among)
    compared = [name for name in order if name in among]
    pairs = {component: _pairs(case, compared, component) for component in ("r", "v")}
    against = {pair.first: pair for pair in pairs["r"] if pair.second == order[0]}
    standings = []
    for name in order:
        facts, pair = case.filter(name), against.get(name)
        position, velocity = (mean_interval(_completed(facts, case, component)) for component in ("r", "v"))
        comparison, percent = (pair.comparison, pair.percent) if pair else (None, NO_INTERVAL)
        standings.append(Standing(facts, position, velocity, comparison, percent))
    return Ranking(case, tuple(standings), pairs["r"], pairs["v"])


def _compared(case: CaseFacts) -> frozenset[str]:
    """Return the names of the filters that are compared with one another.

    A ranking of filters that can't observe the state would be one of their start, and one that knows later measurements
    would win over those that must do without them.
    """
    observable = [item for item in case.filters if item.observable]
    in_flight = [item for item in observable if not item.known_when]
    return frozenset(item.name for item in in_flight or observable)


def in_percent(difference: Interval, reference: float) -> Interval:
    """Return a difference in percent of a reference; NaN where that is 0."""
    reference = reference or math.nan
    return replace(
        difference,
        estimate=100 * difference.estimate / reference,
        low=100 * difference.low / reference,
        high=100 * difference.high / reference,
    )


def _pairs(case: CaseFacts, order: Sequence[str], component: str) -> tuple[Pair, ...]:
    """Return the pairs of a case, the later of the order first."""
    differences, references = {}, {}
    for second, first in itertools.combinations(order, 2):
        a, b = _on_common_runs(case.filter(first), case.filter(second), case, component)
        if len(a):
            differences[first, second], references[first, second] = a - b, float(b.mean())
    return tuple(
        Pair(
            *names,
            comparison,
            in_percent(comparison.difference, references[names]),
            in_percent(comparison.simultaneous, references[names]),
        )
        for names, comparison in paired_differences(differences).items()
    )


def _on_common_runs(one: FilterFacts, other: FilterFacts, case: CaseFacts, component: str) -> tuple[Array, Array]:
    _, here, there = np.intersect1d(one.runs, other.runs, return_indices=True)
    first, second = _completed(one, case, component)[here], _completed(other, case, component)[there]
    both = np.isfinite(first) & np.isfinite(second)
    return first[both], second[both]


def _completed(item: FilterFacts, case: CaseFacts, component: str) -> Array:
    return np.where(item.ok, item.errors("rms", case.span, component), np.nan)
