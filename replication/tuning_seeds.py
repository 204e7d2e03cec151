"""Intervals of figures that depend on a tuning: the variance over tuning seeds beside that over runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from relnav_sim.statistics.intervals import Interval


def pooled(intervals: Sequence[Interval]) -> Interval:
    """Return one interval from those of several tunings, each of the same figure on the same runs.

    The total variance is W + (1 + 1/m) B: W the mean variance over runs, B the variance of the m estimates between
    tunings; Student's quantile with (m - 1) (1 + W / ((1 + 1/m) B))^2 degrees of freedom, at most n - 1 of the n runs
    (Rubin 1987, Multiple Imputation for Nonresponse in Surveys, eqs. 3.1.2 to 3.1.8).

    Args:
        intervals: One for each tuning seed, at least two.
    """
    from scipy.special import stdtrit

    m, level = len(intervals), intervals[0].level
    runs = min(interval.runs for interval in intervals)
    estimates = np.array([interval.estimate for interval in intervals])
    if not np.isfinite(estimates).all():  # runs that never converge in some tuning: no variance can be told
        unknown = [interval for interval in intervals if math.isnan(interval.estimate)]
        return unknown[0] if unknown else max(intervals, key=lambda interval: interval.estimate)
    middle = float(estimates.mean())
    if runs < 2:
        return Interval(middle, math.nan, math.nan, level, runs)
    halves = np.array([(interval.high - interval.low) / 2 for interval in intervals])
    if not np.isfinite(halves).all():  # no variance can be told from an interval without an end
        return intervals[int(np.argmax(~np.isfinite(halves)))]
    within = float(np.mean((halves / stdtrit(runs - 1, (1 + level) / 2)) ** 2))
    between = (1 + 1 / m) * float(estimates.var(ddof=1))
    freedom = runs - 1.0 if between == 0 else min(runs - 1.0, (m - 1) * (1 + within / between) ** 2)
    half = float(stdtrit(freedom, (1 + level) / 2)) * math.sqrt(within + between)
    return Interval(middle, middle - half, middle + half, level, runs)
