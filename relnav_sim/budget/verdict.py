"""An error budget beside a Monte Carlo of the same campaign: is the filter linear here?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from relnav_sim.arrays import Array
from relnav_sim.budget.budget import Budget
from relnav_sim.budget.table import settled
from relnav_sim.results.read import Results

CONFIDENCE = 0.999
LEAST_RUNS = 10
"""With fewer runs an interval of the mean square says next to nothing."""


@dataclass(frozen=True)
class Verdict:
    """How the position error of a Monte Carlo compares with its budget, over the settled span.

    Attributes:
        runs: Runs that count.
        failed: Runs that failed, which no budget foresees.
        ratio: Root mean square error of the runs over that of the budget.
        low: Lower end of its 99.9 % interval.
        high: Upper end.
    """

    runs: int
    failed: int
    ratio: float
    low: float
    high: float

    @property
    def agrees(self) -> bool:
        """Whether the budget is within the interval, and no run failed."""
        return self.low <= 1 <= self.high and not self.failed


def verdict(budget: Budget, squares: Array, settle_s: float) -> Verdict | None:
    """Return how runs compare with a budget; None where there are too few.

    The interval is Student's of the mean of the runs' mean squares, each a number of its own.

    Args:
        budget: The budget.
        squares: Mean square of the position error of each run from `settle_s` on, (runs,), m^2; NaN of a failed run.
        settle_s: Start of the span, s.
    """
    known = squares[np.isfinite(squares)]
    if len(known) < LEAST_RUNS:
        return None
    expected = budget.total[settled(budget, settle_s), :3].sum(axis=1).mean()
    half = stdtrit(len(known) - 1, 0.5 + CONFIDENCE / 2) * known.std(ddof=1) / np.sqrt(len(known))
    ends = np.maximum(np.array([known.mean(), known.mean() - half, known.mean() + half]), 0.0) / expected
    ratio, low, high = np.sqrt(ends).tolist()
    return Verdict(len(known), len(squares) - len(known), ratio, low, high)


def squares_of(results: Results, case_id: str, filter: str) -> Array:
    """Return the mean square of the settled position error of each run of a filter, (runs,), m^2; empty without any."""
    place = next((i for i, header in enumerate(results.headers) if header.id == case_id), -1)
    summary = results.summary()
    rows = (summary["case"] == place) & (summary["filter"] == filter)
    return np.square(np.asarray(summary["settled_r_rms_m"][rows], dtype=np.float64))
