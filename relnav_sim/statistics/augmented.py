"""Per-run statistics of the states that a filter carries behind position and velocity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.results import layout
from relnav_sim.results.block import AugmentedStates
from relnav_sim.statistics import moments
from relnav_sim.statistics.errors import ScoringRules


class AugmentedAccumulator:
    """Takes successive chunks of a block's estimates of e augmented states and gives their results at the end.

    Args:
        runs: Number of runs in the block.
        rules: How errors are turned into figures.
        names: Names of the states.
        units: Their units.
    """

    def __init__(self, runs: int, rules: ScoringRules, names: Sequence[str], units: Sequence[str]) -> None:
        self._rules = rules
        self._names, self._units = tuple(names), tuple(units)
        empty = moments.no_moments(len(names), runs)
        self._early, self._settled = empty, empty
        lengths = layout.sizes(runs, len(rules.stored_s)) | {"extra": len(names)}
        self._series = {
            spec.name.removeprefix("extra_"): np.full(layout.shape(spec, lengths), np.nan, dtype=spec.dtype)
            for spec in layout.AUGMENTED
            if "time" in spec.dims
        }

    def add(self, first_epoch: int, estimate: Array, truth: Array, variance: Array, failed: Integers) -> None:
        """Count the next chunk of epochs; the start (epoch 0) is stored but not counted.

        Args:
            first_epoch: Number of the chunk's first epoch.
            estimate: (runs, K, e).
            truth: (runs or 1, K, e); NaN where it is not known.
            variance: What the filter states, (runs, K, e).
            failed: First failed epoch of each run, (runs,); -1: none.
        """
        epochs = np.arange(first_epoch, first_epoch + estimate.shape[1])
        sound = (failed[:, None] < 0) | (epochs < failed[:, None])
        error = estimate - truth
        stored = np.flatnonzero(epochs % self._rules.store_every == 0)
        rows = epochs[stored] // self._rules.store_every
        with np.errstate(over="ignore", invalid="ignore"):
            parts = {"estimate": estimate, "error": error, "sigma": np.sqrt(variance)}
            for name, part in parts.items():
                self._series[name][:, rows] = np.where(sound[:, stored, None], part[:, stored], np.nan)
            settled = epochs >= self._rules.settled_epoch
            self._early = _added(self._early, error, sound, (epochs > 0) & ~settled)
            self._settled = _added(self._settled, error, sound, settled)

    def result(self) -> AugmentedStates:
        """Return the results over everything counted."""
        with np.errstate(over="ignore", invalid="ignore"):
            spans = [moments.merged(self._early, self._settled), self._settled]
            mean = np.stack([span.known(span.mean).T for span in spans], axis=1)
            rms = np.stack([span.rms().T for span in spans], axis=1)
        return AugmentedStates(self._names, self._units, mean=mean, rms=rms, **self._series)


def _added(before: moments.Moments, error: Array, sound: Mask, part: Mask) -> moments.Moments:
    if not part.any():
        return before
    return moments.merged(before, moments.moments(error[:, part], sound[:, part]))
