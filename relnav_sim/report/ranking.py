"""Which filter of a case is best, and can the others be told apart from it?

The headline figure is the RMS over time of the position error of each run. Filters of a campaign share their
random numbers, so they are compared run by run: the interval of the mean difference decides, not whether
two intervals overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.report.axes import Array
from relnav_sim.report.facts import CaseFacts, FilterFacts
from relnav_sim.statistics.intervals import Comparison, Interval, bootstrap_interval, paired_difference


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
    """The filters of one case with a completed run, best first; empty where there is none."""

    case: CaseFacts
    standings: tuple[Standing, ...]

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
    sizes = {item.name: _completed(item, case, "r") for item in case.filters if item.completed}
    position = {name: bootstrap_interval(values) for name, values in sizes.items()}
    # A mean over runs of a diverged filter can overflow; such a filter goes last, not first.
    order = sorted(position, key=lambda name: (not np.isfinite(position[name].estimate), position[name].estimate))
    standings = []
    for place, name in enumerate(order):
        facts = case.filter(name)
        comparison, percent = None, Interval(np.nan, np.nan, np.nan, 0.95, 0)
        if place:
            comparison, percent = _against(facts, case.filter(order[0]), case)
        velocity = bootstrap_interval(_completed(facts, case, "v"))
        standings.append(Standing(facts, position[name], velocity, comparison, percent))
    return Ranking(case, tuple(standings))


def _completed(item: FilterFacts, case: CaseFacts, component: str) -> Array:
    return np.where(item.ok, item.errors("rms", case.span, component), np.nan)


def _against(item: FilterFacts, best: FilterFacts, case: CaseFacts) -> tuple[Comparison | None, Interval]:
    _, here, there = np.intersect1d(item.runs, best.runs, return_indices=True)
    first, second = _completed(item, case, "r")[here], _completed(best, case, "r")[there]
    both = np.isfinite(first) & np.isfinite(second)
    if not both.any():
        return None, Interval(np.nan, np.nan, np.nan, 0.95, 0)
    comparison = paired_difference(first[both], second[both])
    found, reference = comparison.difference, second[both].mean() / 100
    percent = Interval(
        found.estimate / reference, found.low / reference, found.high / reference, found.level, found.runs
    )
    return comparison, percent
