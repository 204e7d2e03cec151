"""Did the runs that were locked out or diverged recover in time?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Mask
from relnav_sim.results.block import EDIT_ENDS, Editing


@dataclass(frozen=True)
class RecoveredInTime:
    """The runs of a filter, by whether they recovered within a time; each (runs,).

    Attributes:
        concerned: Runs that had something to recover from: a lock-out, or being lost.
        met: Those of them that recovered from all of it in time.
        possible: Those of them that did, or of which the run shows too little to say that they did not.
    """

    concerned: Mask
    met: Mask
    possible: Mask


def recovered_in_time(editing: Editing, failed: Mask, within_s: float) -> RecoveredInTime:
    """Return which runs recovered from every lock-out within a time; one that failed, or was lost unnoticed, did not.

    Args:
        editing: What came of the editing.
        failed: Runs that failed, (runs,).
        within_s: The time, from the first of the rejections of a lock-out, s.
    """
    locked, lost = editing.lock_outs.sum(axis=1) > 0, editing.lost > 0
    is_open = editing.end != EDIT_ENDS.index("none")
    with np.errstate(invalid="ignore"):
        slow = editing.recovery > within_s
        unseen = is_open & (editing.earliest <= within_s)
    unnoticed = lost & ~locked
    concerned = locked | lost | failed
    missed = failed | slow | unnoticed
    return RecoveredInTime(
        np.asarray(concerned),
        np.asarray(concerned & ~missed & ~is_open),
        np.asarray(concerned & ~missed & (~is_open | unseen)),
    )
