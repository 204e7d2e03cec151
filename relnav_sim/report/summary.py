"""The result in plain words, made from its figures: which filter, by how much, how sure, at what cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from relnav_sim.report.facts import FilterFacts, Span
from relnav_sim.report.ranking import Ranking, Standing
from relnav_sim.report.wording import between, counted, figure, listed
from relnav_sim.statistics.intervals import bootstrap_interval

_MOST_CASES_IN_WORDS = 6
_SIGMA_MARGIN = 0.05
"""A filter whose sigmas are right within 5 % is called consistent, however many runs could tell the difference."""


def summarise(rankings: Sequence[Ranking]) -> tuple[str, ...]:
    """Return sentences on a whole result, the one that matters most first."""
    computed = [ranking for ranking in rankings if ranking.standings]
    if not computed:
        return ("No run was completed: there is nothing to compare.", *_missing(rankings), *_failures(rankings))
    if len(computed) == 1:
        sentences = [verdict(computed[0])]
    else:
        sentences = [_across_cases(computed)]
        if len(computed) <= _MOST_CASES_IN_WORDS:
            sentences += [
                f"Case {ranking.case.number} ({ranking.case.label}): {verdict(ranking)}" for ranking in computed
            ]
    sentences += [*_consistency(computed), *_convergence(computed), *_cost(computed)]
    return (*sentences, *_missing(rankings), *_failures(rankings))


def verdict(ranking: Ranking) -> str:
    """Return which filter of a case has the smallest position error, by how much, and whether that is decided."""
    best, runs = ranking.best, ranking.best.position.runs
    size = f"{figure(best.position.estimate)} m{between(best.position.low, best.position.high)}"
    if len(ranking.standings) == 1:
        return f"{best.name}: position RMS {size}, velocity RMS {figure(best.velocity.estimate)} m/s over {counted(runs, 'run')}."
    if runs == 1:
        sizes = listed([f"{item.name} {figure(item.position.estimate)} m" for item in ranking.standings])
        return f"One run decides nothing. Its position RMS: {sizes}."
    told_apart = [item for item in ranking.standings[1:] if item.told_apart]
    behind = f"; {_behind(told_apart)}" if told_apart else ""
    if not ranking.undecided:
        return f"{best.name} has the smallest position error, RMS {size}{behind}."
    tied = [best, *ranking.undecided]
    sizes = listed([f"{item.name} {figure(item.position.estimate)} m" for item in tied])
    return f"{listed([item.name for item in tied])} can't be told apart in position error at {counted(runs, 'run')} (RMS {sizes}{_to_decide(ranking)}){behind}."


def _behind(standings: Sequence[Standing]) -> str:
    parts = []
    for item in standings:
        percent = item.percent
        if math.isfinite(percent.estimate) and percent.estimate < 300:
            parts.append(f"{item.name} is {figure(percent.estimate)} %{between(percent.low, percent.high)} worse")
        else:
            parts.append(f"{item.name} is {figure(1 + percent.estimate / 100)} times as large")
    return listed(parts)


def _to_decide(ranking: Ranking) -> str:
    comparison = ranking.undecided[0].against_best
    if len(ranking.undecided) > 1 or comparison is None or comparison.runs_to_decide is None:
        return ""
    difference = comparison.difference
    text = f"; paired difference {figure(difference.estimate)} m{between(difference.low, difference.high)}"
    needed = comparison.runs_to_decide
    return f"{text}, about {figure(needed)} runs would decide" if difference.runs < needed < 100_000 else text


def _across_cases(rankings: Sequence[Ranking]) -> str:
    alone: dict[str, int] = {}
    open_cases = 0
    for ranking in rankings:
        if len(ranking.standings) > 1 and (ranking.undecided or ranking.best.position.runs < 2):
            open_cases += 1
        else:
            alone[ranking.best.name] = alone.get(ranking.best.name, 0) + 1
    total = len(rankings)
    if all(len(ranking.standings) == 1 for ranking in rankings):
        sizes = [ranking.best.position.estimate for ranking in rankings]
        return f"{rankings[0].best.name}: position RMS between {figure(min(sizes))} and {figure(max(sizes))} m over {counted(total, 'case')}."
    parts = [
        f"{name} has the smallest position error in {_of_all(count, total)}{_margin(name, rankings)}"
        for name, count in sorted(alone.items(), key=lambda item: -item[1])
    ]
    if open_cases:
        parts.append(f"in {_of_all(open_cases, total)} the best filter can't be told apart from the next")
    text = "; ".join(parts)
    return f"{text if alone else text[:1].upper() + text[1:]}."


def _margin(name: str, rankings: Sequence[Ranking]) -> str:
    """Return by how much the next filter is worse where this one is best beyond doubt."""
    won = [ranking for ranking in rankings if ranking.best.name == name and not ranking.undecided]
    margins = [ranking.standings[1].percent.estimate for ranking in won if len(ranking.standings) > 1]
    if not margins or not np.isfinite(margins).all():
        return ""
    low, high = figure(min(margins)), figure(max(margins))
    return f" (the next is {low if low == high else f'{low} to {high}'} % worse)"


def _of_all(count: int, total: int) -> str:
    if count == total:
        return "both cases" if total == 2 else f"all {total} cases"
    return f"{count} of {total} cases"


def _consistency(rankings: Sequence[Ranking]) -> list[str]:
    """Return whether the filters' errors match their covariances: sqrt(ANEES) is how many times too small a sigma is."""
    consistent, wrong = [], []
    for name, sizes in _per_filter(rankings):
        intervals = [bootstrap_interval(item.consistency("anees", span)[item.ok]) for item, span in sizes]
        known = [found for found in intervals if math.isfinite(found.estimate) and found.estimate > 0]
        if not known:
            continue
        factors = [math.sqrt(found.estimate) for found in known]
        fits = [
            found.low <= 1 <= found.high or abs(factor - 1) <= _SIGMA_MARGIN
            for found, factor in zip(known, factors, strict=True)
        ]
        if all(fits):
            consistent.append(name)
        elif max(factors) < 1:
            wrong.append(
                f"{name} claims {_factor([1 / factor for factor in factors])} times larger errors than it makes"
            )
        else:
            wrong.append(f"{name} errs {_factor(factors)} times as much as it claims")
    parts = (
        [f"{listed(consistent)} {'is' if len(consistent) == 1 else 'are'} consistent (ANEES near 1)"]
        if consistent
        else []
    ) + wrong
    return [f"Consistency: {'; '.join(parts)}."] if parts else []


