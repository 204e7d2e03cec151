"""Candidates on common random numbers: all of a round share each simulated block of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relnav_sim.campaign import Case
from relnav_sim.campaign.blocks import block_size, filter_groups
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import TuneSpan
from relnav_sim.results import layout
from relnav_sim.results.shards import read_shard
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.work import Block, with_filters
from relnav_sim.tuning.objective import Figures

_R, _V = layout.QUANTITIES.index("r"), layout.QUANTITIES.index("v")
_FULL = layout.BLOCKS.index("full")


@dataclass(frozen=True)
class Candidate:
    """Numbers that are tried.

    Attributes:
        filter: Name of the filter whose they are.
        entries: The filter with these numbers in every case.
    """

    filter: str
    entries: Sequence[FilterEntry]


def filter_of(name: str) -> str:
    """Return the filter of a candidate, by the name that it has in a round: the filter's with a number."""
    return name.rpartition(" ")[0]


def number_of(name: str) -> int:
    """Return the number of a candidate in its round."""
    return int(name.rpartition(" ")[2])


class Bench:
    """Runs candidates of any filters on the same runs.

    Args:
        cases: The cases to tune on.
        seed: Seed of the runs.
        runs: Number of runs of each case.
        span: What the figures are taken over.
        pool: Computes the runs.
        workers: How many processes it has; the figures do not depend on it.
        folder: An empty folder for shards, which are removed once they are read.
        tell: Told of candidate runs that are done.
    """

    def __init__(
        self,
        cases: Sequence[Case],
        seed: int,
        runs: int,
        span: TuneSpan,
        pool: Pool,
        workers: int,
        folder: Path,
        tell: Callable[[int], None],
    ) -> None:
        self._cases = cases
        self._seed = seed
        self._runs = runs
        self._span = layout.SPANS.index(span)
        self._pool = pool
        self._workers = workers
        self._folder = folder
        self._tell = tell

    def blocks(self, candidates: Sequence[Candidate]) -> list[Block]:
        """Return the work on candidates."""
        cases = [self._with(case, place, candidates) for place, case in enumerate(self._cases)]
        return [block for place, case in enumerate(cases) for block in self._blocks(place, case)]

    def figures(self, candidates: Sequence[Candidate]) -> list[Figures]:
        """Return what each candidate gave."""
        blocks = self.blocks(candidates)
        shape = (len(candidates), len(self._cases), self._runs)
        position, velocity, anees = (np.full(shape, np.nan) for _ in range(3))
        failed = np.ones(shape, dtype=bool)
        for done in self._pool.computed(blocks):
            info, block = read_shard(done.block.path)
            done.block.path.unlink()
            for name, result in block.filters.items():
                at = (number_of(name), info.case_index, list(info.runs))
                position[at] = result.summary["rms"][:, self._span, _R]
                velocity[at] = result.summary["rms"][:, self._span, _V]
                anees[at] = result.summary["anees"][:, self._span, _FULL]
                failed[at] = result.summary["failed"] != 0
            self._tell(len(info.runs) * len(block.filters))
        return [Figures(*rows) for rows in zip(position, velocity, anees, failed, strict=True)]

    def _blocks(self, place: int, case: Case) -> Iterator[Block]:
        """Yield the work on a case: many runs and few candidates at a time.

        A step costs little more for twenty runs than for two, so the candidates are divided first.
        """
        names = list(case.config.filters)
        alone = [with_filters(case, [name]).config for name in names]
        size = block_size(2 * self._runs, alone)  # which leaves two blocks: here one may have all runs
        for first in range(0, self._runs, size):
            runs = tuple(range(first, min(first + size, self._runs)))
            for worker in range(min(self._workers, len(names))):
                for group in filter_groups(case.config, names[worker :: self._workers], len(runs)):
                    yield Block(self._seed, place, with_filters(case, group), runs, self._folder)

    def _with(self, case: Case, place: int, candidates: Sequence[Candidate]) -> Case:
        """Return the case with the candidates as its filters; next to nothing of it is stored."""
        clock = case.config.clock
        update = {
            "filters": {f"{of.filter} {number}": of.entries[place] for number, of in enumerate(candidates)},
            "clock": clock.model_copy(update={"store_every_s": clock.duration_s}),
        }
        return replace(case, config=case.config.model_copy(update=update))
