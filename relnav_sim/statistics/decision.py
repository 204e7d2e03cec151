"""Which filter to fly? A rule over what the runs say of each filter of each case.

1. A filter is refused whose sensors cannot observe the state, whose estimates are known only later, that completed no
   run, failed or diverged in a run (in more than a requirement allows, where there is one), misses a requirement, or
   whose errors are more than `OVERCONFIDENT` times its formal sigma: those of the whole state, or those of position or
   velocity where these are surely too large.
2. Of the others those that meet every requirement beyond doubt are preferred; where there are none, all the others.
   A requirement that a filter was not asked to meet is undecided for it.
3. Of these the filter with the smallest position RMS is chosen. The difference of each other one is "equivalent" where
   it is surely smaller than the margin, else as the ranking's test has it (`equivalence`).
4. Over several cases a filter must not be refused in any. Of those left the one is chosen whose largest position RMS
   above the smallest of the same case is least (minimax regret over cases, Savage 1951).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from relnav_sim.results import layout
from relnav_sim.statistics.consistency_verdict import farthest
from relnav_sim.statistics.equivalence import Difference, Effect
from relnav_sim.statistics.findings import Verdict
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval

OVERCONFIDENT = 1.5
"""Errors this many times the formal sigma, root of the ANEES, are too many for a filter to be recommended."""

_WHOLE = layout.BLOCKS[0]

Reason = Literal["not observable", "known later", "no run", "failed", "diverged", "requirement", "overconfident"]
_FIRST = ("not observable", "known later", "no run", "failed", "diverged", "requirement", "overconfident")


@dataclass(frozen=True)
class Refusal:
    """Why a filter is not recommended: ``what`` names the requirement, ``count`` the runs concerned."""

    reason: Reason
    what: str = ""
    count: int = 0


@dataclass(frozen=True)
class Candidate:
    """What is known of one filter in one case.

    Attributes:
        name: The filter.
        position: Position RMS, mean over the completed runs, m.
        velocity: Velocity RMS, m/s.
        runs: Number of computed runs.
        failed: How many of them failed.
        diverged: How many diverged without failing.
        errors_over_sigma: Root of the ANEES, the errors in units of the formal sigma, of each part of the state, by the
            names of `layout.BLOCKS`; NaN where it is not known.
        overconfident: The parts whose covariance is surely too small, by however little (`overconfident_parts`).
        verdicts: On each requirement that is about the filter, by name.
        not_asked: Requirements that are about other filters only: as undecided as one that no run has judged.
        limited: The losses that a requirement limits, ``failed`` and ``diverged``: then its verdict says enough.
        observable: Whether its sensors can observe the state.
        known_when: When its estimates are known, in words; empty: in flight.
    """

    name: str
    position: Interval
    velocity: Interval = NO_INTERVAL
    runs: int = 0
    failed: int = 0
    diverged: int = 0
    errors_over_sigma: Mapping[str, Interval] = field(default_factory=dict)
    overconfident: tuple[str, ...] = ()
    verdicts: Mapping[str, Verdict] = field(default_factory=dict)
    not_asked: tuple[str, ...] = ()
    limited: frozenset[str] = frozenset()
    observable: bool = True
    known_when: str = ""

    @property
    def meets_all(self) -> bool:
        """Whether it meets every requirement beyond doubt."""
        return not self.not_asked and all(verdict == "pass" for verdict in self.verdicts.values())

    @property
    def too_overconfident(self) -> tuple[str, ...]:
        """The parts of the state whose errors are too many formal sigmas for it to be recommended."""
        return tuple(
            part
            for part, one in self.errors_over_sigma.items()
            if one.estimate > OVERCONFIDENT and (part == _WHOLE or part in self.overconfident)
        )

    @property
    def most_overconfident(self) -> str:
        """The part of the state whose errors speak most against its covariance; the whole state where none does."""
        parts = self.too_overconfident or self.overconfident or (_WHOLE,)
        return farthest({part: self.error_over_sigma(part).estimate for part in parts})

    def error_over_sigma(self, part: str) -> Interval:
        """Return the errors of a part of the state in units of the formal sigma; NaN where they are not known."""
        return self.errors_over_sigma.get(part, NO_INTERVAL)


@dataclass(frozen=True)
class CaseEvidence:
    """What a decision on one case goes by.

    Attributes:
        index: Number of the case, from 0.
        candidates: Its filters.
        differences: By how much the first of two filters has the larger position RMS, by their names; each pair once.
    """

    index: int
    candidates: tuple[Candidate, ...]
    differences: Mapping[tuple[str, str], Difference]

    def of(self, name: str) -> Candidate | None:
        """Return a filter's candidate, None where the case has not got it."""
        return next((item for item in self.candidates if item.name == name), None)

    def difference(self, first: str, second: str) -> Difference | None:
        """Return by how much the first has the larger RMS, None where they have no run in common."""
        if (first, second) in self.differences:
            return self.differences[first, second]
        found = self.differences.get((second, first))
        return None if found is None else found.turned()


