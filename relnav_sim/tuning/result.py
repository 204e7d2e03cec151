"""What tuning found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.models import TuneOptions
from relnav_sim.campaign.problems import Path
from relnav_sim.statistics.intervals import Comparison, paired_difference
from relnav_sim.tuning.objective import Figures, Score
from relnav_sim.tuning.scalars import Scalar

EQUAL = 2e-3
"""Objectives that differ by less are equal for all that matters: 0.2 % of an error."""


@dataclass(frozen=True)
class Evaluation:
    """One candidate on the tuning runs.

    Attributes:
        round: Number of the round, from 0.
        values: The free numbers, in the order of the filter's scalars.
        figures: What its runs gave.
        score: The objective.
    """

    round: int
    values: tuple[float, ...]
    figures: Figures
    score: Score


@dataclass(frozen=True)
class Check:
    """Start and tuned filter on further runs, which the search has not seen.

    Attributes:
        start: Figures with the campaign's own numbers.
        tuned: Figures with the tuned ones.
        difference: Objective tuned less start, paired run by run; None where too few runs are sound in both.
    """

    start: Figures
    tuned: Figures
    difference: Comparison | None


@dataclass(frozen=True)
class FilterTuning:
    """What was tried for one filter and what was chosen.

    Attributes:
        name: The filter.
        scalars: Its free numbers.
        evaluations: In the order tried; the first has the campaign's own numbers.
        check: The held-out check; None without one.
    """

    name: str
    scalars: tuple[Scalar, ...]
    evaluations: tuple[Evaluation, ...]
    check: Check | None = None

    @property
    def start(self) -> Evaluation:
        """The campaign's own numbers."""
        return self.evaluations[0]

    @property
    def least(self) -> Evaluation:
        """The least objective, in the band where there is one; of equals the one tried first."""
        return min(self.evaluations, key=lambda tried: (not tried.score.feasible, tried.score.value))

    @property
    def best(self) -> Evaluation:
        """The chosen candidate: what the runs say nothing about stays as it is.

        Of the candidates within one standard error (of the paired difference over runs), or `EQUAL`, of the least
        objective those that change the fewest of the campaign's numbers (the rule of Breiman et al. 1984, section
        3.4.3); of these the one nearest to the start whose objective is the least of them to within `EQUAL`.
        """
        near = [tried for tried in self._as_feasible if _within_standard_error(tried, self.least)]
        fewest = min(map(self._changed, near))
        simple = [evaluation for evaluation in near if self._changed(evaluation) == fewest]
        enough = min(evaluation.score.value for evaluation in simple) + EQUAL
        return min((e for e in simple if e.score.value <= enough), key=self._distance)

    @property
    def _as_feasible(self) -> list[Evaluation]:
        """The candidates that keep to the band as well as the least does."""
        return [tried for tried in self.evaluations if tried.score.feasible >= self.least.score.feasible]

    def _changed(self, evaluation: Evaluation) -> int:
        return sum(a != b for a, b in zip(evaluation.values, self.start.values, strict=True))

    def _distance(self, evaluation: Evaluation) -> float:
        """Return how far a candidate is from the start, in units of the ranges."""
        pairs = zip(self.scalars, evaluation.values, self.start.values, strict=True)
        return max(abs(scalar.place(a) - scalar.place(b)) for scalar, a, b in pairs)

    @property
    def found(self) -> bool:
        """Whether any candidate got through all its runs."""
        return math.isfinite(self.least.score.value)

    def values(self) -> dict[Path, float]:
        """Return the tuned numbers by their paths below the filter's entry."""
        return {scalar.path: value for scalar, value in zip(self.scalars, self.best.values, strict=True)}

    def as_good(self) -> list[tuple[float, float]]:
        """Return the least and greatest value of each scalar that the runs cannot tell from the least objective."""
        near = [tried.values for tried in self._as_feasible if _undecided(tried, self.least)]
        return [(min(column), max(column)) for column in zip(*near, strict=True)]


@dataclass(frozen=True)
class Tuning:
    """What tuning found for every filter.

    Attributes:
        campaign: The campaign.
        options: How it was tuned.
        seed: Seed of the tuning runs.
        check_seed: Seed of the held-out check.
        lost: Runs that no candidate of any filter got through, by number; they count for none.
        filters: One result for each filter, by its name.
    """

    campaign: Campaign
    options: TuneOptions
    seed: int
    check_seed: int
    lost: tuple[int, ...]
    filters: Mapping[str, FilterTuning]

    def changes(self) -> dict[Path, float]:
        """Return the numbers that differ from the campaign's own, by their paths in the file."""
        return {
            ("filters", name, *scalar.path): value
            for name, tuning in self.filters.items()
            if tuning.found
            for scalar, value, before in zip(tuning.scalars, tuning.best.values, tuning.start.values, strict=True)
            if value != before
        }


def _within_standard_error(evaluation: Evaluation, least: Evaluation) -> bool:
    if not math.isfinite(evaluation.score.value):
        return evaluation is least
    differences = evaluation.score.per_run - least.score.per_run
    error = float(differences.std(ddof=1)) / math.sqrt(len(differences))
    return float(differences.mean()) <= max(error, EQUAL)


def _undecided(evaluation: Evaluation, least: Evaluation) -> bool:
    """Return whether the 95 % interval of the paired difference leaves open which is better."""
    if not math.isfinite(evaluation.score.value):
        return evaluation is least
    if evaluation.score.value - least.score.value <= EQUAL:
        return True
    return paired_difference(least.score.per_run, evaluation.score.per_run).verdict == "undecided"
