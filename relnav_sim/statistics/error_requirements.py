"""A share of errors below a limit: of what? The three interpretations of ECSS-E-ST-60-10C.

Ensemble: of the runs, each by its largest error, so that it holds at all times at once. Temporal: of the time of each
run, in almost every run. Mixed: of all epochs of all runs. Runs are independent and epochs of one run are not, so that
confidence comes from runs alone: by exact binomial intervals over runs, and for mixed shares by the number of
independent trials that the spread between runs leaves to the epochs (`proportions`).
"""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.requirements import ErrorsRequirement
from relnav_sim.results import layout
from relnav_sim.results.settings import case_setting
from relnav_sim.statistics.findings import Finding, on_a_share
from relnav_sim.statistics.proportions import share_of_epochs, share_of_runs

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

EVERY_EPOCH = "every epoch"


def on_errors(results: Results, rule: ErrorsRequirement, case: int, filter: str) -> tuple[Finding | None, str]:
    """Return what the runs say about a requirement on errors, and what was looked at; None: no epoch counts.

    Epochs after a failure count as errors above every limit.
    """
    times_s = results.time_s(case)
    size = _sizes(results.error(case, filter), rule.quantity)
    counted = np.broadcast_to((times_s > 0) & (times_s >= rule.from_s), size.shape)
    if rule.inside_m is not None:
        counted = counted & (results.distance(case, filter) <= rule.inside_m)
    if not counted.any():
        return None, "no such epoch"
    below = size < rule.limit  # NaN, from a failure on, is not
    match rule.interpretation:
        case "ensemble":
            return _ensemble(results, rule, case, filter, counted, below)
        case "temporal":
            return _temporal(rule, counted, below), stored_epochs(results, case)
        case "mixed":
            hits = (counted & below).sum(axis=1)
            share = share_of_epochs(hits, counted.sum(axis=1), rule.confidence)
            return on_a_share(share, rule.share, rule.confidence), stored_epochs(results, case)


def stored_epochs(results: Results, case: int) -> str:
    """Return in words which epochs the stored series has."""
    times_s = results.time_s(case)
    step_s = results.campaign_content.get("clock", {}).get("step_s")
    every = round((times_s[1] - times_s[0]) / step_s) if step_s and len(times_s) > 1 else 0
    return EVERY_EPOCH if every == 1 else f"stored epochs, one in {every}" if every else "stored epochs"


def _sizes(error: Array, quantity: str) -> Array:
    """Return the size of a quantity of errors (runs, K, 6), (runs, K)."""
    if quantity in ("r", "v"):
        part = slice(0, 3) if quantity == "r" else slice(3, 6)
        return np.asarray(np.linalg.norm(error[..., part], axis=-1))
    return np.abs(error[..., layout.COMPONENTS.index(quantity)])


def _temporal(rule: ErrorsRequirement, counted: Mask, below: Mask) -> Finding:
    """Return what the runs say about a share of the time of each run."""
    epochs = counted.sum(axis=1)
    judged = epochs > 0
    met = (counted & below).sum(axis=1)[judged] >= rule.share * epochs[judged] * (1 - 1e-12)
    return on_a_share(share_of_runs(int(met.sum()), len(met)), rule.runs_that_keep_it, rule.confidence)


def _ensemble(
    results: Results, rule: ErrorsRequirement, case: int, filter: str, counted: Mask, below: Mask
) -> tuple[Finding, str]:
    """Return what the runs say about a share of runs that are below the limit at all times.

    Peaks between stored epochs count: the largest error of each run is known at every epoch, over the whole run and
    after settling. Where neither span is the one asked for, it decides the runs that it can; the others are open.
    """
    judged = counted.any(axis=1)
    missed = (counted & ~below).any(axis=1)
    basis = stored_epochs(results, case)
    if basis == EVERY_EPOCH:
        sure, possible = judged & ~missed, judged & ~missed
    else:
        within, beyond = _by_largest(results, rule, case, filter)
        sure, possible = judged & within & ~missed, judged & ~missed & ~beyond
        basis = f"{EVERY_EPOCH}, by the largest error of each run"
    runs = int(judged.sum())
    low = on_a_share(share_of_runs(int(sure.sum()), runs), rule.share, rule.confidence)
    if (sure == possible).all():
        return low, basis
    high = on_a_share(share_of_runs(int(possible.sum()), runs), rule.share, rule.confidence)
    basis = f"{stored_epochs(results, case)}; {int((possible & ~sure).sum())} runs may exceed the limit between them"
    if low.verdict == "pass" or high.verdict == "fail":
        return (low if low.verdict == "pass" else high), basis
    return Finding(replace(low.figure, high=high.figure.high), "undecided", nan, None), basis


def _by_largest(results: Results, rule: ErrorsRequirement, case: int, filter: str) -> tuple[Mask, Mask]:
    """Return which runs the largest error at full rate shows to be below the limit, and which not, (runs,) each."""
    largest = results.statistic(case, filter, "max")[..., layout.QUANTITIES.index(rule.quantity)]
    failed = results.statistic(case, filter, "failed") == 1
    settle_s = float(case_setting(results, case, "statistics.settle_s", nan))
    wider = largest[:, 1] if rule.from_s >= settle_s else largest[:, 0]
    within = (wider < rule.limit) & ~failed
    if rule.inside_m is not None:
        return within, np.zeros_like(failed)
    first_s = float(case_setting(results, case, "clock.step_s", nan))
    beyond = failed.copy()
    for span, from_s in ((0, first_s), (1, settle_s)):
        if rule.from_s <= from_s:
            beyond |= largest[:, span] >= rule.limit
    return within, beyond
