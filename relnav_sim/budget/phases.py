"""The phases of a flight: where the steady state begins, before each manoeuvre, at each hand-over between sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.models import CaseConfig

_USUAL_GAPS = 3
"""A sensor that misses no more than so many of its usual times between measurements is still there."""
_MOST_SPELLS = 6
"""A sensor that comes and goes more often than that, as in and out of sunlight, hands nothing over."""


@dataclass(frozen=True)
class Phase:
    """A part of the flight, named by what it ends with.

    Attributes:
        ends: In words.
        epoch: The last epoch before that.
    """

    ends: str
    epoch: int


def phases(config: CaseConfig, times_s: Array, read: Mapping[str, Mask]) -> tuple[Phase, ...]:
    """Return the phases of a case in order; the last ends with the run.

    Args:
        config: The case.
        times_s: Its epochs (T,), s.
        read: Whether each of the filter's sensors reads at an epoch of the nominal flight, (T,).
    """
    last = len(times_s) - 1
    ends: dict[int, list[str]] = {}

    def add(epoch: int, words: str) -> None:
        if 0 < epoch < last:
            ends.setdefault(epoch, []).append(words)

    if settle_s := config.statistics.settle_s:
        add(int(np.searchsorted(times_s, settle_s * (1 - 1e-12))), "steady state")
    for name, manoeuvre in config.truth.manoeuvres.items():
        add(int(np.searchsorted(times_s, manoeuvre.time_s)) - 1, f"before {name}")
    for name, reads in read.items():
        for begin, end in _spells(reads):
            add(begin - 1, f"before {name} reads")
            add(end, f"{name} falls silent")
    return (*(Phase(", ".join(ends[epoch]), epoch) for epoch in sorted(ends)), Phase("end", last))


def _spells(reads: Mask) -> list[tuple[int, int]]:
    """Return the first and last epochs of each row of measurements; none of a sensor that comes and goes."""
    epochs = np.flatnonzero(reads)
    if len(epochs) < 2:
        return [(int(epoch), int(epoch)) for epoch in epochs]
    gaps = np.diff(epochs)
    breaks = np.flatnonzero(gaps > _USUAL_GAPS * np.median(gaps))
    begins, ends = epochs[[0, *(breaks + 1)]], epochs[[*breaks, -1]]
    found = list(zip(begins.tolist(), ends.tolist(), strict=True))
    # A sensor with a pause after each measurement, or with none before the first epoch, begins at once.
    usual = int(np.median(gaps))
    if found[0][0] <= usual:
        found[0] = (0, found[0][1])
    if found[-1][1] >= len(reads) - 1 - usual:
        found[-1] = (found[-1][0], len(reads) - 1)
    return found if len(found) <= _MOST_SPELLS else []
