"""How far from the Cramér-Rao bound is a filter? The RMS of its error over runs and time, in multiples of the bound's.

The bound is one on the mean square over runs. So both are root mean squares over the same runs and epochs: the mean of
each run's own RMS is smaller than that (Jensen's inequality), most where an error changes little within a run, and
would put a filter below a bound that nothing can beat.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.intervals import Interval, mean_interval


def ratio_to_bound(r: Array, bound: Array, level: float = CONFIDENCE) -> Interval:
    """Return the RMS of an error over runs and epochs in multiples of the bound's over the epochs, with its interval.

    The interval is that of the mean over runs of their mean squares, on the scale of the ratio.

    Args:
        r: Size of the error of the runs that count (runs, K).
        bound: Bound on its root mean square over runs (K,); epochs without one (NaN) are left out of both.
        level: Confidence.
    """
    known = np.isfinite(bound)
    limit = math.sqrt(float(np.square(bound[known]).mean())) if known.any() else 0.0
    if limit == 0:
        return Interval(math.nan, math.nan, math.nan, level, len(r))
    with np.errstate(over="ignore"):
        squares = mean_interval(np.square(r[:, known] / limit).mean(axis=1), level)
    ends = (squares.estimate, squares.low, squares.high)
    estimate, low, high = (end if math.isnan(end) else math.sqrt(end) for end in ends)
    return replace(squares, estimate=estimate, low=low, high=high)
