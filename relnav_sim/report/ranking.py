"""Which filter of a case is best, and can the others be told apart from it?

The headline figure is the RMS over time of the position error of each run. Filters of a campaign share their
random numbers, so they are compared run by run: the interval of the mean difference decides, not whether
two intervals overlap.

All pairs of a case are one family of comparisons, guarded together by Holm's procedure: the best filter is chosen from
the same figures, so to compare only with it would count a lucky filter's luck against the others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from relnav_sim.report.axes import Array
from relnav_sim.report.facts import CaseFacts, FilterFacts
from relnav_sim.statistics.intervals import (
    Comparison,
    Interval,
    bootstrap_interval,
    paired_difference,
    runs_to_decide,
)
from relnav_sim.statistics.multiple import holm

LEVEL = 0.95
Key = TypeVar("Key", bound=Hashable)
_NOTHING = Interval(math.nan, math.nan, math.nan, LEVEL, 0)


@dataclass(frozen=True)
class Pair:
    """Two filters of a case on their common runs.

    Attributes:
        first: The filter with the larger mean.
        second: The other.
        comparison: First minus second; its verdict and its p-value are guarded for all pairs of the case.
        percent: The difference in percent of the second's mean on those runs.
    """

    first: str
    second: str
    comparison: Comparison
    percent: Interval


@dataclass(frozen=True)
class Standing:
    """One filter in the order of its case.

    Attributes:
        facts: The filter.
        position: Position RMS, mean over its completed runs, m.
        velocity: Velocity RMS, mean over its completed runs, m/s.
        against_best: Its position RMS minus the best filter's on the same runs, m; None for the best itself
            and where no run is common.
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
        standings: The filters.
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
    def undecided(self) -> tuple[Standing, ...]:
        """The filters that can't be told apart from the best."""
        return tuple(item for item in self.standings[1:] if not item.told_apart)

    def of(self, name: str) -> Standing | None:
        """Return a filter's standing, None where it has no completed run."""
        return next((item for item in self.standings if item.name == name), None)


def rank(case: CaseFacts) -> Ranking:
    """Return the filters of a case in the order of their position RMS over the headline span."""
    held = [item for item in case.filters if item.completed]
    position = {item.name: bootstrap_interval(_completed(item, case, "r")) for item in held}
    # A mean over runs of a diverged filter can overflow; such a filter goes last, not first.
    order = sorted(position, key=lambda name: (not np.isfinite(position[name].estimate), position[name].estimate))
    pairs = {component: _pairs(case, order, component) for component in ("r", "v")}
    against = {pair.first: pair for pair in pairs["r"] if pair.second == order[0]}
    standings = []
    for name in order:
        facts, pair = case.filter(name), against.get(name)
        velocity = bootstrap_interval(_completed(facts, case, "v"))
        comparison, percent = (pair.comparison, pair.percent) if pair else (None, _NOTHING)
        standings.append(Standing(facts, position[name], velocity, comparison, percent))
    return Ranking(case, tuple(standings), pairs["r"], pairs["v"])


def guarded(differences: Mapping[Key, Array]) -> dict[Key, Comparison]:
    """Return the comparisons of a family, each verdict and p-value guarded for all of them.

    An undecided pair is told how many runs would decide it at the level that the number of pairs asks for.

    Args:
        differences: First minus second on each common run, by whatever tells the comparisons apart.
    """
    found = {pair: paired_difference(values, np.zeros(len(values)), LEVEL) for pair, values in differences.items()}
    adjusted = holm([comparison.p_value for comparison in found.values()])
    level = 1 - (1 - LEVEL) / max(len(found), 1)
    kept = {}
    for (pair, comparison), p_value in zip(found.items(), adjusted, strict=True):
        decided = comparison.verdict if p_value <= 1 - LEVEL else "undecided"
        needed = runs_to_decide(differences[pair], level)
        kept[pair] = replace(comparison, verdict=decided, p_value=p_value, runs_to_decide=needed)
    return kept


def in_percent(difference: Interval, reference: float) -> Interval:
    """Return a difference in percent of a reference; NaN where that is 0."""
    reference = reference or math.nan
    return replace(
        difference,
        estimate=100 * difference.estimate / reference,
        low=100 * difference.low / reference,
        high=100 * difference.high / reference,
    )


def times_bound(size: Interval, bound: float) -> Interval:
    """Return an RMS in multiples of its bound; NaN where there is no bound."""
    return replace(size, estimate=size.estimate / bound, low=size.low / bound, high=size.high / bound)


def _pairs(case: CaseFacts, order: Sequence[str], component: str) -> tuple[Pair, ...]:
    """Return the pairs of a case, the later of the order first."""
    differences, references = {}, {}
    for second, first in itertools.combinations(order, 2):
        a, b = _on_common_runs(case.filter(first), case.filter(second), case, component)
        if len(a):
            differences[first, second], references[first, second] = a - b, float(b.mean())
    return tuple(
        Pair(first, second, comparison, in_percent(comparison.difference, references[first, second]))
        for (first, second), comparison in guarded(differences).items()
    )


def _on_common_runs(one: FilterFacts, other: FilterFacts, case: CaseFacts, component: str) -> tuple[Array, Array]:
    _, here, there = np.intersect1d(one.runs, other.runs, return_indices=True)
    first, second = _completed(one, case, component)[here], _completed(other, case, component)[there]
    both = np.isfinite(first) & np.isfinite(second)
    return first[both], second[both]


def _completed(item: FilterFacts, case: CaseFacts, component: str) -> Array:
    return np.where(item.ok, item.errors("rms", case.span, component), np.nan)
