"""How sure is a share? Exact intervals for counts over runs, and for epochs that are correlated within their run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.intervals import Interval


@dataclass(frozen=True)
class Share:
    """A share of trials, as its interval and the certainty of any claim about it see it.

    Attributes:
        estimate: The share; NaN without trials.
        trials: Independent trials that carry as much information; for counts over runs, the runs.
        runs: Runs that it comes from.
    """

    estimate: float
    trials: float
    runs: int

    def interval(self, level: float = CONFIDENCE) -> Interval:
        """Return the exact interval (Clopper and Pearson 1934)."""
        from scipy.special import betaincinv

        if self.trials <= 0:
            return Interval(math.nan, 0.0, 1.0, level, 0)
        hits, misses, tail = *self._counts(), (1 - level) / 2
        low = float(betaincinv(hits, misses + 1, tail)) if hits > 0 else 0.0
        high = float(betaincinv(hits + 1, misses, 1 - tail)) if misses > 0 else 1.0
        return Interval(self.estimate, low, high, level, self.runs)

    def certainty_at_least(self, limit: float) -> float:
        """Return the largest one-sided confidence at which the share is at least ``limit``."""
        from scipy.special import betainc

        if self.trials <= 0 or self._counts()[0] <= 0:
            return 0.0
        hits, misses = self._counts()
        return 1 - float(betainc(hits, misses + 1, limit))

    def certainty_below(self, limit: float) -> float:
        """Return the largest one-sided confidence at which the share is below ``limit``."""
        from scipy.special import betainc

        if self.trials <= 0 or self._counts()[1] <= 0:
            return 0.0
        hits, misses = self._counts()
        return float(betainc(hits + 1, misses, limit))

    def _counts(self) -> tuple[float, float]:
        hits = self.estimate * self.trials
        return hits, self.trials - hits


def share_of_runs(successes: int, runs: int) -> Share:
    """Return a share of runs, which are independent.

    Raises:
        ValueError: The successes are not between 0 and the runs.
    """
    if not 0 <= successes <= runs:
        raise ValueError(f"{successes} of {runs} is no share")
    return Share(successes / runs if runs else math.nan, float(runs), runs)


def share_of_epochs(hits: ArrayLike, epochs: ArrayLike, level: float = CONFIDENCE) -> Share:
    """Return a share of the epochs of all runs, which are correlated within their run.

    The spread between runs tells how many independent trials the epochs are worth (Korn and Graubard 1998):
    n_eff = p (1 - p) / var(p), with var(p) that of the ratio estimate over runs, times (t_epochs / t_runs)^2 for the
    degrees of freedom. It is at most the number of epochs. Where every epoch of every run is a hit (or none is) the
    spread tells nothing, and n_eff is the number of runs: a single event could fill a whole run.

    Args:
        hits: Epochs that count as hits, one number per run (runs,).
        epochs: Epochs of each run (runs,); runs without any are left out.
        level: The level of the interval to come, for the degrees of freedom.

    Raises:
        ValueError: The two do not have the same length, or a run has more hits than epochs.
    """
    from scipy.special import stdtrit

    x, n = np.asarray(hits, dtype=float), np.asarray(epochs, dtype=float)
    if x.shape != n.shape or x.ndim != 1 or (x > n).any() or (x < 0).any():
        raise ValueError("hits and epochs need one number per run, with no more hits than epochs")
    x, n = x[n > 0], n[n > 0]
    runs, total = len(x), float(n.sum())
    if runs == 0:
        return Share(math.nan, 0.0, 0)
    share = float(x.sum() / total)
    if runs == 1 or share in (0.0, 1.0):
        return Share(share, float(runs), runs)
    variance = runs / (runs - 1) * float(np.square(x - share * n).sum()) / total**2
    if variance == 0:
        return Share(share, total, runs)
    tail = (1 + level) / 2
    freedom = float(stdtrit(max(total - 1, 1), tail) / stdtrit(runs - 1, tail))
    return Share(share, min(total, share * (1 - share) / variance * freedom**2), runs)


def runs_for_share(share: Share, limit: float, level: float = CONFIDENCE, most: int = 10_000_000) -> int | None:
    """Return how many runs would show that a share like this one lies on its side of ``limit``; None: no number would.

    The trials grow with the runs; the share stays as it is.
    """
    if share.runs == 0 or share.estimate == limit:
        return None

    def decided(runs: int) -> bool:
        grown = Share(share.estimate, share.trials / share.runs * runs, runs).interval(level)
        return grown.low >= limit or grown.high < limit

    low, high = 0, max(2, share.runs)
    while not decided(high):
        low, high = high, 2 * high
        if high > most:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if decided(middle) else (middle, high)
    return high
