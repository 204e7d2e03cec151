"""From what a result says of its cases to what the decision goes by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from relnav_sim.campaign.models import MATTERS_PERCENT
from relnav_sim.campaign.requirements import DivergedRequirement, FailedRequirement
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import Span, span_index
from relnav_sim.report.ranking import Ranking
from relnav_sim.results import layout
from relnav_sim.results.settings import case_setting
from relnav_sim.statistics.consistency_verdict import overconfident_parts
from relnav_sim.statistics.decision import Candidate, CaseEvidence, Decision, decide, refusals_of
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval, mean_interval
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
        tuple(_candidate(ranking, item, mine) for item in case.filters),
        {
            (pair.first, pair.second): Difference(pair.percent, pair.comparison.verdict, pair.simultaneous)
            for pair in ranking.position
        },
    )


def _candidate(ranking: Ranking, item: FilterFacts, of_all: Sequence[Judgement]) -> Candidate:
    """Return what is known of a filter, by what is judged of all filters of its case."""
    judged = [one for one in of_all if one.filter == item.name]
    verdicts = {one.name: one.verdict for one in judged}
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
        **_consistency(item, ranking.case.span),
        verdicts=verdicts,
        not_asked=tuple(dict.fromkeys(one.name for one in of_all if one.name not in verdicts)),
        limited=frozenset(limited),
        observable=item.observable,
        known_when=item.known_when if item.name in later else "",
    )


def _consistency(item: FilterFacts, span: Span) -> dict[str, Any]:
    """Return the errors of each part of the state in units of the formal sigma, and which are surely too large."""
    anees = item.per_run("anees", span_index(span))
    errors = {name: _root(mean_interval(of)) for name, of in zip(layout.BLOCKS, anees.T, strict=True)}
    return {"errors_over_sigma": errors, "overconfident": overconfident_parts(anees)}


def _root(one: Interval) -> Interval:
    low, estimate, high = (math.sqrt(max(value, 0.0)) for value in (one.low, one.estimate, one.high))
    return replace(one, low=low, estimate=estimate, high=high)
