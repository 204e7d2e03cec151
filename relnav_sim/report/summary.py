"""The result in plain words: which filter, by how much, how sure, at what cost, and which runs to look at."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from relnav_sim.campaign.warnings import together
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import Span
from relnav_sim.report.consistency import consistency_in_words, consistency_verdict, size_range
from relnav_sim.report.cost import cost_in_words
from relnav_sim.report.layouts import WORST_RUNS
from relnav_sim.report.metrics import diverged_note
from relnav_sim.report.ranking import Ranking, Standing
from relnav_sim.results.case_names import case_in_words
from relnav_sim.results.observability import not_observable
from relnav_sim.statistics.intervals import median_interval
from relnav_sim.wording import between, counted, listed, short_labels, significant

_MOST_CASES_IN_WORDS = 6
_SMALLEST_PERCENT = 0.1
_MANY_RUNS = 100_000
_RUNS_NAMED = 3
_FAR_OFF = 1.5
"""Runs with a position RMS below this multiple of the median are not worth a look."""
_FILTERS_NAMED = 4


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
            labels = short_labels([ranking.case.label for ranking in computed])
            sentences += [
                f"{case_in_words(ranking.case.index, label).replace('c', 'C', 1)}: {verdict(ranking)}"
                for ranking, label in zip(computed, labels, strict=True)
            ]
    sentences += [*_not_observable(computed), *_known_later(computed)]
    sentences += [
        *_limit(computed),
        *_below_the_bound(computed),
        *_consistency(computed),
        *_convergence(computed),
        *cost_in_words(_per_filter(computed)),
    ]
    return (*sentences, *_worth_a_look(computed), *_diverged(computed), *_missing(rankings), *_failures(rankings))


def verdict(ranking: Ranking) -> str:
    """Return which filter of a case has the smallest position error, by how much, and whether that is decided."""
    if not ranking.ranked:
        return "Not observable: no filter's sensors can tell the state, so that a ranking would be one of the start."
    best, runs = ranking.best, ranking.best.position.runs
    size = f"{significant(best.position.estimate)} m{between(best.position.low, best.position.high)}"
    lost = _lost(best.facts)
    if len(ranking.ranked) == 1:
        velocity = f"velocity RMS {significant(best.velocity.estimate)} m/s"
        return f"{best.name}: position RMS {size}, {velocity} over {counted(runs, 'run')}{lost}."
    if runs == 1:
        sizes = listed([f"{item.name} {significant(item.position.estimate)} m" for item in ranking.ranked])
        return f"One run decides nothing. Its position RMS: {sizes}."
    if ranking.has_too_few_runs:
        sizes = listed([f"{item.name} {significant(item.position.estimate)} m" for item in ranking.ranked])
        return f"{_too_few_runs(ranking)} Position RMS: {sizes}."
    told_apart = [item for item in ranking.ranked[1:] if item.told_apart]
    behind = f"; {_behind(told_apart)}" if told_apart else ""
    if not ranking.undecided:
        return f"{best.name} has the smallest position error, RMS {size}{lost}{behind}."
    tied = [best, *ranking.undecided]
    names = listed([item.name for item in tied])
    sizes = listed([f"{item.name} {significant(item.position.estimate)} m" for item in tied])
    undecided = f"No significant difference in position error between {names} at {counted(runs, 'run')}"
    return f"{undecided}: RMS {sizes}{_largest_difference(ranking)}{behind}."


def _lost(item: FilterFacts) -> str:
    """Return how many runs of a filter failed or diverged, or nothing."""
    failed = f"{item.failed} of its {len(item.runs)} runs failed and do not count" if item.failed else ""
    parts = [part for part in (failed, diverged_note(item) if item.diverged_completed else "") if part]
    return f" ({'; '.join(parts)})" if parts else ""


def _too_few_runs(ranking: Ranking) -> str:
    runs, filters = counted(ranking.compared_runs, "run"), counted(len(ranking.ranked), "filter")
    return f"{runs} in common can't decide between {filters}: it takes {ranking.fewest_runs} or more."


def _largest_difference(ranking: Ranking) -> str:
    """Return what the intervals still allow, and at how many runs the answer would be known."""
    ends = [abs(end) for item in ranking.undecided for end in (item.percent.low, item.percent.high)]
    most = max([*ends, _SMALLEST_PERCENT])
    text = f", any difference below {significant(most, 2)} %" if np.isfinite(ends).all() else ""
    against = [item.against_best for item in ranking.undecided if item.against_best is not None]
    needed = [found.runs_to_decide for found in against if found.runs_to_decide is not None]
    if len(needed) < len(ranking.undecided) or most <= _SMALLEST_PERCENT:
        return text
    sizes = [abs(item.percent.estimate) for item in ranking.undecided]
    worth_saying = (
        max(sizes) >= ranking.case.matters_percent
        and max(found.difference.runs for found in against) < max(needed) < _MANY_RUNS
    )
    others = "each of the others" if len(needed) > 1 else ranking.undecided[0].name
    runs = f"{float(f'{max(needed):.2g}'):.0f}"
    return f"{text}; about {runs} runs would tell {ranking.best.name} from {others}" if worth_saying else text


def _behind(standings: Sequence[Standing]) -> str:
    parts = []
    for item in standings:
        percent = item.percent
        if math.isfinite(percent.estimate) and percent.estimate < 300:
            parts.append(f"{item.name} is {significant(percent.estimate)} %{between(percent.low, percent.high)} worse")
        else:
            parts.append(f"{item.name} is {significant(1 + percent.estimate / 100)} times as large")
    return listed(parts)


def _across_cases(all_rankings: Sequence[Ranking]) -> str:
    total = len(all_rankings)
    rankings = [ranking for ranking in all_rankings if ranking.ranked]
    if not rankings:
        return verdict(all_rankings[0])
    if all(len(ranking.ranked) == 1 for ranking in rankings):
        sizes = [ranking.best.position.estimate for ranking in rankings]
        name, low, high = rankings[0].best.name, significant(min(sizes)), significant(max(sizes))
        return f"{name}: position RMS between {low} and {high} m over {counted(total, 'case')}."
    if all(ranking.has_too_few_runs for ranking in rankings):
        return _too_few_runs(max(rankings, key=lambda ranking: ranking.compared_runs))
    winners: dict[tuple[str, ...], list[Ranking]] = {}
    for ranking in rankings:
        ahead = {ranking.best.name, *(item.name for item in ranking.undecided)}
        winners.setdefault(tuple(name for name in ranking.case.names if name in ahead), []).append(ranking)
    parts = []
    for names, won in sorted(winners.items(), key=lambda item: (-len(item[1]), len(item[0]))):
        where = _of_all(len(won), total)
        if len(names) == 1:
            parts.append(f"{names[0]} has the smallest position error in {where}{_margin(won)}")
        else:
            parts.append(f"no significant difference between {listed(names)} in {where}")
    if len(rankings) < total:
        parts.append(f"the state is not observable in {_of_all(total - len(rankings), total)}")
    return f"{'; '.join(parts)}."


def _not_observable(rankings: Sequence[Ranking]) -> list[str]:
    """Return which filters can't observe the state by their sensors, as `validate` says it before the run."""
    return list(
        together(
            [
                (
                    ranking.case.label,
                    not_observable(
                        {
                            item.name: item.observability
                            for item in ranking.case.filters
                            if item.observability is not None
                        }
                    ),
                )
                for ranking in rankings
            ]
        )
    )


