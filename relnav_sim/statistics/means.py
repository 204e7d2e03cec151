"""The interval of a mean over runs, and how improbable another mean is: Student's or Hall's, whichever reaches farther.

Student's interval is right for normal samples and long enough where both tails are heavy, and too short on the side of
the longer tail where they are not alike. Hall's (1992) takes the skewness out of Student's statistic and is right for
skewed samples, and too short where both tails are heavy. A sample of runs does not say which it is, so each end of the
interval is that of the two which lies farther out. docs/statistics.md has the measured coverage.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array

_SYMMETRIC = 1e-8  # below this Hall's interval is Student's to rounding, and its formula loses digits


def mean_limits(sample: Array, level: float) -> tuple[float, float]:
    """Return the two-sided interval of the mean.

    Args:
        sample: One figure per run (runs,), at least two.
        level: Confidence.
    """
    from scipy.special import stdtrit

    mean, error, skewness = _moments(sample)
    quantile = float(stdtrit(len(sample) - 1, (1 + level) / 2))
    below, above = quantile, quantile
    if abs(skewness) > _SYMMETRIC:
        below = max(below, _from_hall(quantile, skewness))
        above = max(above, -_from_hall(-quantile, skewness))
    return mean - below * error, mean + above * error


def p_value(sample: Array, mean: float = 0.0) -> float:
    """Return the two-sided p-value of a mean: 1 minus the level at which the interval just reaches it.

    Args:
        sample: One figure per run (runs,), at least two.
        mean: The mean in question.
    """
    from scipy.special import stdtr

    found, error, skewness = _moments(sample)
    if error == 0:
        return 1.0 if found == mean else 0.0
    away = (found - mean) / error
    nearest = min(abs(away), math.copysign(1.0, away) * _to_hall(away, skewness))
    return min(1.0, 2 * float(stdtr(len(sample) - 1, -nearest)))


def _moments(sample: Array) -> tuple[float, float, float]:
    """Return the mean, its standard error, and the skewness over the root of the number of runs."""
    n, mean = len(sample), float(sample.mean())
    deviations = sample - mean
    size = float(np.abs(deviations).max())
    if size == 0:
        return mean, 0.0, 0.0
    deviations = deviations / size  # so that no power of a diverged filter's errors overflows
    variance = float(np.square(deviations).mean())
    return mean, size * math.sqrt(variance / (n - 1)), float((deviations**3).mean()) / variance**1.5 / math.sqrt(n)


def _to_hall(t: float, skewness: float) -> float:
    """Return Student's statistic without its skewness (Hall 1992); it grows with t."""
    return t + skewness * t**2 / 3 + skewness**2 * t**3 / 27 + skewness / 6


def _from_hall(y: float, skewness: float) -> float:
    """Return the t of which `_to_hall` is y."""
    return 3 / skewness * (float(np.cbrt(1 + skewness * (y - skewness / 6))) - 1)
