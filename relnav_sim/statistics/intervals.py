"""How sure is a figure over runs? Bootstrap intervals, paired comparison, rates, chi-square bands.

The runs are the sample: epochs of one run are correlated, runs are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.statistics import bootstrap
from relnav_sim.statistics.bootstrap import FEWEST, RESAMPLES, Method, Statistic
from relnav_sim.statistics.consistency import chi_square_quantile

Array = NDArray[np.float64]
Verdict = Literal["better", "worse", "undecided"]

_POWER = 0.8


@dataclass(frozen=True)
class Interval:
    """A figure with its interval.

    Attributes:
        estimate: The figure; NaN where no run has one.
        low: Lower end; NaN where fewer than two runs leave it unknown.
        high: Upper end.
        level: Confidence.
        runs: Runs that count: those with a number.
    """

    estimate: float
    low: float
    high: float
    level: float
    runs: int


@dataclass(frozen=True)
class Comparison:
    """Two filters on the same runs.

    Attributes:
        difference: Mean over runs of first minus second, with its interval.
        verdict: ``better``: the first is, the whole interval is on its good side; ``worse``; else ``undecided``.
        runs_to_decide: Runs at which a difference of the size seen would be told apart with a probability of
            0.8; None where the difference is zero or unknown.
        p_value: 1 minus the level at which the interval just reaches zero; 1 where nothing is known.
    """

    difference: Interval
    verdict: Verdict
    runs_to_decide: int | None
    p_value: float = 1.0


@dataclass(frozen=True)
class Band:
    """Where a figure lies with a probability when the filter is consistent."""

    low: float
    high: float
    level: float


def bootstrap_interval(
    values: ArrayLike,
    statistic: Statistic = "mean",
    level: float = 0.95,
    method: Method = "expanded",
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Return a statistic over runs with its bootstrap interval; see `bootstrap.tails` for the methods.

    A mean of fewer than `bootstrap.FEWEST` runs has Student's interval with the default method.

    Args:
        values: One figure per run (runs,); NaN: the run has none and is left out.
        statistic: What is taken over the runs.
        level: Confidence.
        method: ``expanded``, ``bca`` or ``percentile``.
        resamples: Number of resamples.
        seed: Seed of the resampling; the same for all filters pairs their resamples.
    """
    sample = _known(values)
    if len(sample) == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    estimate = float(bootstrap.over_runs(sample[None], statistic)[0])
    if len(sample) == 1:
        return Interval(estimate, math.nan, math.nan, level, 1)
    if method == "expanded" and statistic == "mean" and len(sample) < FEWEST and np.isfinite(sample).all():
        half = bootstrap.student_quantile(len(sample), level) * float(sample.std()) / math.sqrt(len(sample))
        return Interval(estimate, estimate - half, estimate + half, level, len(sample))
    drawn = bootstrap.replicates(sample, statistic, resamples, seed)
    tails = bootstrap.tails(sample, statistic, estimate, drawn, level, method)
    with np.errstate(invalid="ignore"):
        low, high = np.quantile(drawn, tails)
    return Interval(estimate, float(low), float(high), level, len(sample))


