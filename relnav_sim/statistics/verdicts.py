"""Does a measured effect confirm a published one? Effects with intervals, and what they say together.

A claim is judged by intervals, never by point estimates. All parts of a claim, and all of its main interpretations,
must
hold: the chance that a claim is confirmed wrongly is then at most that of its weakest part (an intersection-union
test, Berger 1982), so each part may be judged at the full level. One of several alternative interpretations is enough
for a condition; those share the error between them (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.bootstrap import RESAMPLES
from relnav_sim.statistics.intervals import Interval, wilson_interval

Outcome = Literal["holds", "fails", "open"]
Verdict = Literal["reproduced", "reproduced only if", "not reproduced"]


def judged(effect: Interval, at_least: float = -math.inf, at_most: float = math.inf) -> Outcome:
    """Return whether an effect lies in a range: its whole interval does, none of it does, or it can't be told.

    An effect whose interval is unknown (a single run, a NaN) is open.
    """
    if not (effect.low <= effect.high):
        return "open"
    if effect.low >= at_least and effect.high <= at_most:
        return "holds"
    if effect.high < at_least or effect.low > at_most:
        return "fails"
    return "open"


def together(outcomes: Iterable[Outcome]) -> Outcome:
    """Return what several outcomes say that must all hold.

    Raises:
        ValueError: There are none.
    """
    found = set(outcomes)
    if not found:
        raise ValueError("nothing was judged")
    return "fails" if "fails" in found else "open" if "open" in found else "holds"


def verdict(main: Iterable[Outcome], others: Iterable[Outcome] = ()) -> Verdict:
    """Return the verdict on a claim.

    Args:
        main: Outcomes of the interpretations that must all hold.
        others: Outcomes of the interpretations of which one is enough for a condition.
    """
    outcomes = list(main)
    if together(outcomes) == "holds":
        return "reproduced"
    return "reproduced only if" if "holds" in (*outcomes, *others) else "not reproduced"


def shared_level(readings: int, level: float = CONFIDENCE) -> float:
    """Return the confidence of each of several interpretations of which one is enough."""
    return 1 - (1 - level) / max(1, readings)


def ratio_of_means(first: ArrayLike, second: ArrayLike, level: float = CONFIDENCE) -> Interval:
    """Return the mean of one filter's figures over another's on the same runs, with its interval.

    The interval is Student's on the linearised ratio (Cochran 1977, eq. 6.4), which is honest for few runs as well;
    pairing takes out what the runs have in common.

    Args:
        first: One figure per run (runs,).
        second: The other's for the same runs, in the same order.
        level: Confidence.
    """
    a, b = _paired(first, second)
    n = len(a)
    if n == 0 or b.mean() == 0:
        return Interval(math.nan, math.nan, math.nan, level, n)
    ratio = float(a.mean() / b.mean())
    if n == 1:
        return Interval(ratio, math.nan, math.nan, level, 1)
    half = _student(level, n) * float((a - ratio * b).std(ddof=1)) / math.sqrt(n) / abs(float(b.mean()))
    return Interval(ratio, ratio - half, ratio + half, level, n)


def fiellers_ratio(first: ArrayLike, second: ArrayLike, level: float = CONFIDENCE) -> Interval:
    """Return the same ratio where the second mean may be near zero, so that it can't be linearised.

    The interval is Fieller's (J. Royal Statistical Society B 16(2), 1954): of the ratios q for which Student's paired
    test does not tell the mean of first - q second from zero. It has no upper end where that test does not tell the
    second mean from zero, and no end at all where it does not tell the first one either.

    Args:
        first: One figure per run (runs,), a size or a share.
        second: The other's for the same runs, in the same order.
        level: Confidence.
    """
    a, b = _paired(first, second)
    n = len(a)
    if n < 2 or b.mean() == 0:
        return ratio_of_means(a, b, level)
    (aa, ab), (_, bb) = np.cov(a, b) * _student(level, n) ** 2 / n
    # A q^2 - 2 B q + C <= 0 is mean(a - q b)^2 <= t^2 var(a - q b) / n.
    A, B, C = b.mean() ** 2 - bb, a.mean() * b.mean() - ab, a.mean() ** 2 - aa
    root, low, high = math.sqrt(max(0.0, B * B - A * C)), -math.inf, math.inf
    if A > 0:
        low, high = (B - root) / A, (B + root) / A
    elif C > 0:
        low = C / (B + root)
    return Interval(float(a.mean() / b.mean()), float(low), float(high), level, n)


def mean_of_runs(values: ArrayLike, level: float = CONFIDENCE) -> Interval:
    """Return the mean over runs with Student's interval; runs without a figure (NaN) are left out."""
    sample = np.asarray(values, dtype=np.float64)
    sample = sample[~np.isnan(sample)]
    n = len(sample)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    mean = float(sample.mean())
    if n == 1:
        return Interval(mean, math.nan, math.nan, level, 1)
    half = _student(level, n) * float(sample.std(ddof=1)) / math.sqrt(n)
    return Interval(mean, mean - half, mean + half, level, n)


def difference_of_means(first: ArrayLike, second: ArrayLike, level: float = CONFIDENCE) -> Interval:
    """Return the mean of first minus second on the same runs with Student's interval."""
    a, b = _paired(first, second)
    return mean_of_runs(a - b, level)


def ratio_of_medians(first: ArrayLike, second: ArrayLike, level: float = CONFIDENCE, seed: int = 0) -> Interval:
    """Return the median of one filter's times over another's, with a percentile bootstrap interval over runs.

    A run that never got there may be given as infinite.
    """
    a, b = _paired(first, second)
    n = len(a)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    ratio = _quotient(np.median(a), np.median(b))
    if n == 1:
        return Interval(ratio, math.nan, math.nan, level, 1)
    rows = np.random.default_rng(seed).integers(0, n, (RESAMPLES, n))
    ratios = np.sort([_quotient(x, y) for x, y in zip(np.median(a[rows], 1), np.median(b[rows], 1), strict=True)])
    # Order statistics, not interpolation: infinite times have no mean.
    low, high = (ratios[min(RESAMPLES - 1, int(RESAMPLES * p))] for p in ((1 - level) / 2, (1 + level) / 2))
    return Interval(ratio, float(low), float(high), level, n)


def difference_of_rates(first: int, second: int, trials: int, level: float = CONFIDENCE) -> Interval:
    """Return first/trials - second/trials with the score interval of Newcombe (1998), method 10.

    It takes the two as independent; on common runs it is wider than it need be.
    """
    a, b = wilson_interval(first, trials, level), wilson_interval(second, trials, level)
    difference = a.estimate - b.estimate
    low = difference - math.hypot(a.estimate - a.low, b.high - b.estimate)
    high = difference + math.hypot(a.high - a.estimate, b.estimate - b.low)
    return Interval(difference, low, high, level, trials)


def _paired(first: ArrayLike, second: ArrayLike) -> tuple[Array, Array]:
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"paired figures need the same runs; shapes are {a.shape} and {b.shape}")
    known = ~(np.isnan(a) | np.isnan(b))
    return a[known], b[known]


def _quotient(a: float, b: float) -> float:
    if math.isinf(a) and math.isinf(b):
        return math.nan
    return math.inf if b == 0 else float(a / b)


def _student(level: float, runs: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(runs - 1, (1 + level) / 2))
