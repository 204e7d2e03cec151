"""The campaign's requirements and what became of them: a table, a sentence, and the verdict on all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from relnav_sim.campaign.requirements import (
    AnyRequirement,
    ConvergedRequirement,
    DivergedRequirement,
    ErrorsRequirement,
    FailedRequirement,
    NeesRequirement,
    NisRequirement,
    RecoveryRequirement,
    RmsRequirement,
    stored_requirements,
)
from relnav_sim.report.metrics import numbers
from relnav_sim.report.ranking import in_percent
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.results.block import ResultsError
from relnav_sim.results.case_names import case_in_tables
from relnav_sim.statistics.findings import Verdict
from relnav_sim.statistics.requirements import CANNOT_BE_JUDGED, Judgement, judge, overall
from relnav_sim.wording import between, listed, short_labels, significant

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_SPANS = {"settled": "steady state", "whole": "whole run"}
_SIZE = {"r": "position errors", "v": "velocity errors"}
_CASES_NAMED = 6
_MARKS = {"pass": "best", "fail": "failed", "undecided": ""}


def judgements(results: Results, cases: Sequence[int] | None = None, only: str | None = None) -> tuple[Judgement, ...]:
    """Return every requirement of a result's campaign for every case and filter that it is about.

    Args:
        results: An opened result.
        cases: Numbers of the cases; default: the nominal ones, as filters must achieve it in the truth that they are
            told of.
        only: The only filter to judge; default: all.

    Raises:
        ResultsError: The requirements in the file are damaged.
    """
    try:
        requirements = stored_requirements(results.campaign_content)
    except ValueError:
        raise ResultsError(f"{results.path}: the campaign's requirements are damaged") from None
    return tuple(
        judge(results, name, requirement, index, filter)
        for name, requirement in requirements.items()
        for index in (results.nominal if cases is None else cases)
        for filter in results.headers[index].filters
        if (requirement.filters is None or filter in requirement.filters) and only in (None, filter)
    )


_BLOCKS = {"full": "", "each": " of whole state, position and velocity"}


def requirement_in_words(requirement: AnyRequirement) -> str:
    """Return what a requirement demands, without its confidence."""
    match requirement:
        case ErrorsRequirement():
            where = f" inside {requirement.inside_m:g} m" if requirement.inside_m is not None else ""
            when = f" from {requirement.from_s:g} s on" if requirement.from_s else ""
            size = f"{requirement.limit:g} {_unit(requirement.quantity)}"
            below = f"{_errors_of(requirement.quantity)} below {size}{where}{when}"
            return _interpreted(requirement, below)
        case RmsRequirement():
            size = f"{requirement.limit:g} {_unit(requirement.quantity)}"
            return f"RMS of {_errors_of(requirement.quantity)} below {size}, {_SPANS[requirement.span]}"
        case NeesRequirement():
            part = _BLOCKS.get(requirement.block, f", {requirement.block}")
            low, high = _sigma_limits(requirement)
            return f"ANEES{part} between {low:.3g} and {high:.3g}, {_SPANS[requirement.span]}"
        case NisRequirement():
            of = "" if requirement.sensor is None else f" of {requirement.sensor}"
            low, high = _sigma_limits(requirement)
            return f"NIS per degree of freedom{of} between {low:.3g} and {high:.3g}, {_SPANS[requirement.span]}"
        case ConvergedRequirement():
            size = f" below {requirement.below_m} m" if requirement.below_m is not None else ""
            share = _percent(requirement.share)
            return f"converged{size} within {requirement.within_s:g} s, first passage, in {share} of the runs"
        case RecoveryRequirement():
            share = _percent(requirement.share)
            return f"recovered within {requirement.within_s:g} s in {share} of the runs locked out or diverged"
        case FailedRequirement() | DivergedRequirement():
            return f"at most {_percent(requirement.at_most)} of the runs {requirement.kind}"


def requirements_table(results: Results, judged: Sequence[Judgement]) -> Table:
    """Return a row per requirement, case and filter."""
    cases = short_labels([header.label for header in results.headers])
    rows = []
    for place, item in enumerate(judged):
        opens = not place or judged[place - 1].name != item.name
        words = requirement_in_words(item.requirement)
        rows.append(
            Row(
                f"{item.name}: {words}" if opens else item.name,
                (Words(case_in_tables(item.case, cases[item.case])), Words(item.filter), *_cells(item)),
                key=str(item.case),
                opens_block=opens,
                record=item.name,
                anchor=requirement_anchor(place),
            )
        )
    labels = ("case", "filter", "value", "verdict", "certainty", "runs", "looked at")
    return Table(
        name="requirements",
        title="Requirements",
        caption="Judged in the truth that filters are told of, without stress. The value that the requirement limits, "
        "with its interval at the requirement's confidence (95 % unless the campaign says otherwise; of nees, each of "
        "its three parts errs a third as often). Pass: the whole "
        "interval meets the limit; fail: the whole interval misses it. Certainty: the largest one-sided confidence at "
        "which the side of the value could be stated. Runs are independent, epochs of a run are not: shares of runs "
        "(ensemble and temporal interpretation) have exact intervals, shares of epochs (mixed) count as many "
        "independent trials as their spread over runs allows.",
        corner="requirement",
        columns=tuple(Column(label, numeric=label == "value") for label in labels),
        rows=tuple(rows),
        stacks=True,
    )


def requirement_anchor(place: int) -> str:
    """Return the id of a row of `requirements_table`: that of the judgement at this place."""
    return f"requirement-{place}"


def in_sentences(judged: Sequence[Judgement]) -> tuple[str, ...]:
    """Return a sentence on each requirement: who meets it, who misses it, who is undecided."""
    sentences = []
    for name in dict.fromkeys(item.name for item in judged):
        mine = [item for item in judged if item.name == name]
        verdicts = {
            filter: overall([item.verdict for item in mine if item.filter == filter])
            for filter in dict.fromkeys(item.filter for item in mine)
        }
        said = [
            f"{words} {listed([filter for filter, verdict in verdicts.items() if verdict == wanted])}"
            for wanted, words in _said_of(several=len({item.case for item in mine}) > 1)
            if wanted in verdicts.values()
        ]
        said += [CANNOT_BE_JUDGED] if any(item.basis == CANNOT_BE_JUDGED for item in mine) else []
        sentences.append(f"Requirement {name} ({requirement_in_words(mine[0].requirement)}): {'; '.join(said)}.")
    return tuple(sentences)


def concerned(judged: Sequence[Judgement], verdict: Verdict) -> str:
    """Return which requirement has a verdict, for which filter, and of several cases in which."""
    several = len({item.case for item in judged}) > 1
    groups: dict[str, dict[str, list[int]]] = {}
    for item in judged:
        if item.verdict == verdict:
            groups.setdefault(item.name, {}).setdefault(item.filter, []).append(item.case)
    parts = [
        f"{name}: {', '.join(filter + (_in_cases(cases) if several else '') for filter, cases in found.items())}"
        for name, found in groups.items()
    ]
    return "; ".join(parts)


def _in_cases(cases: Sequence[int]) -> str:
    named = listed([str(case) for case in cases[:_CASES_NAMED]])
    more = f" and {len(cases) - _CASES_NAMED} more" if len(cases) > _CASES_NAMED else ""
    return f" (case{'s' if len(cases) > 1 else ''} {named}{more})"


def value_in_words(item: Judgement) -> str:
    """Return the value that a requirement limits, with its interval and unit; nothing where there is none."""
    if item.finding is None:
        return ""
    figure, unit = item.finding.figure, ""
    match item.requirement:
        case RmsRequirement():
            unit = f" {_unit(item.requirement.quantity)}"
        case NeesRequirement() | NisRequirement():
            pass
        case _:
            figure, unit = in_percent(figure, 1.0), " %"
    return f"{significant(figure.estimate)}{unit}{between(figure.low, figure.high)}"


def margin(item: Judgement) -> float:
    """Return how far the interval of a met requirement stays from the limit, in the unit of `margin_in_words`.

    Infinite where that is not known; of one requirement the smallest is the worst.
    """
    if item.finding is None or item.verdict != "pass":
        return math.inf
    figure, requirement = item.finding.figure, item.requirement
    match requirement:
        case RmsRequirement():
            return 100 * (1 - figure.high / requirement.limit)
        case NeesRequirement() | NisRequirement():
            low, high = _sigma_limits(requirement)
            return min(figure.low - low, high - figure.high)
        case FailedRequirement() | DivergedRequirement():
            return 100 * (requirement.at_most - figure.high)
        case ErrorsRequirement() | ConvergedRequirement() | RecoveryRequirement():
            return 100 * (figure.low - requirement.share)


def margin_in_words(item: Judgement) -> str:
    """Return how far the interval of a met requirement stays from the limit; nothing where that is not known."""
    size = margin(item)
    if math.isinf(size):
        return ""
    match item.requirement:
        case RmsRequirement():
            unit = " % of the limit"
        case NeesRequirement():
            unit = " of the ANEES"
        case NisRequirement():
            unit = " of the NIS"
        case FailedRequirement() | DivergedRequirement():
            unit = " % of the runs"
        case ErrorsRequirement() | ConvergedRequirement() | RecoveryRequirement():
            unit = " percentage points"
    return f"margin {significant(size, 2)}{unit}"


def _said_of(several: bool) -> tuple[tuple[Verdict, str], ...]:
    if several:
        return ("pass", "met in every case by"), ("fail", "missed in some case by"), ("undecided", "undecided for")
    return ("pass", "met by"), ("fail", "missed by"), ("undecided", "undecided for")


def _cells(item: Judgement) -> tuple[Cell, ...]:
    verdict = Words(item.verdict, mark=_MARKS[item.verdict])
    found = item.finding
    if found is None:
        return (Words(item.basis), verdict, Words(""), Words(""), Words(item.basis))
    if isinstance(item.requirement, RmsRequirement | NeesRequirement | NisRequirement):
        shown = numbers([found.figure])[0]
    else:
        shown = replace(numbers([in_percent(found.figure, 1.0)])[0], unit="%")
    return shown, verdict, Words(_certainty(found.certainty)), Words(_runs(item)), Words(item.basis)


def _certainty(certainty: float) -> str:
    if not math.isfinite(certainty):
        return ""
    return "> 99.9 %" if certainty > 0.999 else f"{100 * certainty:.1f} %"


def _runs(item: Judgement) -> str:
    found = item.finding
    if found is None:
        return ""
    held = f"{found.figure.runs}"
    if item.verdict != "undecided":
        return held
    if found.runs_to_decide is None:
        return f"{held}; no number would decide"
    if found.runs_to_decide <= found.figure.runs:
        return f"{held}; a few more would decide"
    return f"{held}; about {float(f'{found.runs_to_decide:.2g}'):.0f} would decide"


def _interpreted(requirement: ErrorsRequirement, below: str) -> str:
    share = _percent(requirement.share)
    match requirement.interpretation:
        case "ensemble":
            return f"{below} at all times in {share} of the runs, ensemble interpretation"
        case "temporal":
            runs = _percent(requirement.runs_that_keep_it)
            return f"{below} for {share} of the time in {runs} of the runs, temporal interpretation"
        case "mixed":
            return f"{share} of {below}, mixed interpretation"


def _errors_of(quantity: str) -> str:
    return _SIZE.get(quantity, f"{quantity} errors")


def _unit(quantity: str) -> str:
    return "m/s" if quantity.startswith("v") else "m"


def _percent(share: float) -> str:
    return f"{significant(100 * share, 6).rstrip('0').rstrip('.')} %"


def _sigma_limits(requirement: NeesRequirement | NisRequirement) -> tuple[float, float]:
    return (1 - requirement.sigma_margin) ** 2, (1 + requirement.sigma_margin) ** 2
