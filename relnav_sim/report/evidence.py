"""From what a result says of its cases to what the decision goes by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from relnav_sim.campaign.models import MATTERS_PERCENT
from relnav_sim.campaign.requirements import DivergedRequirement, FailedRequirement
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.report.metrics import ANEES
from relnav_sim.report.ranking import Ranking
from relnav_sim.results.settings import case_setting
from relnav_sim.statistics.decision import Candidate, CaseEvidence, Decision, decide, refusals_of
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval
from relnav_sim.statistics.requirements import Judgement

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def decided(results: Results, rankings: Sequence[Ranking], judged: Sequence[Judgement]) -> Decision | None:
    """Return which filter to fly; None where no case has a run.

    Args:
        results: An opened result.
        rankings: Its nominal cases.
        judged: Its requirements.
    """
    evidence = [_evidence(ranking, judged) for ranking in rankings if ranking.case.filters]
    return decide(evidence, matters_percent(results)) if evidence else None


def acceptable_first(ranking: Ranking) -> list[str]:
    """Return the ranked filters of a case, the smallest error first; behind them those to refuse, requirements apart.

    The error budget is of the first one: that of a filter which no one would fly, because it diverged or is
    overconfident, tells nothing of the chosen one's errors, however small its own are.
    """
    refused = {item.name for item in ranking.case.filters if refusals_of(_candidate(ranking, item, ()))}
    return sorted((standing.name for standing in ranking.standings), key=lambda name: name in refused)


def matters_percent(results: Results) -> float:
    """Return the equivalence margin of a result's campaign, percent; the default for results from before it."""
    return float(case_setting(results, 0, "statistics.matters_percent", MATTERS_PERCENT))


def _evidence(ranking: Ranking, judged: Sequence[Judgement]) -> CaseEvidence:
    case = ranking.case
    mine = [item for item in judged if item.case == case.index]
    return CaseEvidence(
        case.index,
        tuple(_candidate(ranking, item, [one for one in mine if one.filter == item.name]) for item in case.filters),
        {
            (pair.first, pair.second): Difference(pair.percent, pair.comparison.verdict, pair.simultaneous)
            for pair in ranking.position
        },
    )


def _candidate(ranking: Ranking, item: FilterFacts, judged: Sequence[Judgement]) -> Candidate:
    standing = ranking.of(item.name)
    later = {other.name for other in ranking.known_later}
    limited = {"failed" for one in judged if isinstance(one.requirement, FailedRequirement)}
    if any(isinstance(one.requirement, DivergedRequirement) for one in judged):
        limited |= {"failed", "diverged"}  # a failed run counts as diverged
    return Candidate(
        name=item.name,
        position=standing.position if standing else NO_INTERVAL,
        velocity=standing.velocity if standing else NO_INTERVAL,
        runs=len(item.runs),
        failed=item.failed,
        diverged=item.diverged_completed,
        error_over_sigma=_root(ANEES.value(item, ranking.case.span)),
        verdicts={one.name: one.verdict for one in judged},
        limited=frozenset(limited),
        observable=item.observable,
        known_when=item.known_when if item.name in later else "",
    )


def _root(one: Interval) -> Interval:
    low, estimate, high = (math.sqrt(max(value, 0.0)) for value in (one.low, one.estimate, one.high))
    return replace(one, low=low, estimate=estimate, high=high)