def _factor(factors: Sequence[float]) -> str:
    low, high = f"{min(factors):.3g}", f"{max(factors):.3g}"
    return low if low == high else f"{low} to {high}"


def _convergence(rankings: Sequence[Ranking]) -> list[str]:
    parts, never = [], []
    for name, sizes in _per_filter(rankings):
        times = np.concatenate([item.convergence_s[item.ok] for item, _ in sizes])
        missed = int(np.isnan(times).sum())
        if missed < times.size:
            parts.append(f"{name} {figure(float(np.nanmedian(times)))} s")
        if missed:
            never.append(f"{name} in {missed} of {counted(times.size, 'run')}")
    if not parts and not never:
        return []
    case = rankings[0].case
    text = (
        f"Median time to a position error below {case.convergence_m:g} m: {listed(parts)}"
        if parts
        else "No run converged"
    )
    return [text + (f"; never reached by {listed(never)}." if never and parts else ".")]


def _cost(rankings: Sequence[Ranking]) -> list[str]:
    costs = {
        name: float(np.mean(np.concatenate([item.cpu_us[item.ok] for item, _ in sizes])))
        for name, sizes in _per_filter(rankings)
    }
    known = sorted((cost, name) for name, cost in costs.items() if math.isfinite(cost) and cost > 0)
    if not known:
        return []
    least, cheapest = known[0]
    others = [f"{name} takes {figure(cost / least)} times that" for cost, name in known[1:]]
    text = f"Cost: {cheapest} {figure(least)} µs of CPU per filter step"
    return [f"{text}; {listed(others)}." if others else f"{text}."]


def _per_filter(rankings: Sequence[Ranking]) -> list[tuple[str, list[tuple[FilterFacts, Span]]]]:
    found: dict[str, list[tuple[FilterFacts, Span]]] = {}
    for ranking in rankings:
        for item in ranking.case.filters:
            if item.completed:
                found.setdefault(item.name, []).append((item, ranking.case.span))
    return list(found.items())


def _missing(rankings: Sequence[Ranking]) -> list[str]:
    waiting = sum(
        ranking.case.planned_runs * len(ranking.case.waiting)
        + sum(ranking.case.planned_runs - len(item.runs) for item in ranking.case.filters)
        for ranking in rankings
    )
    return (
        [f"The campaign is not finished: {counted(waiting, 'run')} of its filters still to come."]
        if waiting > 0
        else []
    )


def _failures(rankings: Sequence[Ranking]) -> list[str]:
    failed: dict[str, list[int]] = {}
    for ranking in rankings:
        for item in ranking.case.filters:
            counts = failed.setdefault(item.name, [0, 0])
            counts[0] += item.failed
            counts[1] += len(item.runs)
    parts = [f"{name} {count} of {total}" for name, (count, total) in failed.items() if count]
    return (
        [f"Failed runs, left out of every mean: {listed(parts)}. The tables of the cases give the reasons."]
        if parts
        else []
    )