def _known_later(rankings: Sequence[Ranking]) -> list[str]:
    """Return what later measurements would have told: a limit to what filters in flight can reach, and none of them."""
    sizes: dict[tuple[str, str], list[float]] = {}
    for ranking in rankings:
        for item in ranking.known_later:
            sizes.setdefault((item.name, item.facts.known_when), []).append(item.position.estimate)
    if not sizes:
        return []
    parts = [f"{name} ({when}) {_smallest_to_largest(found)} m" for (name, when), found in sizes.items()]
    return [f"Known only later, and so no filter to fly: position RMS of {listed(parts)}."]


def _smallest_to_largest(sizes: Sequence[float]) -> str:
    low, high = significant(min(sizes)), significant(max(sizes))
    return low if low == high else f"{low} to {high}"


def _margin(won: Sequence[Ranking]) -> str:
    """Return by how much the next filter is worse in the cases that a filter wins beyond doubt."""
    margins = [ranking.ranked[1].percent.estimate for ranking in won if len(ranking.ranked) > 1]
    if not margins or not np.isfinite(margins).all():
        return ""
    low, high = significant(min(margins)), significant(max(margins))
    return f" (the next is {low if low == high else f'{low} to {high}'} % worse)"


def _of_all(count: int, total: int) -> str:
    if count == total:
        return "both cases" if total == 2 else f"all {total} cases"
    return f"{count} of {total} cases"


