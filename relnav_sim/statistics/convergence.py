"""When did the error become small and stay so?"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers
from relnav_sim.statistics.quantiles import BIN_RULE, BINS, Counts, bin_of

RELATIVE_CONVERGENCE = 3.0
"""How many times its steady-state RMS a run may still be off when it counts as converged relative to itself."""


class Convergence:
    """Streaming convergence times of the position error, per run.

    An epoch has converged for a threshold when the error stays below it from there on for the holding time. So
    what matters is the largest error over the holding time that follows; and the first epoch where that is
    below a threshold is the number of epochs at which its *running minimum* is not. Counting that minimum in
    bins gives the convergence time for a threshold that is only known at the end.

    Args:
        runs: Number of runs.
        threshold_m: Absolute threshold, m.
        hold_epochs: Holding time in steps.
    """

    def __init__(self, runs: int, threshold_m: float, hold_epochs: int) -> None:
        self._threshold = threshold_m
        self._hold = hold_epochs
        self._tail = np.empty((runs, 0))
        self._smallest = np.full(runs, np.inf)
        self._starts = 0
        self._not_below = np.zeros(runs, dtype=np.int64)
        self._counts: Counts = np.zeros((runs, BINS), dtype=np.int32)
        self._epochs = 0
        self._last_above = np.zeros(runs, dtype=np.int64)

    def add(self, r: Array) -> None:
        """Count a chunk of position errors (runs, epochs), m; infinite where the run has failed."""
        epochs = r.shape[1]
        above = r >= self._threshold
        last = epochs - np.argmax(above[:, ::-1], axis=1)
        self._last_above = np.where(above.any(axis=1), self._epochs + last, self._last_above)
        self._epochs += epochs
        known = np.concatenate([self._tail, r], axis=1)
        self._tail = known[:, max(0, known.shape[1] - self._hold) :]
        if known.shape[1] <= self._hold:
            return
        window = self._hold + 1
        self._starts += known.shape[1] - self._hold
        kernels.counting.staying(
            known, window, self._threshold, BIN_RULE, self._smallest, self._not_below, self._counts
        )

    def below_threshold(self) -> Array:
        """Return the first epoch, from 1, that has converged for the absolute threshold (runs,); NaN: none."""
        return self._first(self._not_below)

    def below(self, thresholds: Array) -> Array:
        """Return the same for a threshold per run, rounded up to the next edge of its bin; NaN gives NaN."""
        place = bin_of(np.where(np.isnan(thresholds), 0.0, thresholds))
        higher = np.arange(BINS) > place[:, None]
        first = self._first((self._counts * higher).sum(axis=1))
        return np.where(np.isnan(thresholds), np.nan, first)

    def below_edge(self, threshold: float) -> Array:
        """Return the first epoch, from 1, that has converged for a threshold that is the edge of a bin; NaN: none."""
        first = int(bin_of(np.array([threshold]))[0])
        return self._first(self._counts[:, first:].sum(axis=1))

    def below_to_the_end(self) -> Array:
        """Return the first epoch, from 1, from which the error stays below the threshold; NaN: none."""
        return np.where(self._last_above < self._epochs, self._last_above + 1.0, np.nan)

    def _first(self, not_yet: Integers) -> Array:
        return np.where(not_yet < self._starts, not_yet + 1.0, np.nan)
