"""How sure is a figure over runs? Intervals of means, medians and rates, paired comparison, chi-square bands.

The runs are the sample: epochs of one run are correlated, runs are not.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics import bootstrap
from relnav_sim.statistics.bootstrap import RESAMPLES, Method, Statistic
from relnav_sim.statistics.consistency import chi_square_quantile
from relnav_sim.statistics.means import mean_limits
from relnav_sim.statistics.multiple import holm
from relnav_sim.statistics.sign_flip import SignFlips, fewest_runs, sign_flips

Verdict = Literal["better", "worse", "undecided"]
Key = TypeVar("Key", bound=Hashable)

_POWER = 0.8


@dataclass(frozen=True)
class Interval:
    """A figure with its interval.

    Attributes:
        estimate: The figure; NaN where no run has one.
        low: Lower end; NaN where too few runs leave it unknown.
        high: Upper end; likewise.
        level: Confidence.
        runs: Runs that count: those with a number.
    """

    estimate: float
    low: float
    high: float
    level: float
    runs: int


NO_INTERVAL = Interval(math.nan, math.nan, math.nan, CONFIDENCE, 0)
"""Of a figure that no run has."""


@dataclass(frozen=True)
class Comparison:
    """Two filters on the same runs.

    Attributes:
        difference: Mean over runs of first minus second, with its interval.
        verdict: ``better``: the first is, the whole interval is on its good side; ``worse``; else ``undecided``.
        runs_to_decide: Runs at which a difference of the size seen would be significant with a probability of
            0.8; None where the difference is zero or unknown.
        p_value: Of a mean difference of zero, by the sign-flip test; 1 where nothing is known.
        simultaneous: The difference with an interval that holds for all pairs together, decided or not (Bonferroni):
            what a verdict of equivalence must go by.
    """

    difference: Interval
    verdict: Verdict
    runs_to_decide: int | None
    p_value: float = 1.0
    simultaneous: Interval = NO_INTERVAL


@dataclass(frozen=True)
class Band:
    """Where a figure lies with a probability when the filter is consistent."""

    low: float
    high: float
    level: float


def mean_interval(values: ArrayLike, level: float = CONFIDENCE, most: float = math.inf) -> Interval:
    """Return the mean over runs with its interval; see `means` for the method.

    The mean of figures none of which is negative has no interval below zero.

    Args:
        values: One figure per run (runs,); NaN: the run has none and is left out.
        level: Confidence.
        most: The largest value that the figure can have, as 100 for a percentage.
    """
    sample = _known(values)
    if len(sample) == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = float(sample.mean())
    if len(sample) == 1 or not math.isfinite(mean):
        return Interval(mean, math.nan, math.nan, level, len(sample))
    low, high = mean_limits(sample, level)
    return Interval(mean, max(low, 0.0) if sample.min() >= 0 else low, min(high, most), level, len(sample))


def bootstrap_interval(
    values: ArrayLike,
    statistic: Statistic = "mean",
    level: float = CONFIDENCE,
    method: Method = "bca",
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Return a statistic over runs with its bootstrap interval; see `bootstrap.tails` for the methods.

    For a mean `mean_interval` keeps its promise in smaller samples.

    Args:
        values: One figure per run (runs,); NaN: the run has none and is left out.
        statistic: What is taken over the runs.
        level: Confidence.
        method: ``bca`` or ``percentile``.
        resamples: Number of resamples.
        seed: Seed of the resampling; the same for all filters pairs their resamples.
    """
    sample = _known(values)
    if len(sample) == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    estimate = float(bootstrap.over_runs(sample[None], statistic)[0])
    if len(sample) == 1:
        return Interval(estimate, math.nan, math.nan, level, 1)
    drawn = bootstrap.replicates(sample, statistic, resamples, seed)
    tails = bootstrap.tails(sample, statistic, estimate, drawn, level, method)
    with np.errstate(invalid="ignore"):
        low, high = np.quantile(drawn, tails)
    return Interval(estimate, float(low), float(high), level, len(sample))