def _limit(rankings: Sequence[Ranking]) -> list[str]:
    """Return how far the best filter of each case is from the bound; where it diverged, no distance is worth a word."""
    rankings = [ranking for ranking in rankings if ranking.ranked]
    best = [(ranking.best.facts, ranking.best.facts.times_bound[ranking.case.span]) for ranking in rankings]
    bounded = [(item, ratio) for item, ratio in best if math.isfinite(ratio.estimate)]
    known = sorted((ratio for item, ratio in bounded if not item.mostly_diverged), key=lambda ratio: ratio.estimate)
    diverged = [item for item, _ in bounded if item.diverged_completed]
    if not bounded:
        return []
    if not known:
        notes = listed(list(dict.fromkeys(f"{item.name} {diverged_note(item)}" for item in diverged)))
        return [f"Limit: no distance from the Cramér-Rao bound: {notes}."]
    low, high = known[0], known[-1]
    size = f"{significant(low.estimate)}{between(low.low, low.high)}"
    size = size if len(known) == 1 else f"{significant(low.estimate)} to {significant(high.estimate)}"
    each = "the best filter's" if len(known) == 1 else "in each case the best filter's"
    text = f"Limit: {each} position RMS is {size} times the Cramér-Rao bound of a perfect model"
    if any(item.named_sensors for item, _ in bounded):
        text += " that goes by the same sensors"
    if not diverged:
        return [f"{text}."]
    where = (
        f"it {diverged_note(diverged[0])}" if len(rankings) == 1 else f"it diverged in {counted(len(diverged), 'case')}"
    )
    return [f"{text}; {where}{', left out where in half of the runs' if len(known) < len(bounded) else ''}."]


def _below_the_bound(rankings: Sequence[Ranking]) -> list[str]:
    """Return why a filter may be better than the bound: what the bound counts as worse than it is, else what may be."""
    found = [
        (item.name, item.host_mixtures, ratio.high < 1)
        for ranking in rankings
        for item in (each.facts for each in ranking.ranked)
        if math.isfinite((ratio := item.times_bound[ranking.case.span]).estimate) and not item.mostly_diverged
    ]
    below = list(dict.fromkeys(name for name, _, surely in found if surely))
    mixtures = list(dict.fromkeys(sensor for _, hosts, _ in found for sensor in hosts))
    if mixtures:
        seen = f", as {listed(below)} surely {'are' if len(below) > 1 else 'is'}" if below else ""
        counted_so = f"The bound counts the mixture noise of {listed(mixtures)} by its variance"
        return [f"{counted_so}: a filter may be better than it{seen}."]
    if not below:
        return []
    return [
        f"Surely below the bound: {listed(below)}. No filter is so on average over truths and noise; the possible "
        "reasons are chance among many filters and cases, an error that happens to help in the only truth that was "
        "flown, and knowledge that a filter would not have in flight."
    ]


