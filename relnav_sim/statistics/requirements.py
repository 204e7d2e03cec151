"""Does a filter meet what the campaign requires of it? Pass, fail or undecided, by the interval over runs.

A requirement passes once the whole interval of its figure lies on the good side of the limit, fails once it lies on the
other, and is undecided in between. Shares have exact intervals (`proportions`), means that of every mean (`means`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
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
)
from relnav_sim.results import layout
from relnav_sim.statistics.convergence_seen import seen_until_s
from relnav_sim.statistics.divergence import diverged_runs
from relnav_sim.statistics.error_requirements import EVERY_EPOCH, on_errors, stored_epochs
from relnav_sim.statistics.findings import Finding, Verdict, on_a_mean, on_a_share
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.proportions import share_of_runs
from relnav_sim.statistics.recovery import recovered_in_time
from relnav_sim.wording import counted

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

CANNOT_BE_JUDGED = "cannot be judged: the run is not longer than the hold time"


@dataclass(frozen=True)
class Judgement:
    """One requirement, for one filter in one case.

    Attributes:
        name: The requirement's name in the campaign.
        requirement: The requirement.
        case: Number of the case, from 0.
        filter: Name of the filter.
        finding: What the runs say; None where there is none.
        basis: What was looked at, in words.
    """

    name: str
    requirement: AnyRequirement
    case: int
    filter: str
    finding: Finding | None
    basis: str

    @property
    def verdict(self) -> Verdict:
        """Pass, fail or undecided; undecided without runs."""
        return self.finding.verdict if self.finding else "undecided"


def overall(verdicts: Iterator[Verdict] | list[Verdict]) -> Verdict:
    """Return the verdict on all: fail if one fails, else undecided if one is, else pass.

    All must pass, so that a wrong pass is as improbable as for a single one (an intersection-union test, Berger 1982).
    """
    found = set(verdicts)
    return "fail" if "fail" in found else "undecided" if "undecided" in found else "pass"


def judge(results: Results, name: str, requirement: AnyRequirement, case: int, filter: str) -> Judgement:
    """Return whether a filter meets a requirement in one case."""
    if not len(results.case_runs(case, filter)):
        return Judgement(name, requirement, case, filter, None, "no run yet")
    match requirement:
        case ErrorsRequirement():
            finding, basis = on_errors(results, requirement, case, filter)
        case RmsRequirement():
            finding, basis = _rms(results, requirement, case, filter), EVERY_EPOCH
        case NeesRequirement():
            finding, basis = _nees(results, requirement, case, filter)
        case NisRequirement():
            finding, basis = _nis(results, requirement, case, filter)
        case ConvergedRequirement():
            finding, basis = _converged(results, requirement, case, filter)
        case RecoveryRequirement():
            finding, basis = _recovered(results, requirement, case, filter)
        case FailedRequirement() | DivergedRequirement():
            finding, basis = _lost(results, requirement, case, filter)
    if finding is None and basis == EVERY_EPOCH:
        failed = results.statistic(case, filter, "failed") == 1
        basis = "no completed run" if failed.all() else "no value in the span"
    return Judgement(name, requirement, case, filter, finding, basis)


def _rms(results: Results, rule: RmsRequirement, case: int, filter: str) -> Finding | None:
    quantity, span = layout.QUANTITIES.index(rule.quantity), layout.SPANS.index(rule.span)
    values = _known(_completed(results, case, filter, "rms")[:, span, quantity])
    return on_a_mean(values, -math.inf, rule.limit, rule.confidence) if len(values) else None


def _nis(results: Results, rule: NisRequirement, case: int, filter: str) -> tuple[Finding | None, str]:
    span = layout.SPANS.index(rule.span)
    basis = EVERY_EPOCH if rule.sensor is None else f"every measurement of {rule.sensor}"
    total, dof = results.nis_sum(case, filter)[:, span], results.dof_sum(case, filter)[:, span]
    if rule.sensor is not None:
        by_sensor = results.by_sensor(case, filter)
        if by_sensor is None or rule.sensor not in by_sensor.names:
            return None, f"no measurement of {rule.sensor}"
        place = by_sensor.names.index(rule.sensor)
        total, dof = by_sensor.nis_sum[:, span, place], by_sensor.dof_sum[:, span, place]
    known = (results.statistic(case, filter, "failed") == 0) & (dof > 0)
    low, high = (1 - rule.sigma_margin) ** 2, (1 + rule.sigma_margin) ** 2
    if not known.any():
        return None, basis
    # Runs with more degrees of freedom weigh more, as in the sum that is chi-square.
    return on_a_mean(total[known] / dof[known].mean(), low, high, rule.confidence), basis


def _nees(results: Results, rule: NeesRequirement, case: int, filter: str) -> tuple[Finding | None, str]:
    """Return what the part of the state says that decides: of several, one that misses, else the one least sure."""
    blocks = layout.BLOCKS if rule.block == "each" else (rule.block,)
    anees = _completed(results, case, filter, "anees")[:, layout.SPANS.index(rule.span)]
    low, high = (1 - rule.sigma_margin) ** 2, (1 + rule.sigma_margin) ** 2
    # Each part has its share of the chance of a wrong verdict (Bonferroni).
    confidence = 1 - (1 - rule.confidence) / len(blocks)
    found: list[tuple[Finding, str]] = []
    for block in blocks:
        values = _known(anees[:, layout.BLOCKS.index(block)])
        if not len(values):
            return None, EVERY_EPOCH
        found.append((on_a_mean(values, low, high, confidence), f"{EVERY_EPOCH}; {_BLOCK_NAMES[block]}"))
    finding, basis = max(found, key=lambda each: _decides(each[0]))
    return finding, basis if len(blocks) > 1 else EVERY_EPOCH


_BLOCK_NAMES = {"full": "whole state", "position": "position", "velocity": "velocity"}


def _decides(finding: Finding) -> tuple[int, float]:
    """Return what sorts findings of which all must pass, the one that decides last."""
    order: tuple[Verdict, ...] = ("pass", "undecided", "fail")
    certain = finding.certainty if finding.verdict == "fail" else -finding.certainty
    return order.index(finding.verdict), certain


def _converged(results: Results, rule: ConvergedRequirement, case: int, filter: str) -> tuple[Finding | None, str]:
    if rule.below_m is None:
        times = results.statistic(case, filter, "convergence")
    else:
        times = results.statistic(case, filter, "convergence_level")[:, layout.THRESHOLDS_M.index(rule.below_m)]
    sound = results.statistic(case, filter, "failed") == 0
    with np.errstate(invalid="ignore"):
        reached = sound & (times <= rule.within_s)
    finding = on_a_share(share_of_runs(int(reached.sum()), len(times)), rule.share, rule.confidence)
    seen_s = seen_until_s(results, case)
    if not seen_s < rule.within_s:
        return finding, EVERY_EPOCH
    # The others may have converged in time: the run ends before the hold time has passed.
    possible = on_a_share(share_of_runs(int(sound.sum()), len(times)), rule.share, rule.confidence)
    basis = f"{EVERY_EPOCH}; converging after {seen_s:g} s cannot be judged" if seen_s > 0 else CANNOT_BE_JUDGED
    if finding.verdict == "pass" or possible.verdict == "fail":
        return (finding if finding.verdict == "pass" else possible), basis
    if seen_s <= 0:
        return None, CANNOT_BE_JUDGED
    figure = replace(finding.figure, high=possible.figure.high)
    return Finding(figure, "undecided", math.nan, None), basis


def _recovered(results: Results, rule: RecoveryRequirement, case: int, filter: str) -> tuple[Finding | None, str]:
    editing = results.editing(case, filter)
    if editing is None:
        return None, "the filter edits no measurement"
    found = recovered_in_time(editing, results.statistic(case, filter, "failed") == 1, rule.within_s)
    runs, met, possible = (int(part.sum()) for part in (found.concerned, found.met, found.possible))
    basis = f"the {counted(runs, 'run')} locked out or diverged"
    if not runs:
        return None, "no run was locked out or diverged"
    finding, best = (on_a_share(share_of_runs(part, runs), rule.share, rule.confidence) for part in (met, possible))
    if met == possible or finding.verdict == "pass":
        return finding, basis
    basis += f"; {counted(possible - met, 'run')} end too soon to tell"
    if best.verdict == "fail":
        return best, basis
    return Finding(replace(finding.figure, high=best.figure.high), "undecided", math.nan, None), basis


def _lost(
    results: Results, rule: FailedRequirement | DivergedRequirement, case: int, filter: str
) -> tuple[Finding, str]:
    lost, basis = results.statistic(case, filter, "failed") == 1, EVERY_EPOCH
    if rule.kind == "diverged":
        lost = diverged_runs(results, case, filter)
        if results.perfect_bound(case, filter) is not None:
            basis = f"{EVERY_EPOCH}; the bound at {stored_epochs(results, case)}"
    kept = share_of_runs(int((~lost).sum()), len(lost))
    finding = on_a_share(kept, 1 - rule.at_most, rule.confidence)
    shown = finding.figure
    turned = Interval(1 - shown.estimate, 1 - shown.high, 1 - shown.low, shown.level, shown.runs)
    return Finding(turned, finding.verdict, finding.certainty, finding.runs_to_decide), basis


def _completed(results: Results, case: int, filter: str, name: str) -> Array:
    sound = results.statistic(case, filter, "failed") == 0
    return np.asarray(results.statistic(case, filter, name), dtype=float)[sound]


def _known(values: Array) -> Array:
    return values[~np.isnan(values)]
