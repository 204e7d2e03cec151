"""What runs say about a limit on a figure: met, missed or undecided, by the figure's interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.statistics import means
from relnav_sim.statistics.intervals import Interval, mean_interval, runs_to_decide
from relnav_sim.statistics.proportions import Share, runs_for_share

Verdict = Literal["pass", "fail", "undecided"]


@dataclass(frozen=True)
class Finding:
    """What the runs say about a requirement's figure.

    Attributes:
        figure: The figure with its interval at the requirement's confidence.
        verdict: What follows.
        certainty: Largest one-sided confidence at which the requirement is met or, where the figure is on the wrong
            side, missed.
        runs_to_decide: Runs that would decide an undecided one; None: decided, or no number would.
    """

    figure: Interval
    verdict: Verdict
    certainty: float
    runs_to_decide: int | None


def on_a_share(share: Share, limit: float, confidence: float) -> Finding:
    """Return what a share says about a requirement to be at least ``limit``."""
    figure = share.interval(confidence)
    verdict: Verdict = "pass" if figure.low >= limit else "fail" if figure.high < limit else "undecided"
    certainty = max(share.certainty_at_least(limit), share.certainty_below(limit))
    needed = runs_for_share(share, limit, confidence) if verdict == "undecided" else None
    return Finding(figure, verdict, certainty, needed)


def on_a_mean(values: Array, low: float, high: float, confidence: float) -> Finding:
    """Return what one figure per run says about a requirement that their mean lie between two limits.

    Args:
        values: One figure per run (runs,), finite.
        low: Lower limit; -inf: none.
        high: Upper limit.
        confidence: Of the interval.
    """
    figure = mean_interval(values, level=confidence)
    inside = low <= figure.low and figure.high <= high
    outside = figure.high < low or figure.low > high
    verdict: Verdict = "pass" if inside else "fail" if outside else "undecided"
    within = [_certainty_beyond(values - low), _certainty_beyond(high - values)]
    certainty = min(within) if low <= figure.estimate <= high else 1 - min(within)
    nearest = high if abs(figure.estimate - high) <= abs(figure.estimate - low) else low
    needed = runs_to_decide(values - nearest, confidence) if verdict == "undecided" else None
    return Finding(figure, verdict, certainty, needed)


def _certainty_beyond(values: Array) -> float:
    """Return the one-sided confidence that the mean of the values is positive."""
    if len(values) < 2 or not np.isfinite(values).all():
        return 1.0 if np.isposinf(values).all() else 0.0
    one_sided = means.p_value(values) / 2
    return 1 - one_sided if values.mean() > 0 else one_sided
