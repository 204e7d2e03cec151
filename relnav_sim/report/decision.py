"""The decision in words: which filter to fly, how sure that is, and what is not shown; each number a link."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from relnav_sim.report.case_by_case import case_by_case
from relnav_sim.report.decision_table import (
    MOST_CASES,
    NO_DIFFERENCE_THAT_MATTERS,
    decision_table,
    largest_error,
    not_asked_in_words,
    refusal_in_words,
)
from relnav_sim.report.page import DecisionSection
from relnav_sim.report.regret import regret_anchor
from relnav_sim.report.requirements import margin, margin_in_words, requirement_anchor
from relnav_sim.report.reservations import (
    Background,
    at_row,
    in_which,
    not_shown,
    or_zero,
    overconfident,
    requirements_under_stress,
    what_would_help,
)
from relnav_sim.report.sentences import Clause, Sentence, joined, plain
from relnav_sim.report.tables import Table
from relnav_sim.statistics.decision import Candidate, CaseEvidence, Choice, Decision, Refusal
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.regret import Regret
from relnav_sim.statistics.requirements import overall
from relnav_sim.wording import between, counted, listed, significant

_MANY_RUNS = 100_000
_MANY_FILTERS = 6


def decision_section(decision: Decision, known: Background) -> DecisionSection:
    """Return the decision as a section of the page, its lead first."""
    choice = decision.overall
    others: list[Sentence] = []
    if choice.chosen is not None:
        others += [
            *_others(decision, known),
            *overconfident(decision, choice.chosen, known),
            *_regret(choice.chosen, known),
            *_diverged(choice.chosen, known),
            *requirements_under_stress(choice.chosen, known),
        ]
    others += [*_refused(decision, known), *case_by_case(decision, known.labels), *what_would_help(decision, known)]
    others += not_shown(decision, known)
    lead, enough = _lead(decision, known), not (_one_run(decision) or _too_few(decision))
    table = decision_table(decision, known.labels, known.over, enough)
    shown = table if len(decision.cases) <= MOST_CASES else _cited_rows(table, (lead, *others))
    return DecisionSection(lead, tuple(others), table, shown)


def _cited_rows(table: Table, sentences: Sequence[Sentence]) -> Table:
    """Return the rows of a table that sentences link to, to keep a page of many cases small."""
    cited = {clause.row for sentence in sentences for clause in sentence}
    rows = [replace(row, label=row.record, opens_block=False) for row in table.rows if row.anchor in cited]
    return replace(
        table,
        caption=f"{table.caption} Only rows that sentences above cite; all: tables/decision.csv.",
        rows=tuple(rows),
    )


def _lead(decision: Decision, known: Background) -> Sentence:
    choice = decision.overall
    if choice.chosen is None:
        return _none_acceptable(decision, known)
    if needed := _too_few(decision):
        return (Clause(f"No decision yet: {needed}"),)
    name = choice.chosen
    if _one_run(decision):
        said = Clause(f"No decision yet: one run decides nothing. {name}: ")
        return (said, *_achieves(decision, known, name), Clause("."))
    alike, undecided = choice.with_effect("equivalent"), choice.with_effect("undecided")
    fly = [Clause(f"Fly {name}")]
    if alike:
        every = len(alike) == len(choice.effects) and not choice.refusals and not choice.set_aside
        rest = "any of them" if every else f"{listed([name, *alike]).replace(' and ', ' or ')}"
        margin = f"within ±{decision.margin_percent:g} %"
        fly = [
            Clause(f"{NO_DIFFERENCE_THAT_MATTERS.capitalize()} between {listed([name, *alike])} ("),
            _to_row(decision, alike[0], margin),
            Clause(f"): fly {rest}. {name}"),
        ]
    if undecided:
        fly += [Clause(f" (undecided against {listed(undecided)}, see below)")]
    met = _requirements(known, name, choice.set_aside)
    return (*fly, Clause(": "), *_achieves(decision, known, name), *met, Clause("."))


def _achieves(decision: Decision, known: Background, name: str) -> Iterator[Clause]:
    """Yield the position and velocity RMS of a filter; over several cases the least and the largest."""
    found = [(case, item) for case, _ in decision.cases if (item := case.of(name))]
    if len(found) == 1:
        (case, item), *_ = found
        size = f"{significant(item.position.estimate)} m{between(item.position.low, item.position.high)}"
        yield at_row(case, name, f"position RMS {size}")
        yield Clause(f" over {_runs(decision)}, velocity RMS {significant(item.velocity.estimate)} m/s")
        return
    sizes = sorted(((item.position.estimate, case) for case, item in found), key=lambda each: each[0])
    (least, where_least), (most, where_most) = sizes[0], sizes[-1]
    yield Clause("position RMS ")
    yield at_row(where_least, name, f"{significant(least)} m")
    if significant(least) != significant(most):
        yield Clause(" to ")
        yield at_row(where_most, name, f"{significant(most)} m")
    yield Clause(f" over {_runs(decision)}")
    index, above = decision.worst[name]
    if above >= decision.margin_percent:
        case = next(case for case, _ in decision.cases if case.index == index)
        yield Clause(", at most ")
        yield at_row(case, name, f"{significant(above)} % above the best of a case ({known.named(index)})")


def _runs(decision: Decision) -> str:
    """Return how many runs there are, over several cases of each case: the least and the largest where they differ."""
    held = sorted({item.runs for case, _ in decision.cases for item in case.candidates})
    runs = counted(held[-1], "run") if held[0] == held[-1] else f"{held[0]} to {counted(held[-1], 'run')}"
    return runs if len(decision.cases) == 1 else f"{counted(len(decision.cases), 'case')} of {runs}"


def _requirements(known: Background, name: str, set_aside: Sequence[str]) -> Iterator[Clause]:
    """Yield a clause for each requirement: met with its smallest margin, undecided at how many runs, or not asked.

    Args:
        known: What the decision rests on.
        name: The chosen filter.
        set_aside: Filters that are not compared with it, because a requirement is undecided for them.
    """
    for wanted in dict.fromkeys(item.name for item in known.judged):
        mine = [(place, item) for place, item in enumerate(known.judged) if item.name == wanted and item.filter == name]
        if not mine:
            yield Clause(f"; {not_asked_in_words([wanted])}")
            continue
        verdict = overall([item.verdict for _, item in mine])
        place, item = min(
            ((place, item) for place, item in mine if item.verdict == verdict), key=lambda each: margin(each[1])
        )
        where = f", {known.named(item.case)}" if len(mine) > 1 else ""
        if verdict == "undecided":
            runs = counted(item.finding.figure.runs, "run") if item.finding else item.basis
            words = f"requirement {wanted} undecided at {runs}{where}"
        else:
            least = f" ({'smallest ' if where else ''}{margin_in_words(item)}{where})" if margin_in_words(item) else ""
            words = f"requirement {wanted} met{' in every case' if where else ''}{least}"
        yield Clause("; ")
        yield Clause(words, "requirements", requirement_anchor(place))
        if doubtful := [other for other in set_aside if wanted in _undecided(known, other)]:
            many = len(doubtful) > _MANY_FILTERS
            yield Clause(f", undecided for {counted(len(doubtful), 'filter') if many else listed(doubtful)}")


def _undecided(known: Background, name: str) -> dict[str, int]:
    """Return the requirements that are undecided for a filter, each with its first place among all that is judged."""
    found: dict[str, int] = {}
    for place, item in enumerate(known.judged):
        if item.filter == name and item.verdict == "undecided":
            found.setdefault(item.name, place)
    return found


def _others(decision: Decision, known: Background) -> Iterator[Sentence]:
    """Yield what the filters lose that are surely worse, the nearest first, and what is undecided."""
    choice = decision.overall
    worse = choice.with_effect("worse")
    if worse:
        loses = [[Clause(f"{name} loses "), _loss(decision, known, name)] for name in worse[:_MANY_FILTERS]]
        first = "Runner-up" if worse[0] == next(iter(choice.effects)) else "Surely worse:"
        loses[0][0] = Clause(f"{first} {worse[0]} loses ")
        left = len(worse) - _MANY_FILTERS
        end = f"; {counted(left, 'more filter')} lose more." if left > 0 else "."
        yield (*joined(loses, ", "), Clause(end))
    if undecided := choice.with_effect("undecided", "better"):
        parts = [[Clause(f"{name} "), _loss(decision, known, name)] for name in undecided]
        runs = max(
            (found.percent.runs for name in undecided if (found := _worst_difference(decision, name))), default=0
        )
        needed = [_needed(decision, name) for name in undecided]
        more = max((one for one in needed if one is not None), default=0)
        which = "each" if len(undecided) > 1 else "it"
        apart = f"tell {which} from {choice.chosen}, or show {which} within ±{decision.margin_percent:g} % of it"
        end = f"; about {float(f'{more:.2g}'):.0f} runs would {apart}" if runs < more < _MANY_RUNS else ""
        yield (Clause(f"Undecided at {counted(runs, 'run')}: "), *joined(parts, ", "), Clause(f"{end}."))
    if choice.set_aside:
        yield (Clause("Not compared: "), *joined(_set_aside(choice.set_aside, known), ", "), Clause("."))


def _set_aside(names: Sequence[str], known: Background) -> Iterator[list[Clause]]:
    """Yield filters that are not compared with the requirements that are undecided for them, those alike together."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in names:
        groups.setdefault(tuple(_undecided(known, name)), []).append(name)
    for name in groups.pop((), []):
        asked = {item.name for item in known.judged if item.filter == name}
        missing = dict.fromkeys(item.name for item in known.judged if item.name not in asked)
        yield [Clause(f"{name} ({not_asked_in_words(list(missing))})")]
    for wanted, alike in groups.items():
        words = f"requirement{'s' if len(wanted) > 1 else ''} {listed(wanted)} undecided"
        place = _undecided(known, alike[0])[wanted[0]]
        yield [
            Clause(f"{listed(alike)} ("),
            Clause(words, "requirements", requirement_anchor(place)),
            Clause(")"),
        ]


