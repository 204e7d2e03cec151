"""Regret of filters in several cases, with intervals that hold for all of them together.

The regret of filter i in a case is m_i / min_j m_j - 1, with m the mean over runs of the RMS error. Its logarithm is
the largest of the differences log m_i - log m_j over all j, so that intervals of all these differences which hold
together give one of it: the largest of their lower and of their upper ends (multiple comparisons with the best, Hsu
1981). No filter is taken for the best beforehand, so that a lucky one's luck is not counted against the others.

The differences are studentised and bootstrapped over runs; a resample takes the same runs of every filter and case.
Critical values are balanced (Beran 1988): each difference has its own, at the one probability at which all intervals
together keep the level, so that a filter which is lost in a few runs widens its own intervals and not those of others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.bootstrap import drawn_counts

RESAMPLES = 10_000


@dataclass(frozen=True)
class _Pairs:
    """All pairs of the filters of one case that completed every run that counts.

    Attributes:
        case: Number of the case.
        first: Places of the first filters (P,).
        second: Places of the second filters (P,).
        relative: RMS of every filter over its mean, (F, n); 0 where it does not count.
        counts: Which runs count (n,).
        log_ratio: log m_first - log m_second (P,).
    """

    case: int
    first: Indices
    second: Indices
    relative: Array
    counts: Mask
    log_ratio: Array

    @property
    def y(self) -> Array:
        """Relative RMS of the first less the second, (P, n): the influence of each run on the log ratio."""
        return np.asarray(self.relative[self.first] - self.relative[self.second])


def simultaneous_regret(rms: Array, level: float = CONFIDENCE, seed: int = 0) -> tuple[Array, Array, Array]:
    """Return the regret of every filter in every case with the ends of its interval, (cases, filters) each.

    A filter that failed in a run has no RMS there, which counts as infinite, and so is its regret. Runs in which every
    filter of the case failed count for none. Where no filter completed the others there is no regret (NaN).

    Args:
        rms: RMS over time of each run (cases, filters, runs), none negative; infinite: the filter failed.
        level: Confidence in all intervals together.
        seed: Seed of the resampling.

    Returns:
        Regret, lower and upper ends. The upper end is infinite where there are too few runs to know one.
    """
    C, F, n = rms.shape
    regret, low, high = (np.full((C, F), np.nan) for _ in range(3))
    pairs = []
    for case in range(C):
        counts: Mask = np.asarray(np.isfinite(rms[case]).any(axis=0))
        sound = np.flatnonzero(np.isfinite(rms[case][:, counts]).all(axis=1))
        if not counts.any() or not len(sound):
            continue
        regret[case] = low[case] = high[case] = np.inf
        means = rms[case][np.ix_(sound, counts)].mean(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            regret[case, sound] = np.where(means == means.min(), 0.0, means / means.min() - 1)
        low[case, sound], high[case, sound] = 0.0, np.inf
        if means.min() > 0:
            pairs.append(_pairs(case, rms[case], sound, counts))
    if n > 1 and sum(len(each.first) for each in pairs):
        for each, half in zip(pairs, _half_widths(pairs, n, level, seed), strict=True):
            _fill(each, half, low, high)
    for each in pairs:
        if len(each.first) == 0:  # the only one that completed its runs
            high[each.case][np.isfinite(regret[each.case])] = 0.0
    return regret, low, high


def _pairs(case: int, rms: Array, sound: Indices, counts: Mask) -> _Pairs:
    both = np.array(list(itertools.combinations(sound, 2)), dtype=int).reshape(-1, 2)
    means = np.ones(len(rms))
    means[sound] = rms[np.ix_(sound, counts)].mean(axis=1)
    relative = np.zeros(rms.shape)
    relative[np.ix_(sound, counts)] = rms[np.ix_(sound, counts)] / means[sound, None]
    first, second = both.T
    return _Pairs(case, first, second, relative, counts, np.log(means[first]) - np.log(means[second]))


def _fill(pairs: _Pairs, half: Array, low: Array, high: Array) -> None:
    """Set the ends of a case: the largest over the other filters, and zero, which a filter has against itself."""
    involved = np.unique(np.concatenate([pairs.first, pairs.second]))
    high[pairs.case, involved] = 0.0
    with np.errstate(over="ignore"):  # a few runs leave the upper end all but open
        for one, sign in ((pairs.first, 1.0), (pairs.second, -1.0)):
            np.maximum.at(low[pairs.case], one, np.expm1(sign * pairs.log_ratio - half))
            np.maximum.at(high[pairs.case], one, np.expm1(sign * pairs.log_ratio + half))


def _half_widths(pairs: Sequence[_Pairs], n: int, level: float, seed: int) -> Iterator[Array]:
    """Yield half the width of the interval of each log ratio, by case (P,)."""
    drawn = [
        np.concatenate([_studentised(each, counts) for each in pairs], axis=1)
        for counts in drawn_counts(n, RESAMPLES, seed)
    ]
    t = np.sort(whole := np.concatenate(drawn), axis=0)
    ranks = np.stack([np.searchsorted(t[:, k], whole[:, k], side="right") for k in range(t.shape[1])], axis=1)
    kept = np.sort(ranks.max(axis=1))[math.ceil(level * RESAMPLES) - 1]
    critical = t[kept - 1]
    start = 0
    for each in pairs:
        error = np.sqrt(np.square(each.y).sum(axis=1)) / each.counts.sum()
        own = critical[start : start + len(error)]
        # Runs that never differ are surely equal.
        yield np.where(error > 0, own * np.where(error > 0, error, 1.0), 0.0)
        start += len(error)


def _studentised(pairs: _Pairs, drawn: Array) -> Array:
    """Return how far each resample's log ratios are from the sample's, in their own standard errors, (resamples, P).

    With the relative RMS p = x / m and r its mean over the resample, log(r_i / r_j) is the deviation, and its influence
    p_i / r_i - p_j / r_j = (y - p_j ybar / r_j) / r_i, where nothing cancels if two filters nearly agree.
    """
    y, second = pairs.y, pairs.second
    p = pairs.relative
    runs = (drawn @ pairs.counts)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = drawn @ y.T / runs
        r = drawn @ p.T / runs
        r_i, r_j = r[:, pairs.first], r[:, second]
        lean = mean / r_j
        squares = (
            drawn @ np.square(y).T
            - 2 * lean * (drawn @ (y * p[second]).T)
            + lean**2 * (drawn @ np.square(p).T)[:, second]
        )
        error = np.sqrt(np.maximum(squares, 0.0)) / (runs * r_i)
        t = np.abs(np.log1p(lean)) / error
    equal = ~y.any(axis=1)
    # A resample of one run over and over tells no spread.
    return np.where(equal, 0.0, np.where(np.isfinite(t), t, np.inf))
