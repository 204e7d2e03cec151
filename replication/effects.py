"""From the runs' figures to the effects that the rules ask for, each with its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.intervals import Interval, bootstrap_interval, wilson_interval
from relnav_sim.statistics.verdicts import (
    Outcome,
    Verdict,
    difference_of_means,
    difference_of_rates,
    judged,
    mean_of_runs,
    ratio_of_means,
    ratio_of_medians,
    shared_level,
    together,
    verdict,
)
from replication import operations
from replication.measured import Measured
from replication.rules import Part, Reading, Rule


@dataclass(frozen=True)
class Effect:
    """A part of a rule in one reading: the figure with its interval, and whether it is in the rule's range."""

    part: Part
    interval: Interval
    outcome: Outcome


@dataclass(frozen=True)
class Evidence:
    """A reading of a rule with its effects; ``outcome`` is what they say together."""

    reading: Reading
    main: bool
    effects: tuple[Effect, ...]
    outcome: Outcome


@dataclass(frozen=True)
class Judgement:
    """A rule with its evidence and the verdict; readings whose campaign has not been run are in ``missing``."""

    rule: Rule
    evidence: tuple[Evidence, ...]
    verdict: Verdict
    missing: tuple[str, ...]

    @property
    def conditions(self) -> tuple[str, ...]:
        """The readings in which the claim holds, in words; empty unless the verdict is ``reproduced only if``."""
        if self.verdict != "reproduced only if":
            return ()
        return tuple(item.reading.words for item in self.evidence if item.outcome == "holds")

    @property
    def undecided(self) -> bool:
        """Whether the claim is not reproduced only for want of runs: some main reading is open and none fails."""
        main = [item.outcome for item in self.evidence if item.main]
        return self.verdict == "not reproduced" and "open" in main and "fails" not in main


def judge(rule: Rule, measured: Measured) -> Judgement:
    """Return the verdict on a claim.

    A reading that has not been run counts as undecided. The main readings are judged at 95 % each, because all must
    hold; the others share 5 % of error, because one is enough.
    """
    evidence, missing = [], []
    outcomes: dict[bool, list[Outcome]] = {True: [], False: []}
    for main, readings in ((True, rule.main), (False, rule.others)):
        level = CONFIDENCE if main else shared_level(len(readings))
        for reading in readings:
            if not _known(reading, measured):
                missing.append(reading.name)
                outcomes[main].append("open")
                continue
            item = _evidence(rule, reading, main, measured, level)
            outcomes[main].append(item.outcome)
            evidence.append(item)
    return Judgement(rule, tuple(evidence), verdict(outcomes[True], outcomes[False]), tuple(missing))


def _known(reading: Reading, measured: Measured) -> bool:
    return not reading.campaign or measured.has(reading.campaign, tuple(reading.filters.values()))


def _evidence(rule: Rule, reading: Reading, main: bool, measured: Measured, level: float) -> Evidence:
    effects = []
    for part in rule.parts:
        interval = effect(part, reading, measured, level)
        effects.append(Effect(part, interval, judged(interval, part.at_least, part.at_most)))
    return Evidence(reading, main, tuple(effects), together(item.outcome for item in effects))


def effect(part: Part, reading: Reading, measured: Measured, level: float = CONFIDENCE) -> Interval:
    """Return a part's figure with its interval, in the part's unit.

    Filters are compared on the runs that both have. A time to converge that a run never reached is infinite.
    """
    if part.kind == "operations":
        counted, other = (reading.filters.get(role, role) for role in (part.of[0], part.against[0]))
        ratio = operations.count(counted, reading.samples) / operations.count(other, reading.samples)
        return Interval(ratio, ratio, ratio, 1.0, 0)
    names = [reading.filters[role] for role in (*part.of, *part.against)]
    case = measured.case(reading.campaign, reading.case)
    runs = sorted(set.intersection(*(set(measured.runs(reading.campaign, case, name)) for name in names)))
    column = reading.columns.get(part.column, part.column)
    values = [measured.values(reading.campaign, case, name, column, runs) for name in names]
    match part.kind:
        case "reduction":
            return percent_below(ratio_of_means(values[0], values[1], level))
        case "difference":
            return difference_of_means(values[0], values[1], level)
        case "value":
            return mean_of_runs(values[0], level)
        case "median":
            return bootstrap_interval(_times(values[0]), "median", level, method="percentile")
        case "ratio of medians":
            return ratio_of_medians(_times(values[0]), _times(values[1]), level)
        case "share":
            return _share(values, part.within, level)
        case "margin":
            return _margin(values[: len(part.of)], values[len(part.of) :], level)


def percent_below(ratio: Interval) -> Interval:
    """Return 100 (1 - ratio)."""
    return Interval(100 * (1 - ratio.estimate), 100 * (1 - ratio.high), 100 * (1 - ratio.low), ratio.level, ratio.runs)


def _times(values: Array) -> Array:
    return np.where(np.isnan(values), math.inf, values)


def _share(values: list[Array], within: float, level: float) -> Interval:
    quick = [int(np.count_nonzero(item <= within)) for item in values]
    if len(values) == 1:
        return wilson_interval(quick[0], len(values[0]), level)
    return difference_of_rates(quick[0], quick[1], len(values[0]), level)


def _margin(inside: list[Array], outside: list[Array], level: float) -> Interval:
    """Return by how much, in percent, the best of the inner filters is below the best of the outer ones.

    The interval is the lowest of those against each outer filter: all of them must be beaten.
    """
    best = min(inside, key=lambda values: float(np.nanmean(values)))
    margins = [percent_below(ratio_of_means(best, values, level)) for values in outside]
    return min(margins, key=lambda margin: margin.low)