def _loss(decision: Decision, known: Background, name: str) -> Clause:
    """Return the difference of a filter from the chosen one, over several cases where it is largest."""
    case, found = _worst_place(decision, name)
    if found is None:
        return Clause("has no run in common with it")
    one = found.percent
    if one.estimate >= 300:
        words = f"(position RMS {significant(1 + one.estimate / 100)} times as large)"
    else:
        words = f"{significant(one.estimate)} %{between(one.low, one.high)}"
    where = f" ({known.named(case.index)})" if len(decision.cases) > 1 else ""
    return at_row(case, name, f"{words}{where}")


def _needed(decision: Decision, name: str) -> int | None:
    found = _worst_difference(decision, name)
    return None if found is None else found.runs_to_decide(decision.margin_percent)


def _worst_difference(decision: Decision, name: str) -> Difference | None:
    return _worst_place(decision, name)[1]


def _worst_place(decision: Decision, name: str) -> tuple[CaseEvidence, Difference | None]:
    """Return the case in which a filter lies farthest above the chosen one, and by how much."""
    best = decision.overall.chosen or ""
    found = [(case, case.difference(name, best)) for case, _ in decision.cases]
    known = [(case, one) for case, one in found if one is not None and math.isfinite(one.percent.estimate)]
    return max(known, key=lambda each: each[1].percent.estimate) if known else found[0]


