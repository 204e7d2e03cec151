"""What is left to compute: shards that verify count as done, the rest is cut into blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from relnav_sim.campaign import Campaign, Case
from relnav_sim.campaign.blocks import filter_groups
from relnav_sim.results.block import ResultsError
from relnav_sim.results.shard_files import held_shards, remove
from relnav_sim.results.shards import shard_block, shard_info, shard_name
from relnav_sim.runner.headline import Figures, headline_figures

Key = tuple[str, str, str]
"""Case id, filter name, filter id."""


@dataclass(frozen=True)
class Block:
    """Some runs of one case with some of its filters: the unit of work, and of what an interruption can cost.

    Attributes:
        seed: Seed of the campaign.
        case_index: Number of the case in the campaign.
        case: The case with the filters to compute.
        runs: Numbers of the runs, ascending.
        folder: Where its shard belongs.
    """

    seed: int
    case_index: int
    case: Case
    runs: tuple[int, ...]
    folder: Path

    @property
    def filter_ids(self) -> dict[str, str]:
        """A hash of each filter's settings, by its name."""
        return self.case.filter_ids

    @property
    def path(self) -> Path:
        """The shard's file."""
        return self.folder / shard_name(self.seed, self.case.id, self.filter_ids, self.runs)

    @property
    def busy(self) -> Path:
        """The marker that stands while a worker computes the block; it outlives a worker that is killed."""
        return self.path.with_suffix(".busy")

    def pieces(self) -> list[Block]:
        """Return the block cut in two, first by filters, then by runs; nothing where it can't be cut.

        Most often it is one filter that goes wrong, and it may do so in every run: the others are then soon done.
        """
        names = list(self.case.config.filters)
        if len(names) > 1:
            middle = len(names) // 2
            return [replace(self, case=with_filters(self.case, part)) for part in (names[:middle], names[middle:])]
        middle = len(self.runs) // 2
        return [replace(self, runs=part) for part in (self.runs[:middle], self.runs[middle:])] if middle else []


@dataclass(frozen=True)
class Finished:
    """The shards of a folder that belong to a campaign and verify.

    Attributes:
        folder: Where they are.
        shards: Their names.
        runs: Runs that they hold, by case and filter.
        figures: The headline figure of the runs that did not fail, m, by case and filter.
    """

    folder: Path = Path()
    shards: list[str] = field(default_factory=list)
    runs: dict[Key, set[int]] = field(default_factory=dict)
    figures: dict[Key, dict[int, float]] = field(default_factory=dict)

    def add(
        self, shard: str, case_id: str, filter_ids: Mapping[str, str], runs: Iterable[int], figures: Figures
    ) -> None:
        """Count a shard."""
        self.shards.append(shard)
        for name, identity in filter_ids.items():
            self.runs.setdefault((case_id, name, identity), set()).update(runs)
            self.figures.setdefault((case_id, name, identity), {}).update(figures.get(name, {}))


def finished_work(folder: Path, campaign: Campaign, say: Callable[[str], None]) -> Finished:
    """Return what the shards of a folder hold of a campaign. Shards of other cases or filters are left alone.

    Args:
        folder: The shards' folder.
        campaign: The campaign.
        say: Told of shards that are damaged, and of runs that lacked memory; they will be computed again.
    """
    finished = Finished(folder)
    lacked_memory = 0
    known = {(case.id, *item) for case in campaign.cases for item in case.filter_ids.items()}
    bundles, damaged = held_shards(folder)
    again: list[str] = []
    for error in damaged.values():
        say(f"{error}; computing it again")
    for name, bundle in bundles.items():
        try:
            info = shard_info(bundle)
            block = shard_block(bundle)
        except ResultsError as error:
            say(f"{error}; computing it again")
            again.append(name)
            continue
        if info.seed == campaign.seed and any((info.case_id, *item) in known for item in info.filter_ids.items()):
            if info.retry:
                lacked_memory += len(block.failures)
                again.append(name)
                continue
            finished.add(name, info.case_id, info.filter_ids, info.runs, headline_figures(block))
    remove(folder, [*damaged, *again])
    if lacked_memory:
        say(f"{lacked_memory} of the runs of filters lacked memory or a worker the last time; trying them again")
    return finished


def blocks_left(
    campaign: Campaign, finished: Mapping[Key, set[int]], folder: Path, part: tuple[int, int] = (1, 1)
) -> Iterator[Block]:
    """Yield the blocks that are not finished: cases in order, then runs, then filters where these take long.

    The cuts between runs lie at multiples of the campaign's `block_runs`, whatever is finished.

    Args:
        campaign: The campaign.
        finished: Finished runs by case and filter.
        folder: The shards' folder.
        part: (i, n): only every n-th chunk of runs, beginning with the i-th; for several machines.
    """
    number, parts = part
    chunk = 0
    for index, case in enumerate(campaign.cases):
        ids = case.filter_ids
        for first in range(0, campaign.runs, campaign.block_runs):
            chunk += 1
            if (chunk - number) % parts:
                continue
            by_filters: dict[tuple[str, ...], list[int]] = {}
            for run in range(first, min(first + campaign.block_runs, campaign.runs)):
                missing = (name for name in ids if run not in finished.get((case.id, name, ids[name]), ()))
                by_filters.setdefault(tuple(missing), []).append(run)
            for absent, runs in by_filters.items():
                for names in filter_groups(case.config, absent, len(runs)):
                    yield Block(campaign.seed, index, with_filters(case, names), tuple(runs), folder)


def with_filters(case: Case, names: Sequence[str]) -> Case:
    """Return the case with some of its filters; its id does not depend on them."""
    filters = {name: case.config.filters[name] for name in names}
    return replace(case, config=case.config.model_copy(update={"filters": filters}))
