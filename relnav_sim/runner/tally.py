"""How far a campaign is: runs done case by case, the time left, and what the filters' errors look like so far."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

from relnav_sim.runner.headline import Figures
from relnav_sim.runner.stopping import half_width
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import Block

FILTERS_SHOWN = 5


class Tally:
    """Counts the blocks of one session of a campaign.

    Args:
        blocks: What is to be computed; work that was done before does not count for the time left.
        earlier: The headline figure of the runs that were done before, by case id, filter and run.
        watch: Knows the time left, and what went wrong.
    """

    def __init__(
        self, blocks: Sequence[Block], earlier: Mapping[tuple[str, str], Mapping[int, float]], watch: Watch
    ) -> None:
        self._watch = watch
        self.total = sum(len(block.runs) for block in blocks)
        self._pairs = sum(map(_pairs, blocks))
        self._pairs_done = 0
        self._labels = {block.case.id: block.case.label for block in blocks}
        self._runs_of: dict[str, int] = {}
        for block in blocks:
            self._runs_of[block.case.id] = self._runs_of.get(block.case.id, 0) + len(block.runs)
        self._pairs_of = dict.fromkeys(self._runs_of, 0)
        for block in blocks:
            self._pairs_of[block.case.id] += _pairs(block)
        self._pairs_done_of = dict.fromkeys(self._runs_of, 0)
        self._figures = {key: dict(figures) for key, figures in earlier.items()}
        self._filters = {block.case.id: tuple(block.case.config.filters) for block in blocks}
        self._began = time.monotonic()

    def count(self, block: Block, figures: Figures) -> None:
        """Count a block that is done, or a piece of one that had to be cut."""
        case = block.case.id
        self._pairs_done += _pairs(block)
        self._pairs_done_of[case] += _pairs(block)
        for name, of_runs in figures.items():
            self._figures.setdefault((case, name), {}).update(of_runs)

    @property
    def done(self) -> int:
        """Runs that are done; of those of which only some filters are, the share."""
        return self.total * self._pairs_done // self._pairs if self._pairs else 0

    @property
    def elapsed_s(self) -> float:
        """Seconds since the session began."""
        return time.monotonic() - self._began

    @property
    def left_s(self) -> float:
        """Seconds to go, see `Watch`."""
        return self._watch.left_s

    @property
    def trouble(self) -> str:
        """What has gone wrong so far, in words; empty where nothing has."""
        return self._watch.trouble_in_words()

    def cases_under_way(self) -> list[tuple[str, str, str]]:
        """Return label, ``done/total`` and the filters' figures of every case that is begun and not done."""
        return [self.row(case) for case, runs in self._runs_of.items() if 0 < self._done_of(case) < runs]

    def cases(self) -> list[tuple[str, str, str]]:
        """Return the same of every case."""
        return [self.row(case) for case in self._runs_of]

    def row(self, case: str) -> tuple[str, str, str]:
        """Return label, ``done/total`` and figures of a case."""
        return self._labels[case], f"{self._done_of(case)}/{self._runs_of[case]}", self._figures_in_words(case)

    def _done_of(self, case: str) -> int:
        return self._runs_of[case] * self._pairs_done_of[case] // self._pairs_of[case]

    def _figures_in_words(self, case: str) -> str:
        """Return the running means with the half widths of their 95 % intervals, the first few filters'."""
        names = self._filters[case]
        words = [f"{name} {_mean_in_words(self._figures.get((case, name), {}))}" for name in names[:FILTERS_SHOWN]]
        more = [f"and {len(names) - FILTERS_SHOWN} more"] if len(names) > FILTERS_SHOWN else []
        return ", ".join([*words, *more])


def _pairs(block: Block) -> int:
    """Return how many pairs of a run and a filter a block has: pieces of a block have as many as the block."""
    return len(block.runs) * len(block.case.config.filters)


def _mean_in_words(figures: Mapping[int, float]) -> str:
    sound = [figures[run] for run in sorted(figures) if math.isfinite(figures[run])]
    if not sound:
        return "-"
    wide = half_width(figures)
    return f"{sum(sound) / len(sound):.3g}" + (f" ±{wide:.2g} m" if math.isfinite(wide) else " m")
