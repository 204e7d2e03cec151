"""Resampling of runs: replicates of a statistic, and the tails of its interval.

The resamples of a sample of n runs depend on n and the seed alone, so they are drawn once and kept, as the number of
times that each run was drawn: a mean over all resamples is then one product.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array, Integers

Statistic = Literal["mean", "median", "rms", "std"]
Method = Literal["bca", "percentile"]

RESAMPLES = 2000
_PIECE = 2_000_000
_TIED = 16  # in smaller samples a resample often is the sample in another order, and rounding must not part the two
_KEPT = 4_000_000  # counts of one set of resamples that are worth keeping, 32 MB


def over_runs(samples: Array, statistic: Statistic) -> Array:
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


def replicates(sample: Array, statistic: Statistic, resamples: int, seed: int) -> Array:
    """Return the statistic of each resample (resamples,)."""
    n = len(sample)
    if n < _TIED or resamples * n > _KEPT or not np.isfinite(sample).all():
        return _one_by_one(sample, statistic, resamples, seed)
    counts = _counts(n, resamples, seed)
    with np.errstate(over="ignore", invalid="ignore"):
        match statistic:
            case "mean":
                return np.asarray(counts @ sample / n)
            case "rms":
                return np.asarray(np.sqrt(counts @ np.square(sample) / n))
            case "std":
                deviations = sample - sample.mean()
                squares = counts @ np.square(deviations) - np.square(counts @ deviations) / n
                return np.asarray(np.sqrt(np.maximum(squares, 0.0) / (n - 1)))
            case "median":
                order = np.argsort(sample)
                held = np.cumsum(counts[:, order], axis=1)
                low, high = (np.argmax(held > rank, axis=1) for rank in ((n - 1) // 2, n // 2))
                return np.asarray((sample[order][low] + sample[order][high]) / 2)


def tails(
    sample: Array, statistic: Statistic, estimate: float, drawn: Array, level: float, method: Method
) -> tuple[float, float]:
    """Return the probabilities at which the interval takes the quantiles of the replicates.

    ``bca`` is bias-corrected and accelerated (Efron 1987; Efron and Tibshirani 1993, eqs. 14.9-14.15). Where the
    replicates all lie on one side of the estimate it is not defined, and the plain percentiles are returned.
    """
    from scipy.special import ndtr, ndtri

    plain = (1 - level) / 2, (1 + level) / 2
    if method == "percentile":
        return plain
    found = _bias_and_acceleration(sample, statistic, estimate, drawn)
    if found is None:
        return plain
    bias, acceleration = found
    quantile = float(ndtri(plain[1]))
    shifted = bias + np.array([-quantile, quantile])
    corrected = ndtr(bias + shifted / (1 - acceleration * shifted))
    return (float(corrected[0]), float(corrected[1])) if np.isfinite(corrected).all() else plain


def without_each(sample: Array, statistic: Statistic) -> Array:
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


def _bias_and_acceleration(
    sample: Array, statistic: Statistic, estimate: float, drawn: Array
) -> tuple[float, float] | None:
    from scipy.special import ndtri

    below = ((drawn < estimate).mean() + (drawn <= estimate).mean()) / 2
    if below in (0.0, 1.0):
        return None
    jackknife = without_each(sample, statistic)
    spread = jackknife.mean() - jackknife
    squares = np.square(spread).sum()
    acceleration = float((spread**3).sum() / (6 * squares**1.5)) if squares > 0 else 0.0
    return float(ndtri(below)), acceleration


def _one_by_one(sample: Array, statistic: Statistic, resamples: int, seed: int) -> Array:
    """Return the replicates from the resamples themselves, drawn in pieces that bound the memory."""
    return np.concatenate([over_runs(sample[rows], statistic) for rows in _resamples(len(sample), resamples, seed)])


@functools.lru_cache(maxsize=8)
def _counts(n: int, resamples: int, seed: int) -> Array:
    """Return how often each run stands in each resample, (resamples, n)."""
    rows = np.concatenate(list(_resamples(n, resamples, seed))) + n * np.arange(resamples)[:, None]
    counts = np.bincount(rows.ravel(), minlength=n * resamples).reshape(resamples, n).astype(np.float64)
    counts.flags.writeable = False
    return counts


def drawn_counts(n: int, resamples: int, seed: int) -> Iterator[Array]:
    """Yield how often each run stands in each resample, in pieces (rows, n) that bound the memory."""
    for rows in _resamples(n, resamples, seed):
        places = rows + n * np.arange(len(rows))[:, None]
        yield np.bincount(places.ravel(), minlength=n * len(rows)).reshape(len(rows), n).astype(np.float64)


def _resamples(n: int, resamples: int, seed: int) -> Iterator[Integers]:
    """Yield the resamples, pieces of (rows, n) run indices; the pieces change no number."""
    rng = np.random.default_rng(seed)
    rows = max(1, _PIECE // n)
    for start in range(0, resamples, rows):
        yield rng.integers(0, n, (min(rows, resamples - start), n))