@dataclass(frozen=True)
class Choice:
    """What is decided, for one case or for all.

    Attributes:
        chosen: The filter to fly; None: none can be recommended.
        meets_all: Whether it meets every requirement beyond doubt.
        effects: How each other acceptable filter compares with it, the smallest RMS first.
        set_aside: Acceptable filters that are not compared, because a requirement is undecided for them, or was not
            asked of them, and others meet all.
        refusals: Why each other filter is refused.
        most_accurate: The filter with the smallest RMS of all that can be flown, refused ones included.
    """

    chosen: str | None
    meets_all: bool
    effects: Mapping[str, Effect]
    set_aside: tuple[str, ...]
    refusals: Mapping[str, tuple[Refusal, ...]]
    most_accurate: str | None

    def with_effect(self, *effects: Effect) -> tuple[str, ...]:
        """Return the filters that compare so with the chosen one."""
        return tuple(name for name, effect in self.effects.items() if effect in effects)


@dataclass(frozen=True)
class Decision:
    """The decision on all cases together and on each.

    Attributes:
        overall: On all of them.
        cases: On each, with what it goes by.
        worst: Of each filter that is acceptable in all cases the case (its number from 0) in which its RMS lies
            farthest above the smallest of such a filter, and by how many percent.
        margin_percent: The equivalence margin.
    """

    overall: Choice
    cases: tuple[tuple[CaseEvidence, Choice], ...]
    worst: Mapping[str, tuple[int, float]]
    margin_percent: float


def decide(evidence: Sequence[CaseEvidence], margin_percent: float) -> Decision:
    """Return which filter to fly.

    Args:
        evidence: The cases; at least one.
        margin_percent: Differences in position RMS below this do not matter, percent.

    Raises:
        ValueError: There is no case.
    """
    if not evidence:
        raise ValueError("a decision needs a case")
    cases = tuple((case, decide_case(case, margin_percent)) for case in evidence)
    names = list(dict.fromkeys(item.name for case in evidence for item in case.candidates))
    refusals = {name: refused for name in names if (refused := _everywhere(name, cases))}
    left = [name for name in names if name not in refusals]
    compared, set_aside, meets_all = _first_tier(left, evidence)
    worst = {name: _worst(name, compared, evidence) for name in compared}
    order = sorted(compared, key=lambda name: (worst[name][1], _mean_size(name, evidence)))
    best = order[0] if order else None
    effects = {name: _over_cases(name, best, evidence, margin_percent) for name in order[1:] if best is not None}
    accurate = {choice.most_accurate for _, choice in cases}
    overall = Choice(best, meets_all, effects, set_aside, refusals, accurate.pop() if len(accurate) == 1 else None)
    return Decision(overall, cases, worst, margin_percent)


