"""What the residuals of a filter amount to, in one sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.conventions import CONFIDENCE
from relnav_sim.report.replay.figures_of_filters import FilterFigures
from relnav_sim.statistics.residual_checks import ChannelCheck, NisCheck
from relnav_sim.statistics.scores import Scores
from relnav_sim.wording import listed, significant

_OTHER_READINGS = 1e3
"""NIS over its expectation that is no matter of tuning: errors of 30 sigmas."""


def verdict(filter: FilterFigures, runs: int) -> str:
    """Return the verdict on a filter, a word first: ``overconfident: NIS 3.2 times its expectation for radar``.

    Args:
        filter: Its figures.
        runs: Number of runs replayed.
    """
    return _by_residuals(filter, runs) + ("" if filter.scores is None else _against_truth(filter.scores))


def shared_findings(filters: Sequence[FilterFigures]) -> str:
    """Return a sentence on the channels that no filter that reads them finds white; empty without any.

    Filters share the measurements, so a chance in these is found by each of them, and is no verdict of so many.

    Args:
        filters: The figures of all filters.
    """
    if len(filters) < 2:
        return ""
    found = [{one.name for one in each.checks.correlated} for each in filters]
    shared = [one.name for one in filters[0].checks.channels if all(one.name in names for names in found)]
    if not shared:
        return ""
    return (
        f"All {len(filters)} filters find the residuals of {listed(shared)} not white; they share the measurements, so "
        f"this is one finding and not {len(filters)}: that of the measurements, of what all filters believe alike, or "
        f"chance ({100 * (1 - CONFIDENCE):.0f} % of the filters that are right have such a finding)."
    )


def _by_residuals(filter: FilterFigures, runs: int) -> str:
    failed = len(filter.replayed.failures)
    if failed == runs:
        first = min(filter.replayed.failures, key=lambda failure: failure.epoch)
        return f"failed: {first.reason} (epoch {first.epoch})"
    checks = filter.checks
    overconfident, conservative = checks.found("overconfident"), checks.found("conservative")
    findings = [_nis(group) for group in (overconfident, conservative) if group]
    if biased := checks.biased:
        offsets = [f"{one.name} by {significant(one.normalised_mean, 2)} sigma" for one in biased]
        findings.append(f"residuals off on average: {listed(offsets)}")
    if correlated := checks.correlated:
        findings.append(f"residuals not white: {listed([_correlation(one) for one in correlated])}")
    if apart := checks.smoother.disagreeing:
        findings.append(f"filter and smoother disagree in {listed(apart)}")
    if any(one.ratio > _OTHER_READINGS for one in overconfident):
        findings.append(
            "so far off that no noise explains it: check the units, frame and times of the measurements, and the "
            "dynamics"
        )
    if failed:
        findings.append(f"{failed} of {runs} runs failed")
    if findings:
        word = "inconsistent"
        if bool(overconfident) != bool(conservative):
            word = "overconfident" if overconfident else "conservative"
        return f"{word}: {'; '.join(findings)}"
    read = [one for one in checks.nis if one.band is not None]
    if not read:
        return "not tested: no measurement reached it"
    agree = "; filter and smoother agree" if checks.smoother.count.any() else ""
    return f"consistent: {_nis(read)}; residuals white{agree}"


def _against_truth(scores: Scores) -> str:
    settled = np.isfinite(scores.position_rms_m[1])
    position_m, anees = (each[int(settled)] for each in (scores.position_rms_m, scores.anees))
    if not np.isfinite(position_m):
        return ""
    return (
        f"; against the truth {significant(position_m)} m RMS{' in steady state' * bool(settled)}, ANEES "
        f"{significant(anees)}"
    )


def _nis(checks: Sequence[NisCheck]) -> str:
    each = [f"{significant(one.ratio)} for {one.sensor}" for one in checks]
    return f"NIS over its expectation {listed(each)}"


def _correlation(one: ChannelCheck) -> str:
    lag = int(np.argmax(np.abs(one.whiteness.correlation)))
    return f"{one.name} ({significant(float(one.whiteness.correlation[lag]), 2)} at lag {lag + 1})"
