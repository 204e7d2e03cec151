"""From the runs' figures to the effects that the rules ask for, each with its interval."""

from __future__ import annotations

import math
from collections.abc import Callable
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
    fiellers_ratio,
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
from replication.rules import Interpretation, Part, Rule
from replication.tuning_seeds import pooled


@dataclass(frozen=True)
class Effect:
    """A part of a rule in one interpretation: the figure with its interval, and whether it is in the rule's range."""

    part: Part
    interval: Interval
    outcome: Outcome


@dataclass(frozen=True)
class Evidence:
    """An interpretation of a rule with its effects; ``outcome`` is what they say together, ``window`` their span."""

    interpretation: Interpretation
    main: bool
    effects: tuple[Effect, ...]
    outcome: Outcome
    window: str


@dataclass(frozen=True)
class Judgement:
    """A rule with its evidence and the verdict; interpretations that have not been run are in ``missing``."""

    rule: Rule
    evidence: tuple[Evidence, ...]
    verdict: Verdict
    missing: tuple[str, ...]

    @property
    def conditions(self) -> tuple[str, ...]:
        """The interpretations in which the claim holds, by family; empty unless ``reproduced only if``.

        One that only adds something to another of them is left out: that one covers it.
        """
        if self.verdict != "reproduced only if":
            return ()
        words = []
        for family in dict.fromkeys(item.interpretation.family or item.interpretation.words for item in self.evidence):
            of_it = [i for i in self.evidence if family in (i.interpretation.family, i.interpretation.words)]
            holding = sum(item.outcome == "holds" for item in of_it)
            if holding:
                words.append(family if holding == len(of_it) else f"{family} ({holding} of {len(of_it)} settings)")
        return tuple(each for each in words if not any(each.endswith(f", {wider}") for wider in words))

    @property
    def undecided(self) -> bool:
        """Whether the claim is not reproduced only for want of runs: some main interpretation is open, none fails."""
        main = [item.outcome for item in self.evidence if item.main]
        return self.verdict == "not reproduced" and "open" in main and "fails" not in main


def judge(rule: Rule, measured: Measured) -> Judgement:
    """Return the verdict on a claim.

    An interpretation that has not been run counts as undecided. The main ones are judged at 95 % each, because all
    must hold; the others share 5 % of error, because one is enough.
    """
    evidence, missing = [], []
    outcomes: dict[bool, list[Outcome]] = {True: [], False: []}
    for main, interpretations in ((True, rule.main), (False, rule.others)):
        level = CONFIDENCE if main else shared_level(len(interpretations))
        for interpretation in interpretations:
            if not _known(interpretation, measured):
                missing.append(interpretation.name)
                outcomes[main].append("open")
                continue
            item = _evidence(rule, interpretation, main, measured, level)
            outcomes[main].append(item.outcome)
            evidence.append(item)
    return Judgement(rule, tuple(evidence), verdict(outcomes[True], outcomes[False]), tuple(missing))


def _known(interpretation: Interpretation, measured: Measured) -> bool:
    named = tuple(interpretation.filters.values())
    return not interpretation.campaign or measured.has(interpretation.campaign, named)


def _cases(interpretation: Interpretation, measured: Measured) -> tuple[int, ...]:
    return interpretation.repeats or (measured.case(interpretation.campaign, interpretation.case),)


def _evidence(rule: Rule, interpretation: Interpretation, main: bool, measured: Measured, level: float) -> Evidence:
    effects = []
    for part in rule.parts:
        interval = effect(part, interpretation, measured, level)
        effects.append(Effect(part, interval, judged(interval, part.at_least, part.at_most)))
    window = rule.window or "counted"
    if interpretation.campaign and not rule.window:
        columns = {interpretation.columns.get(part.column, part.column) for part in rule.parts}
        whole = not all(column.startswith(("settled", "outliers", "diagnostic", "wave")) for column in columns)
        window = measured.window(interpretation.campaign, _cases(interpretation, measured)[0], whole)
    return Evidence(interpretation, main, tuple(effects), together(item.outcome for item in effects), window)