def decide_case(case: CaseEvidence, margin_percent: float) -> Choice:
    """Return which filter to fly in one case."""
    refusals = {item.name: found for item in case.candidates if (found := refusals_of(item))}
    left = [item.name for item in case.candidates if item.name not in refusals]
    compared, set_aside, meets_all = _first_tier(left, [case])
    order = sorted(compared, key=lambda name: _size(name, case))
    best = order[0] if order else None
    effects = {name: _effect(name, best, case, margin_percent) for name in order[1:] if best is not None}
    flyable = [
        item.name
        for item in case.candidates
        if item.observable and not item.known_when and math.isfinite(item.position.estimate)
    ]
    accurate = min(flyable, key=lambda name: _size(name, case), default=None)
    return Choice(best, meets_all, effects, set_aside, refusals, accurate)


def refusals_of(item: Candidate) -> tuple[Refusal, ...]:
    """Return every reason not to recommend a filter."""
    if not item.observable:
        return (Refusal("not observable"),)
    if item.known_when:
        return (Refusal("known later", item.known_when),)
    found = []
    if item.failed and "failed" not in item.limited:
        found.append(Refusal("failed", count=item.failed))
    if item.diverged and "diverged" not in item.limited:
        found.append(Refusal("diverged", count=item.diverged))
    found += [Refusal("requirement", name) for name, verdict in item.verdicts.items() if verdict == "fail"]
    if item.too_overconfident:
        found.append(Refusal("overconfident"))
    if not found and not math.isfinite(item.position.estimate):
        found.append(Refusal("no run"))
    return tuple(found)


def _first_tier(names: Iterable[str], evidence: Sequence[CaseEvidence]) -> tuple[list[str], tuple[str, ...], bool]:
    """Return the filters that are compared, those set aside, and whether the compared ones meet all requirements."""
    left = list(names)
    sure = [name for name in left if all(_candidate(name, case).meets_all for case in evidence)]
    return (sure, tuple(name for name in left if name not in sure), True) if sure else (left, (), False)


def _everywhere(name: str, cases: Sequence[tuple[CaseEvidence, Choice]]) -> tuple[Refusal, ...]:
    """Return the reasons against a filter in any case; those of several cases once, with the runs added up."""
    counts: dict[tuple[Reason, str], int] = {}
    for case, choice in cases:
        found = choice.refusals.get(name, ()) if case.of(name) else (Refusal("no run"),)
        for refusal in found:
            key = refusal.reason, refusal.what
            counts[key] = counts.get(key, 0) + refusal.count
    found_first = sorted(counts, key=lambda each: _FIRST.index(each[0]))
    return tuple(Refusal(reason, what, counts[reason, what]) for reason, what in found_first)


def _worst(name: str, among: Sequence[str], evidence: Sequence[CaseEvidence]) -> tuple[int, float]:
    found = []
    for case in evidence:
        least = min(_size(other, case) for other in among)
        above = 100 * (_size(name, case) / least - 1) if least > 0 else 0.0
        found.append((case.index, above))
    return max(found, key=lambda each: each[1])


def _over_cases(name: str, best: str, evidence: Sequence[CaseEvidence], margin_percent: float) -> Effect:
    """Return how a filter compares with the chosen one over all cases; undecided if better here and worse there."""
    effects = {_effect(name, best, case, margin_percent) for case in evidence}
    if effects == {"equivalent"}:
        return "equivalent"
    if "worse" in effects and "better" not in effects:
        return "worse"
    return "better" if "better" in effects and "worse" not in effects else "undecided"


def _effect(name: str, best: str, case: CaseEvidence, margin_percent: float) -> Effect:
    found = case.difference(name, best)
    return "undecided" if found is None else found.effect(margin_percent)


def _candidate(name: str, case: CaseEvidence) -> Candidate:
    found = case.of(name)
    if found is None:
        raise ValueError(f"case {case.index} has no filter {name!r}")
    return found


def _size(name: str, case: CaseEvidence) -> float:
    return _candidate(name, case).position.estimate


def _mean_size(name: str, evidence: Sequence[CaseEvidence]) -> float:
    return sum(_size(name, case) for case in evidence)