def _regret(name: str, known: Background) -> Iterator[Sentence]:
    """Yield the worst regret of the chosen filter under the stresses, and the minimax filter where it is another."""
    worst: list[tuple[float, int, Regret]] = []
    for index, found in known.regrets.items():
        if name in found.filters:
            worst.append((found.worst[found.filters.index(name)].estimate, index, found))
    finite = [each for each in worst if not math.isnan(each[0])]
    if not finite:
        return
    size, index, found = max(finite, key=lambda each: each[0])
    row = found.filters.index(name)
    own, table = found.worst[row], f"case_{index:03d}_regret"
    under = found.worst_case(name)
    if size == 0:
        words = Clause("smallest position RMS of all filters", table, regret_anchor(index, row))
        yield (Clause(f"Without regret under stress: {name} has the "), words, Clause(f" under {_stresses(found)}."))
        return
    if len(known.regrets) > 1:
        under += f", {known.named(index)}"
    if math.isinf(size):
        words = Clause(f"infinite (it fails under {under})", table, regret_anchor(index, row))
    else:
        percent = f"{significant(100 * size, 2)} %{between(100 * own.low, 100 * own.high)}"
        words = Clause(f"{percent} ({under})", table, regret_anchor(index, row))
    said = [Clause(f"Worst regret of {name} under stress: "), words]
    minimax = found.minimax
    if minimax is not None and minimax != name:
        other = found.worst[found.filters.index(minimax)]
        decided = "" if name not in found.undecided else ", no significant difference"
        anchor = regret_anchor(index, found.filters.index(minimax))
        said += [Clause("; least for "), Clause(f"{minimax}, {significant(100 * other.estimate, 2)} %", table, anchor)]
        said += [Clause(decided)]
    yield (*said, Clause("."))


