"""What a tuned filter is judged by: one number, and its share in each run for intervals and paired differences.

With x the figure of a run and a case, m its mean over runs and C cases:

- position: mean over cases of ln m, x the RMS position error over the span; its exponential is the geometric mean
  over cases, in which no case dominates;
- velocity: the same of the velocity error;
- consistency: mean over cases of (ln m)^2, x the ANEES of the whole state over the span; 0 when consistent, smooth
  there, and alike for too large and too small by the same factor;
- both: position + weight * consistency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.models import TuneObjective
from relnav_sim.statistics.intervals import Interval, mean_interval


@dataclass(frozen=True)
class Figures:
    """What the runs of one candidate gave; each array (cases, runs).

    Attributes:
        position: RMS position error over the span, m.
        velocity: RMS velocity error, m/s.
        anees: Mean NEES of the whole state divided by its dimension.
        failed: Whether the run failed.
    """

    position: Array
    velocity: Array
    anees: Array
    failed: Mask

    def of(self, runs: Mask) -> Figures:
        """Return the figures of some runs."""
        return Figures(self.position[:, runs], self.velocity[:, runs], self.anees[:, runs], self.failed[:, runs])

    @property
    def broken(self) -> Mask:
        """The runs that failed in some case (runs,)."""
        return np.asarray(self.failed.any(axis=0))

    @property
    def sound(self) -> bool:
        """Whether every run of every case has its figures."""
        rows = np.stack([self.position, self.velocity, self.anees])
        return not self.failed.any() and bool(np.isfinite(rows).all()) and bool((rows > 0).all())


@dataclass(frozen=True)
class Score:
    """A number with its linearised share of each run.

    Attributes:
        value: The number; infinite where a run failed.
        per_run: (runs,), with the value as mean: value + sum over cases of dvalue/dm (x - m).
    """

    value: float
    per_run: Array

    @property
    def interval(self) -> Interval:
        """The value with its 95 % interval over runs."""
        return mean_interval(self.per_run)


def objective(figures: Figures, kind: TuneObjective, weight: float) -> Score:
    """Return what is minimised; infinite where a run failed or has no figure."""
    if not figures.sound:
        return Score(np.inf, np.full(figures.failed.shape[1], np.nan))
    match kind:
        case "position":
            return mean_log(figures.position)
        case "velocity":
            return mean_log(figures.velocity)
        case "consistency":
            return mean_square_log(figures.anees)
        case "both":
            first, second = mean_log(figures.position), mean_square_log(figures.anees)
            return Score(first.value + weight * second.value, first.per_run + weight * second.per_run)


def mean_log(x: Array) -> Score:
    """Return the mean over cases of the log of the mean over runs, x (cases, runs)."""
    m = x.mean(axis=1, keepdims=True)
    value = float(np.log(m).mean())
    return Score(value, value + (x / m - 1).mean(axis=0))


def mean_square_log(x: Array) -> Score:
    """Return the mean over cases of the squared log of the mean over runs, x (cases, runs)."""
    m = x.mean(axis=1, keepdims=True)
    value = float(np.square(np.log(m)).mean())
    return Score(value, value + (2 * np.log(m) * (x / m - 1)).mean(axis=0))
