"""How sure is a figure over runs? Bootstrap intervals, paired comparison, rates, chi-square bands.

The runs are the sample: epochs of one run are correlated, runs are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.statistics.consistency import chi_square_quantile

Array = NDArray[np.float64]
Statistic = Literal["mean", "median", "rms", "std"]
Method = Literal["bca", "percentile"]
Verdict = Literal["better", "worse", "undecided"]

RESAMPLES = 2000
_POWER = 0.8
_PIECE = 2_000_000


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
    """

    difference: Interval
    verdict: Verdict
    runs_to_decide: int | None


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
    method: Method = "bca",
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Return a statistic over runs with its bootstrap interval.

    ``bca`` is bias-corrected and accelerated (Efron 1987; Efron and Tibshirani 1993, eqs. 14.9-14.15). Where the
    resamples all lie on one side of the estimate it is not defined, and the percentile interval is returned.

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
    estimate = float(_over_runs(sample[None], statistic)[0])
    if len(sample) == 1:
        return Interval(estimate, math.nan, math.nan, level, 1)
    replicates = _replicates(sample, statistic, resamples, seed)
    tails = np.array([(1 - level) / 2, (1 + level) / 2])
    if method == "bca":
        tails = _bca_tails(sample, statistic, estimate, replicates, tails)
    with np.errstate(invalid="ignore"):
        low, high = np.quantile(replicates, tails)
    return Interval(estimate, float(low), float(high), level, len(sample))


def paired_difference(
    first: ArrayLike,
    second: ArrayLike,
    level: float = 0.95,
    smaller_is_better: bool = True,
    method: Method = "bca",
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
    return Comparison(interval, verdict, _runs_to_decide(differences, level))


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


def _over_runs(samples: Array, statistic: Statistic) -> Array:
    """Return the statistic along the last axis."""
    with np.errstate(invalid="ignore", over="ignore"):
        match statistic:
            case "mean":
                return np.asarray(samples.mean(axis=-1))
            case "median":
                return np.asarray(np.median(samples, axis=-1))
            case "rms":
                return np.asarray(np.sqrt(np.square(samples).mean(axis=-1)))
            case "std":
                return np.asarray(samples.std(axis=-1, ddof=1))


def _replicates(sample: Array, statistic: Statistic, resamples: int, seed: int) -> Array:
    """Return the statistic of each resample; drawn in pieces that bound the memory, which changes no number."""
    rng = np.random.default_rng(seed)
    rows = max(1, _PIECE // len(sample))
    pieces = [
        _over_runs(sample[rng.integers(0, len(sample), (min(rows, resamples - start), len(sample)))], statistic)
        for start in range(0, resamples, rows)
    ]
    return np.concatenate(pieces)


def _without_each(sample: Array, statistic: Statistic) -> Array:
    """Return the statistic of the sample with each run left out in turn, in no particular order."""
    n = len(sample)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        match statistic:
            case "mean":
                return np.asarray((sample.sum() - sample) / (n - 1))
            case "rms":
                squares = np.square(sample)
                return np.asarray(np.sqrt(np.maximum(squares.sum() - squares, 0.0) / (n - 1)))
            case "std":
                deviations = np.square(sample - sample.mean())
                rest = deviations.sum() - deviations * (n / (n - 1))
                return np.asarray(np.sqrt(np.maximum(rest, 0.0) / (n - 2)))
            case "median":
                ordered, rank = np.sort(sample), np.arange(n)
                # Rank k of the rest is rank k of the whole, or k + 1 where the run left out stands before it.
                low, high = (n - 2) // 2, (n - 1) // 2
                return np.asarray((ordered[low + (rank <= low)] + ordered[high + (rank <= high)]) / 2)


def _bca_tails(sample: Array, statistic: Statistic, estimate: float, replicates: Array, tails: Array) -> Array:
    """Return the probabilities at which the bias-corrected and accelerated interval takes its quantiles."""
    from scipy.special import ndtr, ndtri

    below = ((replicates < estimate).mean() + (replicates <= estimate).mean()) / 2
    if below in (0.0, 1.0):
        return tails
    jackknife = _without_each(sample, statistic)
    spread = jackknife.mean() - jackknife
    squares = np.square(spread).sum()
    acceleration = (spread**3).sum() / (6 * squares**1.5) if squares > 0 else 0.0
    bias = ndtri(below)
    shifted = bias + ndtri(tails)
    corrected: Array = ndtr(bias + shifted / (1 - acceleration * shifted))
    return corrected if np.isfinite(corrected).all() else tails


def _runs_to_decide(differences: Array, level: float) -> int | None:
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
