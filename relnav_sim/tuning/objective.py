"""What a tuned filter is judged by: one number, and its share in each run for intervals and paired differences.

With x the figure of a run and a case, m its mean over runs and C cases:

- position: mean over cases of ln m, x the RMS position error over the span; its exponential is the geometric mean
  over cases, in which no case dominates;
- velocity: the same of the velocity error;
- consistency: mean over cases of (ln m)^2, x the ANEES of the whole state over the span; 0 when consistent, smooth
  there, and alike for too large and too small by the same factor;
- both: position + weight * consistency;
- in_band: position, with a penalty for the mean over cases of how far ln m lies outside the band of the ANEES. The
  penalty is linear and so steep (an exact one; Nocedal and Wright, Numerical Optimization, 2006, section 17.2) that the
  least lies in the band if the candidates reach it; of candidates that are chosen from, those in the band come first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.models import TuneObjective
from relnav_sim.results import layout
from relnav_sim.statistics.intervals import Interval, chi_square_band, mean_interval

AneesBand = tuple[float, float]
PENALTY = 10.0
"""In ln m of position for a factor e outside the band: 1 % outside weighs as much as 10 % of position error."""
STATE = layout.BLOCK_SIZES[0]
"""Dimension of the error in the ANEES."""


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
        feasible: Whether it keeps to the band, where the objective has one.
    """

    value: float
    per_run: Array
    feasible: bool = True

    @property
    def interval(self) -> Interval:
        """The value with its 95 % interval over runs."""
        return mean_interval(self.per_run)


def objective(figures: Figures, kind: TuneObjective, weight: float, band: AneesBand | None = None) -> Score:
    """Return what is minimised; infinite where a run failed or has no figure.

    Args:
        figures: What the runs gave.
        kind: The objective.
        weight: Of consistency in ``both``.
        band: Of the ANEES for ``in_band``; None: the default.
    """
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
        case "in_band":
            first, outside = mean_log(figures.position), mean_distance_log(figures.anees, band_of(figures, band))
            per_run = first.per_run + PENALTY * outside.per_run
            return Score(first.value + PENALTY * outside.value, per_run, feasible=outside.value == 0)


def band_of(figures: Figures, band: AneesBand | None) -> AneesBand:
    """Return the band of the ANEES as given; default: of as many independent errors as there are runs, at 95 %.

    That is the widest that a consistent filter can have: it supposes that the NEES of a run stays as it is over time.
    """
    if band is not None:
        return band
    found = chi_square_band(figures.anees.shape[1], STATE)
    return found.low, found.high


def mean_distance_log(x: Array, band: AneesBand) -> Score:
    """Return the mean over cases of how far the log of the mean over runs is outside a band, x (cases, runs)."""
    m = x.mean(axis=1, keepdims=True)
    low, high = np.log(band)
    distance = np.maximum(np.log(m) - high, 0.0) + np.maximum(low - np.log(m), 0.0)
    side = (np.log(m) > high).astype(float) - (np.log(m) < low)
    value = float(distance.mean())
    return Score(value, value + (side * (x / m - 1)).mean(axis=0))


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
