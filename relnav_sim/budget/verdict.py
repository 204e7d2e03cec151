"""An error budget beside a Monte Carlo of the same campaign: is the filter linear here?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.budget.budget import Budget
from relnav_sim.budget.table import settled
from relnav_sim.results.layout import QUANTITIES, SPANS
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
        interval: The interval of that ratio, as the runs themselves scatter.
        band: Where it may be if the budget is right, however the error is distributed over time and axes.
    """

    runs: int
    failed: int
    ratio: float
    interval: tuple[float, float]
    band: tuple[float, float]

    @property
    def agrees(self) -> bool:
        """Whether the budget is within the interval, the ratio within the band, and no run failed."""
        (low, high), (least, most) = self.interval, self.band
        return low <= 1 <= high and least <= self.ratio <= most and not self.failed


def in_words(found: Verdict, budget: Budget) -> str:
    """Return a verdict as a sentence without its full stop: linear here, or trust the Monte Carlo."""
    words = "linear here"
    if not found.agrees:
        words = "nonlinear here: trust the Monte Carlo"
        if budget.not_covered:
            words = "nonlinear here, or it is what the budget leaves out: trust the Monte Carlo"
    failed = f"; {found.failed} failed" if found.failed else ""
    low, high = found.interval
    return (
        f"position error of {found.runs} runs{failed}, {found.ratio:.3f} of the budget's ({low:.3f} to {high:.3f}): "
        f"{words}"
    )


def verdict(budget: Budget, squares: Array, settle_s: float) -> Verdict | None:
    """Return how runs compare with a budget; None where there are too few.

    Two tests share a level of 0.1 %. Student's interval of the mean of the runs' mean squares sees small differences
    where a run holds many errors. Where a few runs are far off it is as wide as they are far: so the ratio must also be
    where it would be with one Gaussian error a run, the widest that a linear filter's mean square can scatter.

    Args:
        budget: The budget.
        squares: Mean square of the position error of each run from `settle_s` on, (runs,), m^2; NaN of a failed run.
        settle_s: Start of the span, s.
    """
    from scipy.special import chdtri, stdtrit

    known = squares[np.isfinite(squares)]
    n = len(known)
    if n < LEAST_RUNS:
        return None
    expected = budget.total[settled(budget, settle_s), :3].sum(axis=1).mean()
    side = (1 - CONFIDENCE) / 4  # two tests with two sides each
    half = stdtrit(n - 1, 1 - side) * known.std(ddof=1) / np.sqrt(n)
    ratio, low, high = np.sqrt(np.maximum(known.mean() + np.array([0.0, -half, half]), 0.0) / expected).tolist()
    least, most = np.sqrt(chdtri(n, [1 - side, side]) / n).tolist()
    return Verdict(n, len(squares) - n, ratio, (low, high), (least, most))


def squares_of(results: Results, case_id: str, filter: str) -> Array:
    """Return the mean square of the settled position error of each run of a filter, (runs,), m^2; empty without any."""
    place = next((i for i, header in enumerate(results.headers) if header.id == case_id), None)
    if place is None or filter not in results.headers[place].filters or not len(results.case_runs(place, filter)):
        return np.empty(0)
    rms = results.statistic(place, filter, "rms")
    return np.square(rms[:, SPANS.index("settled"), QUANTITIES.index("r")], dtype=np.float64)