def _stresses(found: Regret) -> str:
    names = found.cases[1:]
    return f"each of {len(names)} stresses" if len(names) > _MANY_FILTERS else listed(names)


def _diverged(name: str, known: Background) -> Iterator[Sentence]:
    """Yield the stresses under which runs of the chosen filter fail or diverge: a small regret does not show them."""
    parts: list[list[Clause]] = []
    for index, found in known.regrets.items():
        if name not in found.filters:
            continue
        row = found.filters.index(name)
        for place, under in list(enumerate(found.cases))[1:]:
            counts = (("failed", found.failed[row, place]), ("diverged", found.diverged[row, place]))
            said = " and ".join(f"{how} in {count}" for how, count in counts if count)
            if said:
                words = f"{said} of {counted(len(found.runs), 'run')}"
                parts.append([Clause(words, f"case_{index:03d}_stressed_rms")])
                parts[-1].append(Clause(f" ({under}{f', {known.named(index)}' if len(known.regrets) > 1 else ''})"))
    left = len(parts) - _MANY_FILTERS
    if parts:
        more = f" and under {left} more" if left > 0 else ""
        yield (Clause(f"Under stress {name} "), *joined(parts[:_MANY_FILTERS], ", "), Clause(f"{more}."))


def _refused(decision: Decision, known: Background) -> Iterator[Sentence]:
    """Yield why filters are not recommended, the most accurate first."""
    refusals = decision.overall.refusals
    if not refusals or decision.overall.chosen is None:
        return
    first = decision.overall.most_accurate
    names = sorted(refusals, key=lambda name: name != first)
    note = f"; {first} has the smallest position RMS" if first in refusals else ""
    yield (Clause("Not recommended: "), *_grouped(decision, names, known), Clause(f"{note}."))


def _grouped(decision: Decision, names: Sequence[str], known: Background) -> list[Clause]:
    """Return filters with why they are refused, those that share their reasons together."""
    groups: dict[str, tuple[list[str], list[Clause]]] = {}
    for name in names:
        reasons = _reasons(decision, name, known)
        groups.setdefault(plain(reasons), ([], reasons))[0].append(name)
    parts = [[Clause(f"{listed(alike)} ("), *reasons, Clause(")")] for alike, reasons in groups.values()]
    left = len(parts) - _MANY_FILTERS
    return [*joined(parts[:_MANY_FILTERS], ", "), *([Clause(f" and {left} more")] if left > 0 else [])]


