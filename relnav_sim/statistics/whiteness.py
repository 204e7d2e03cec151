"""Are residuals white? Their autocorrelation, and whether it is more than chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.intervals import lag1_band

LAGS = 50
"""Most lags that are looked at; a series has at least five values for each."""


@dataclass(frozen=True)
class Whiteness:
    """How a series is correlated with itself.

    Attributes:
        count: Number of values.
        correlation: Autocorrelation at the lags 1, 2, ..., (L,); empty for fewer than ten values.
        bound: How large that of white noise is at one lag, in 95 % of all cases.
        statistic: Ljung and Box's Q over all lags; NaN without lags.
        p_value: Probability that white noise has a larger Q; NaN without lags.
    """

    count: int
    correlation: Array
    bound: float
    statistic: float
    p_value: float

    @property
    def lags(self) -> int:
        """Number L of lags."""
        return len(self.correlation)

    @property
    def outside(self) -> float:
        """Share of the lags outside the bound; of white noise 0.05. NaN without lags."""
        return float(np.mean(np.abs(self.correlation) > self.bound)) if self.lags else float("nan")


def whiteness(series: Sequence[Array], most_lags: int = LAGS) -> Whiteness:
    """Return how successive values of some runs are correlated.

    The mean over all runs is taken out first, so that an offset, which is judged by itself, does not count as
    correlation. Q = N (N + 2) sum r_k^2 / n_k is chi-square with as many degrees of freedom as lags for white noise
    (Ljung and Box, Biometrika 65(2), 1978), with n_k the number of pairs at lag k, N - k in one run. Residuals of a
    filter have no parameters fitted to them.

    Args:
        series: The values of each run in order, (N_r,), without gaps: a measurement follows the one before.
        most_lags: Most lags.

    Examples:
        >>> import numpy as np
        >>> alternating = whiteness([np.array([1.0, -1.0] * 50)])
        >>> alternating.correlation[:2].round(2).tolist(), bool(alternating.p_value < 1e-9)
        ([-0.99, 0.98], True)
    """
    runs = [np.asarray(run, dtype=float) for run in series if len(run)]
    count = sum(map(len, runs))
    lags = min(most_lags, max((len(run) for run in runs), default=0) // 5)
    mean = float(np.concatenate(runs).mean()) if count else 0.0
    runs = [run - mean for run in runs]
    square = sum(float(run @ run) for run in runs)
    pairs = np.array([sum(max(0, len(run) - k) for run in runs) for k in range(1, lags + 1)])
    products = [sum(float(run[k:] @ run[:-k]) for run in runs if len(run) > k) for k in range(1, lags + 1)]
    return of_products(count, square, np.array(products), pairs)


def of_products(count: int, square: float, products: Array, pairs: Array) -> Whiteness:
    """Return how a series is correlated with itself, from sums over all its runs.

    Args:
        count: Number of values.
        square: Sum of their squares about the mean.
        products: Sum over the pairs at the lags 1, 2, ... of their products about the mean (L,).
        pairs: Number of these pairs (L,).
    """
    lags, low = len(products), lag1_band(count, CONFIDENCE).low
    if lags < 2:
        return Whiteness(count, np.zeros(0), -low, float("nan"), float("nan"))
    if not square > 0:  # all values are the same
        return Whiteness(count, np.zeros(lags), -low, 0.0, 1.0)
    correlation = products / square
    statistic = float(count * (count + 2) * np.sum(np.square(correlation) / pairs))
    return Whiteness(count, correlation, -low, statistic, _chi_square_tail(statistic, lags))


def _chi_square_tail(value: float, dof: int) -> float:
    from scipy.special import chdtrc

    return float(chdtrc(dof, value))