def _consistency(rankings: Sequence[Ranking]) -> list[str]:
    """Return whether the errors of each filter match its covariances, by its verdicts in the cases."""
    alike: dict[tuple[str, str], list[str]] = {}
    for name, parts in _per_filter(rankings):
        found = [one for item, span in parts if (one := consistency_verdict(item, span))]
        if found:
            words = consistency_in_words(found), consistency_in_words(found, several=True)
            alike.setdefault(words, []).append(name)
    said = [f"{listed(names)} {words[len(names) > 1]}" for words, names in alike.items()]
    return [f"Consistency: {'; '.join(said)}."] if said else []


def _convergence(rankings: Sequence[Ranking]) -> list[str]:
    untold = list(dict.fromkeys(item.case.not_judged for item in rankings if not item.case.shows_convergence))
    rankings = [item for item in rankings if item.case.shows_convergence and not item.case.converged_at_once]
    medians: dict[str, list[str]] = {}
    never = []
    for name, parts in _per_filter(rankings):
        times = np.concatenate([item.convergence_s[item.ok] for item, _ in parts])
        lacking = int(np.isnan(times).sum())
        median = median_interval(np.where(np.isnan(times), np.inf, times)).estimate
        if math.isfinite(median):
            medians.setdefault(f"{significant(median)} s", []).append(name)
        if lacking:
            never.append(f"{name} in {lacking} of {counted(times.size, 'run')}")
    if not medians and not never:
        return untold
    case = rankings[0].case
    level = f"a position error below {case.convergence_m:g} m for {case.hold_s:g} s"
    if not medians:
        return [f"In half of the runs or more {level} was never reached: {listed(never)}.", *untold]
    times_said = listed([f"{listed(names)} {time}" for time, names in medians.items()])
    text = f"Median time to the first passage to {level}: {times_said}"
    return [f"{text}; never reached by {listed(never)}." if never else f"{text}.", *untold]


def _worth_a_look(rankings: Sequence[Ranking]) -> list[str]:
    """Return the runs that stand out: of each filter and case the worst, those first that diverged or are far off."""
    times: dict[tuple[int, int], list[float]] = {}
    names: dict[tuple[int, int], list[str]] = {}
    lost: set[tuple[int, int]] = set()
    for ranking in rankings:
        for item in ranking.case.filters:
            if item.completed <= WORST_RUNS:
                continue
            (row,) = item.worst_rows(ranking.case.span, 1)
            place = (ranking.case.index, int(item.runs[row]))
            names.setdefault(place, []).append(item.name)
            times.setdefault(place, []).append(float(item.times_median(ranking.case.span)[row]))
            if item.diverged[row]:
                lost.add(place)
    many = len(rankings) > 1
    far = [at for at in names if at in lost or max(times[at]) >= _FAR_OFF]
    parts = [
        f"run {run}{f' of case {case}' if many else ''} ({_in_short(names[case, run])}, "
        f"{_stands_out(times[case, run])})"
        for case, run in sorted(far, key=lambda at: (at not in lost, -max(times[at])))[:_RUNS_NAMED]
    ]
    if not parts:
        return []
    how = "the commands that show them are in the tables of worst runs"
    return [f"Look at {listed(parts)}: the largest position errors; {how}."]


def _stands_out(times: Sequence[float]) -> str:
    return f"{size_range(times, 2)} times the median" if max(times) >= _FAR_OFF else "diverged"


def _in_short(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= _FILTERS_NAMED else counted(len(names), "filter")


def _diverged(rankings: Sequence[Ranking]) -> list[str]:
    """Return which filters diverged in runs that did not fail, and so count in every mean."""
    parts = []
    for name, items in _per_filter(rankings):
        count = sum(int((item.diverged & item.ok).sum()) for item, _ in items)
        if count:
            parts.append(f"{name} in {count} of {counted(sum(item.completed for item, _ in items), 'run')}")
    return [f"Diverged, yet in every mean: {listed(parts)}."] if parts else []


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
