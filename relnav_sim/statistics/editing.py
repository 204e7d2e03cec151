"""Did a filter that locked itself out recover? Counted at every epoch, against the truth.

Outside: the NEES of the whole state is above its 99.9 % quantile. With N rejections in a row as a lock-out, a filter is
*lost* once it has been outside for 10 N epochs in a row. A lock-out opens an *episode*, at the first of its rejections;
it ends, *recovered*, at the first epoch after the last lock-out from which on the filter is inside and no sensor locked
out for 10 N epochs in a row. So a filter that follows a sensor's fault is never recovered, however well they agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.results.block import EDIT_ENDS, Editing
from relnav_sim.statistics.errors import ScoringRules

HOLD = 10
"""Epochs for each rejection of a lock-out that a filter must be outside to be lost, inside to be recovered."""
OUTSIDE = 0.999
"""Probability of the NEES inside, where the filter is right."""


class EditingAccumulator:
    """Takes what was edited in successive chunks of a block's measurements, and gives what came of it at the end.

    Args:
        runs: Number of runs in the block.
        rules: How errors are turned into figures.
        sensors: The sensors whose measurements are edited, by name.
        max_rejects: Rejections N in a row that are a lock-out.
    """

    def __init__(self, runs: int, rules: ScoringRules, sensors: Sequence[str], max_rejects: int) -> None:
        from scipy.special import chdtri

        self._rules, self._names, self._hold = rules, tuple(sensors), HOLD * max_rejects
        self._limit = float(chdtri(6, 1 - OUTSIDE))
        s = len(self._names)
        self._tests, self._rejected = np.zeros((2, runs, 2, s), dtype=np.int64)
        self._lock_outs, self._actions = np.zeros((2, runs, s), dtype=np.int64)
        self._locked = np.zeros((runs, s), dtype=bool)
        self._since = np.full(runs, -1)  # epoch at which the open episode began
        self._inside, self._outside = np.zeros((2, runs), dtype=np.int64)  # epochs in a row
        self._recoveries, self._lost = np.zeros((2, runs), dtype=np.int64)
        self._longest = np.zeros(runs, dtype=np.int64)
        self._epoch = 0
        self._failed = np.full(runs, -1)

    def add(self, first_epoch: int, nees: Array, edits: Mapping[str, Mapping[str, Integers]], failed: Integers) -> None:
        """Count the next chunk of epochs; the start (epoch 0) is not counted.

        Args:
            first_epoch: Number of the chunk's first epoch.
            nees: NEES of position and velocity, (runs, K).
            edits: By the name of the sensor, the counts of `filters.editing.EDITS`, each (runs, K).
            failed: First failed epoch of each run, (runs,); -1: none.
        """
        runs, K = nees.shape
        epochs = np.arange(first_epoch, first_epoch + K)
        sound = (failed[:, None] < 0) | (epochs < failed[:, None])
        self._failed = failed
        nothing = {name: np.zeros((runs, K), dtype=np.int64) for name in ("tests", "rejected", "lock_outs", "actions")}
        nothing |= {name: nothing["tests"] for name in ("locked", "row_epochs")}
        own = [edits.get(name, nothing) for name in self._names]
        counts = {name: np.stack([one[name] for one in own], axis=-1) * sound[..., None] for name in nothing}
        settled = epochs >= self._rules.settled_epoch
        for total, name in ((self._tests, "tests"), (self._rejected, "rejected")):
            total[:, 0] += counts[name].sum(axis=1)
            total[:, 1] += counts[name][:, settled].sum(axis=1)
        self._lock_outs += counts["lock_outs"].sum(axis=1)
        self._actions += counts["actions"].sum(axis=1)
        with np.errstate(invalid="ignore"):
            inside = sound & (nees <= self._limit)
        began = np.where(counts["lock_outs"] > 0, counts["row_epochs"], -1).max(axis=2)
        for k in range(1 if first_epoch == 0 else 0, K):
            self._advance(
                first_epoch + k, inside[:, k], sound[:, k], began[:, k], counts["tests"][:, k], counts["locked"][:, k]
            )
        self._epoch = first_epoch + K

    def _advance(self, epoch: int, inside: Mask, sound: Mask, row: Integers, tests: Integers, locked: Integers) -> None:
        """Go on by one epoch; `row`: length of the row of rejections of a lock-out that begins, -1: none."""
        self._locked = np.where(tests > 0, locked > 0, self._locked)
        begins = row >= 0
        self._since = np.where(begins & (self._since < 0), epoch - row, self._since)
        well = inside & ~np.asarray(self._locked.any(axis=1))
        # What was before the last lock-out is no recovery from it.
        self._inside = np.where(well, np.where(begins, 0, self._inside) + 1, 0)
        self._outside = np.where(sound & ~inside, self._outside + 1, 0)
        self._lost += self._outside == self._hold
        back = (self._since >= 0) & (self._inside >= self._hold)
        took = epoch + 1 - self._hold - self._since
        self._longest = np.where(back, np.maximum(self._longest, took), self._longest)
        self._recoveries += back
        self._since = np.where(back, -1, self._since)

    def result(self) -> Editing:
        """Return the results over everything counted."""
        step_s = self._rules.step_s
        is_open = self._since >= 0
        # A first epoch that looks recovered, of which the run has not shown enough, is at least no fault adopted.
        choices = (~is_open, self._failed >= 0, self._locked.any(axis=1), self._inside > 0)
        names = ("none", "failed", "rejecting", "not_seen")
        end = np.select(choices, [EDIT_ENDS.index(name) for name in names], EDIT_ENDS.index("adopted"))
        return Editing(
            names=self._names,
            tests=self._tests,
            rejected=self._rejected,
            lock_outs=self._lock_outs,
            actions=self._actions,
            recoveries=self._recoveries,
            recovery=np.where(self._recoveries > 0, self._longest * step_s, np.nan),
            lost=self._lost,
            open=np.where(is_open, (self._epoch - 1 - self._since) * step_s, np.nan),
            earliest=np.where(is_open, (self._epoch - self._inside - self._since) * step_s, np.nan),
            end=end.astype(np.int8),
        )