def median_interval(values: ArrayLike, level: float = CONFIDENCE) -> Interval:
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
    first: ArrayLike, second: ArrayLike, level: float = CONFIDENCE, smaller_is_better: bool = True
) -> Comparison:
    """Compare two filters by the mean of their differences on common random numbers.

    Args:
        first: One figure per run (runs,).
        second: The other filter's figures for the same runs in the same order. A run counts if both are numbers.
        level: Confidence.
        smaller_is_better: True for errors, times and cost.

    Raises:
        ValueError: The two do not have the same length.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"paired figures need the same runs; shapes are {a.shape} and {b.shape}")
    with np.errstate(invalid="ignore"):
        return paired_differences({"": a - b}, level, smaller_is_better)[""]


def paired_differences(
    differences: Mapping[Key, ArrayLike], level: float = CONFIDENCE, smaller_is_better: bool = True
) -> dict[Key, Comparison]:
    """Compare several pairs so that with a probability of ``level`` no verdict is wrong.

    Each pair has the sign-flip test, all together Holm's procedure. The intervals are widened for the u pairs that stay
    undecided, to 1 - (1 - level) / u: zero lies in them exactly where the verdict is undecided. That of a decided pair
    leaves zero out, because Holm's procedure asked it for a smaller p-value than the undecided ones.

    Args:
        differences: First minus second on each common run (runs,), by whatever tells the comparisons apart. NaN: the
            run has none and is left out.
        level: Confidence in all verdicts together.
        smaller_is_better: True for errors, times and cost.
    """
    samples = {key: _known(values) for key, values in differences.items()}
    family, alpha = len(samples), 1 - level
    tests: dict[Key, SignFlips] = {}
    for runs in sorted({len(sample) for sample in samples.values()} - {0, 1}):
        alike = [key for key, sample in samples.items() if len(sample) == runs and np.isfinite(sample).all()]
        if alike:
            tests |= zip(alike, sign_flips(np.stack([samples[key] for key in alike]), level, family), strict=True)
    p_values = dict(zip(samples, holm([tests[key].p_value if key in tests else 1.0 for key in samples]), strict=True))
    undecided = sum(p_value > alpha for p_value in p_values.values())
    found = {}
    for key, sample in samples.items():
        interval = _of_differences(sample, tests.get(key), 1 - alpha / max(1, undecided))
        verdict: Verdict = "undecided"
        if p_values[key] <= alpha:
            verdict = "better" if (interval.estimate < 0) == smaller_is_better else "worse"
        needed = runs_to_decide(sample, 1 - alpha / family)
        if needed is not None:
            needed = max(needed, fewest_runs_to_decide(family, level))
        simultaneous = _of_differences(sample, tests.get(key), 1 - alpha / family)
        found[key] = Comparison(interval, verdict, needed, p_values[key], simultaneous)
    return found


def fewest_runs_to_decide(pairs: int, level: float = CONFIDENCE) -> int:
    """Return the number of runs below which no pair of a family can be decided, however large its difference."""
    return fewest_runs((1 - level) / max(1, pairs))


def wilson_interval(successes: int, trials: int, level: float = CONFIDENCE) -> Interval:
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
    runs: int, dof: int, effective_samples: float = 1.0, level: float = CONFIDENCE, normalised: bool = True
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


def sum_band(dof: float, divisor: float, level: float = CONFIDENCE) -> Band:
    """Return where a sum of independent chi-square figures divided by something lies when the filter is consistent.

    The sum is chi-square with the sum of their degrees of freedom, which may differ from one to the next: partial
    measurements have fewer.

    Args:
        dof: Degrees of freedom of the sum.
        divisor: What the sum is divided by: the degrees themselves for a figure near 1, or the number of updates.
        level: Probability of the band.

    Raises:
        ValueError: The degrees or the divisor are not positive.
    """
    if dof <= 0 or divisor <= 0:
        raise ValueError("a band needs at least one degree of freedom, and something to divide by")
    low, high = (chi_square_quantile(p, dof) / divisor for p in ((1 - level) / 2, (1 + level) / 2))
    return Band(low, high, level)


def effective_samples(span_s: float, correlation_time_s: float) -> float:
    """Return how many independent samples a span of a process with an exponential correlation holds, at least 1."""
    return max(1.0, span_s / (2 * correlation_time_s))


def lag1_band(samples: int, level: float = CONFIDENCE) -> Band:
    """Return where the lag-1 autocorrelation of white noise lies (Bartlett 1946), samples >> 1."""
    half = _normal_quantile((1 + level) / 2) / math.sqrt(max(1, samples))
    return Band(-half, half, level)


def _of_differences(sample: Array, test: SignFlips | None, level: float) -> Interval:
    """Return the mean of differences with the interval of their test; enough runs that never differ are equal."""
    if len(sample) == 0:
        return Interval(math.nan, math.nan, math.nan, level, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = float(sample.mean())
    low, high = (math.nan, math.nan) if test is None else test.limits(level)
    if len(sample) >= fewest_runs(1 - level) and not sample.any():
        low, high = 0.0, 0.0
    return Interval(mean, low, high, level, len(sample))


def _known(values: ArrayLike) -> Array:
    sample = np.asarray(values, dtype=np.float64)
    return sample[~np.isnan(sample)]


def runs_to_decide(differences: Array, level: float = CONFIDENCE) -> int | None:
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