def _reasons(decision: Decision, name: str, known: Background) -> list[Clause]:
    """Return the reasons against a filter, each a link to the row that shows it."""
    cases = [(case, item) for case, choice in decision.cases if (item := case.of(name))]
    if not cases:
        return [Clause("no run yet")]
    runs = sum(item.runs for _, item in cases)
    worst_case, worst = max(cases, key=lambda each: or_zero(largest_error(each[1])))
    parts = []
    refusals = decision.overall.refusals[name]
    diverged = any(refusal.reason == "diverged" for refusal in refusals)
    for refusal in refusals:
        if diverged and refusal.reason == "overconfident":
            continue  # the same finding: it diverged by its own covariance
        found = [case for case, choice in decision.cases if _has(choice, name, refusal)]
        where = worst_case if refusal.reason == "overconfident" or not found else found[0]
        words = refusal_in_words(refusal, runs, worst) + in_which(decision, found, where, known)
        if refusal.reason == "requirement":
            missed = [(item.name, item.filter, item.verdict) == (refusal.what, name, "fail") for item in known.judged]
            parts.append([Clause(words, "requirements", requirement_anchor(missed.index(True)))])
            continue
        parts.append([at_row(where, name, words)])
    return joined(parts, "; ")


def _has(choice: Choice, name: str, reason: Refusal) -> bool:
    found = choice.refusals.get(name, ())
    return any((one.reason, one.what) == (reason.reason, reason.what) for one in found)


def _none_acceptable(decision: Decision, known: Background) -> Sentence:
    reasons = _grouped(decision, list(decision.overall.refusals), known)
    some = any(choice.chosen is not None for _, choice in decision.cases)
    cases = "" if len(decision.cases) == 1 else " for all cases" if some else " in any case"
    return (Clause(f"No filter can be recommended{cases} ({_runs(decision)}): "), *reasons, Clause("."))


def _one_run(decision: Decision) -> bool:
    """Return whether the chosen filter has a single run, and none to compare it with."""
    choice = decision.overall
    found = [item for case, _ in decision.cases if (item := case.of(choice.chosen or ""))]
    return bool(found) and not choice.effects and all(item.runs < 2 for item in found)


def _too_few(decision: Decision) -> str:
    """Return that the runs are too few for any interval of a difference; nothing where they are not."""
    effects, best = decision.overall.effects, decision.overall.chosen
    found = [case.difference(name, best or "") for case, _ in decision.cases for name in effects]
    if not found or any(one is not None and math.isfinite(one.percent.low) for one in found):
        return ""
    runs = max((one.percent.runs for one in found if one is not None), default=0)
    compared = {best, *effects}
    items = [item for item in decision.cases[0][0].candidates if item.name in compared]
    left = max(0, len(items) - _MANY_FILTERS)
    if left:
        items = sorted(items, key=_by_position)[:_MANY_FILTERS]
    sizes = [f"{item.name} {significant(item.position.estimate)} m" for item in items]
    sizes += [f"{left} more, none of them smaller"] if left else []
    first = f"position RMS of case {decision.cases[0][0].index}" if len(decision.cases) > 1 else "position RMS"
    runs_said = counted(runs, "run")
    return (
        f"{runs_said} in common can't decide between {counted(len(effects) + 1, 'filter')} ({first}: {listed(sizes)})."
    )


def _by_position(item: Candidate) -> tuple[bool, float]:
    """Return what sorts filters by their position RMS, last those that have none."""
    return not math.isfinite(item.position.estimate), item.position.estimate


def _to_row(decision: Decision, name: str, words: str) -> Clause:
    return at_row(_worst_place(decision, name)[0], name, words)
