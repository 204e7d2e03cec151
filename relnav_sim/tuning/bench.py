"""Candidates on common random numbers: all of a round share each simulated block of runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from relnav_sim.campaign import Case
from relnav_sim.campaign.blocks import block_size
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import TuneSpan
from relnav_sim.results import layout
from relnav_sim.results.shards import read_shard
from relnav_sim.runner.pool import Backend, computed
from relnav_sim.runner.work import Block
from relnav_sim.tuning.objective import Figures

_R, _V = layout.QUANTITIES.index("r"), layout.QUANTITIES.index("v")
_FULL = layout.BLOCKS.index("full")


class Bench:
    """Runs candidates of any filters on the same runs.

    Args:
        cases: The cases to tune on.
        seed: Seed of the runs.
        runs: Number of runs of each case.
        span: What the figures are taken over.
        workers: Processes; the figures do not depend on it.
        folder: An empty folder for shards, which are removed once they are read.
        tell: Told of candidate runs that are done.
    """

    def __init__(
        self,
        cases: Sequence[Case],
        seed: int,
        runs: int,
        span: TuneSpan,
        workers: int,
        folder: Path,
        tell: Callable[[int], None],
    ) -> None:
        self._cases = cases
        self._seed = seed
        self._runs = runs
        self._span = layout.SPANS.index(span)
        self._workers = workers
        self._folder = folder
        self._tell = tell

    def figures(self, candidates: Sequence[Sequence[FilterEntry]]) -> list[Figures]:
        """Return what each candidate gave.

        Args:
            candidates: For each candidate its filter entry in every case.
        """
        cases = [self._with(case, [entries[place] for entries in candidates]) for place, case in enumerate(self._cases)]
        size = block_size(self._runs, [case.config for case in cases])
        blocks = [
            Block(self._seed, place, case, tuple(range(first, min(first + size, self._runs))), self._folder)
            for place, case in enumerate(cases)
            for first in range(0, self._runs, size)
        ]
        shape = (len(candidates), len(cases), self._runs)
        position, velocity, anees = (np.full(shape, np.nan) for _ in range(3))
        failed = np.ones(shape, dtype=bool)
        # One worker is this process: a second one would only cost its start in every round.
        backend: Backend = "sequential" if self._workers == 1 else "loky"
        with closing(computed(blocks, self._workers, backend, None)) as done_blocks:
            for done in done_blocks:
                info, block = read_shard(done.block.path)
                done.block.path.unlink()
                for name, result in block.filters.items():
                    at = (int(name), info.case_index, list(info.runs))
                    position[at] = result.summary["rms"][:, self._span, _R]
                    velocity[at] = result.summary["rms"][:, self._span, _V]
                    anees[at] = result.summary["anees"][:, self._span, _FULL]
                    failed[at] = result.summary["failed"] != 0
                self._tell(len(info.runs) * len(block.filters))
        return [Figures(*rows) for rows in zip(position, velocity, anees, failed, strict=True)]

    def _with(self, case: Case, entries: Sequence[FilterEntry]) -> Case:
        """Return the case with the candidates as its filters, by their numbers; next to nothing of it is stored."""
        clock = case.config.clock
        update = {
            "filters": {str(number): entry for number, entry in enumerate(entries)},
            "clock": clock.model_copy(update={"store_every_s": clock.duration_s}),
        }
        return replace(case, config=case.config.model_copy(update=update))