def effect(part: Part, interpretation: Interpretation, measured: Measured, level: float = CONFIDENCE) -> Interval:
    """Return a part's figure with its interval, in the part's unit.

    Filters are compared on the same runs. A time to converge that a run never reached is infinite. Where an
    interpretation is repeated over tuning seeds, the interval holds the variance over them too.
    """
    if part.kind == "operations":
        counted, other = (interpretation.filters.get(role, role) for role in (part.of[0], part.against[0]))
        ratio = operations.count(counted, interpretation.samples) / operations.count(other, interpretation.samples)
        return Interval(ratio, ratio, ratio, 1.0, 0)
    names = [interpretation.filters[role] for role in (*part.of, *part.against)]
    column = interpretation.columns.get(part.column, part.column)
    found = [
        _KINDS[part.kind]([measured.values(interpretation.campaign, case, name, column) for name in names], part, level)
        for case in _cases(interpretation, measured)
    ]
    return found[0] if len(found) == 1 else pooled(found)


def percent_below(ratio: Interval) -> Interval:
    """Return 100 (1 - ratio)."""
    return Interval(100 * (1 - ratio.estimate), 100 * (1 - ratio.high), 100 * (1 - ratio.low), ratio.level, ratio.runs)


def _times(values: Array) -> Array:
    return np.where(np.isnan(values), math.inf, values)


def _share(values: list[Array], part: Part, level: float) -> Interval:
    quick = [int(np.count_nonzero(item <= part.within)) for item in values]
    if len(values) == 1:
        return wilson_interval(quick[0], len(values[0]), level)
    return difference_of_rates(quick[0], quick[1], len(values[0]), level)


def _margin(values: list[Array], part: Part, level: float) -> Interval:
    """Return by how much, in percent, the best of the inner filters is below the best of the outer ones.

    The interval is the lowest of those against each outer filter: all of them must be beaten. It is Fieller's, as the
    best of them may have next to nothing. A margin to one with nothing at all is not known, which counts unless another
    one without a lower end is surely below some size.
    """
    inside, outside = values[: len(part.of)], values[len(part.of) :]
    best = min(inside, key=lambda item: float(np.nanmean(item)))
    margins = [percent_below(fiellers_ratio(best, item, level)) for item in outside]
    unknown = (-math.inf, math.inf)
    return min(margins, key=lambda margin: unknown if math.isnan(margin.low) else (margin.low, margin.high))


def _distance(values: list[Array], part: Part, level: float) -> Interval:
    """Return how many standard deviations of single runs the printed number is above their mean.

    The deviation holds the rounding of the printed number, a uniform law. The interval is that of a standardised mean
    difference to first order, variance 1/n + d^2 / (2 n) (Hedges and Olkin 1985, section 5.B).
    """
    sample = values[0][~np.isnan(values[0])]
    n = len(sample)
    if n < 2:
        return Interval(math.nan, math.nan, math.nan, level, n)
    spread = math.hypot(float(sample.std(ddof=1)), part.rounding / math.sqrt(12))
    distance = (part.printed - float(sample.mean())) / spread
    half = _normal(level) * math.sqrt(1 / n + distance**2 / (2 * n))
    return Interval(distance, distance - half, distance + half, level, n)


def _normal(level: float) -> float:
    from scipy.special import ndtri

    return float(ndtri((1 + level) / 2))


_KINDS: dict[str, Callable[[list[Array], Part, float], Interval]] = {
    "reduction": lambda values, part, level: percent_below(ratio_of_means(values[0], values[1], level)),
    "difference": lambda values, part, level: difference_of_means(values[0], values[1], level),
    "value": lambda values, part, level: mean_of_runs(values[0], level),
    "median": lambda values, part, level: bootstrap_interval(_times(values[0]), "median", level, method="percentile"),
    "ratio of medians": lambda values, part, level: ratio_of_medians(_times(values[0]), _times(values[1]), level),
    "share": _share,
    "margin": _margin,
    "distance": _distance,
}