def median_interval(values: ArrayLike, level: float = 0.95) -> Interval:
    """Return the median over runs with its exact interval, two of the ordered values (Conover 1999, section 3.2).

    Infinite values count as the largest: a time that is never reached. Fewer than six runs have no interval of 95 %.
    """
    from scipy.special import bdtr

    ordered = np.sort(_known(values))
    n = len(ordered)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    middle = float((ordered[(n - 1) // 2] + ordered[n // 2]) / 2)
    # Value k (from 0) lies above the median with the probability that at most k of n coin tosses fall on one side.
    k = int(np.searchsorted(bdtr(np.arange((n + 1) // 2), n, 0.5), (1 - level) / 2, side="right")) - 1
    if k < 0:
        return Interval(middle, math.nan, math.nan, level, n)
    return Interval(middle, float(ordered[k]), float(ordered[n - 1 - k]), level, n)


def paired_difference(
    first: ArrayLike,
    second: ArrayLike,
    level: float = 0.95,
    smaller_is_better: bool = True,
    method: Method = "expanded",
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Comparison:
    """Compare two filters by the mean of their differences on common random numbers.

    Args:
        first: One figure per run (runs,).
        second: The other filter's figures for the same runs in the same order. A run counts if both are numbers.
        level: Confidence.
        smaller_is_better: True for errors, times and cost.
        method: As in `bootstrap_interval`.
        resamples: Number of resamples.
        seed: Seed of the resampling.

    Raises:
        ValueError: The two do not have the same length.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"paired figures need the same runs; shapes are {a.shape} and {b.shape}")
    differences = _known(a - b)
    interval = bootstrap_interval(differences, "mean", level, method, resamples, seed)
    verdict: Verdict = "undecided"
    if interval.high < 0 or interval.low > 0:
        verdict = "better" if (interval.high < 0) == smaller_is_better else "worse"
    p_value = 1.0
    if len(differences) > 1 and np.isfinite(differences).all():
        p_value = bootstrap.p_value(differences, bootstrap.replicates(differences, "mean", resamples, seed))
    return Comparison(interval, verdict, runs_to_decide(differences, level), p_value)


def wilson_interval(successes: int, trials: int, level: float = 0.95) -> Interval:
    """Return a rate with its score interval (Wilson 1927), good for rates near 0 and 1 too.

    Raises:
        ValueError: The successes are not between 0 and the trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} of {trials} is no rate")
    if trials == 0:
        return Interval(math.nan, 0.0, 1.0, level, 0)
    z, n, rate = _normal_quantile((1 + level) / 2), trials, successes / trials
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return Interval(rate, low, high, level, trials)


def chi_square_band(
    runs: int, dof: int, effective_samples: float = 1.0, level: float = 0.95, normalised: bool = True
) -> Band:
    """Return where the mean of a NEES or NIS over runs lies when the filter is consistent.

    The sum over M independent runs is chi-square with M n degrees of freedom (Bar-Shalom, Li and Kirubarajan
    2001, section 5.4.2). A mean over time as well has more, but successive epochs are correlated: see
    `effective_samples`.

    Args:
        runs: Runs averaged.
        dof: Dimension n of the error or innovation.
        effective_samples: Independent samples per run; 1 for a single epoch.
        level: Probability of the band.
        normalised: For means divided by n (ANEES, near 1); else for the mean itself (NIS, near n).

    Raises:
        ValueError: A count is not positive.
    """
    if runs < 1 or dof < 1 or effective_samples <= 0:
        raise ValueError("a band needs at least one run, one dimension and some samples")
    total = runs * dof * effective_samples
    scale = total if normalised else runs * effective_samples
    low, high = (chi_square_quantile(p, total) / scale for p in ((1 - level) / 2, (1 + level) / 2))
    return Band(low, high, level)


def effective_samples(span_s: float, correlation_time_s: float) -> float:
    """Return how many independent samples a span of a process with an exponential correlation holds, at least 1."""
    return max(1.0, span_s / (2 * correlation_time_s))


def lag1_band(samples: int, level: float = 0.95) -> Band:
    """Return where the lag-1 autocorrelation of white noise lies (Bartlett 1946), samples >> 1."""
    half = _normal_quantile((1 + level) / 2) / math.sqrt(max(1, samples))
    return Band(-half, half, level)


def _known(values: ArrayLike) -> Array:
    sample = np.asarray(values, dtype=np.float64)
    return sample[~np.isnan(sample)]


def runs_to_decide(differences: Array, level: float = 0.95) -> int | None:
    """Return how many runs would tell a mean difference of the size seen from zero with a probability of 0.8.

    The usual sample size of a paired test, ((z_(1 + level) / 2 + z_0.8) s / d)^2; None where there is no difference
    or fewer than two runs.
    """
    if len(differences) < 2 or not np.isfinite(differences).all():
        return None
    mean, spread = abs(float(differences.mean())), float(differences.std(ddof=1))
    if mean == 0:
        return None
    z = _normal_quantile((1 + level) / 2) + _normal_quantile(_POWER)
    runs = (z * spread / mean) ** 2
    return max(2, math.ceil(runs)) if math.isfinite(runs) else None


def _normal_quantile(probability: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(probability))
