"""The Cramér-Rao bounds of a campaign as pieces of work beside its blocks, kept in files as these are."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from relnav_sim.campaign import Campaign, Case
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import BoundResult, bound_name, bound_of
from relnav_sim.results.shard_files import held_bounds, remove
from relnav_sim.runner.work import Block


@dataclass(frozen=True)
class BoundTask:
    """The bounds of one case.

    Attributes:
        seed: Seed of the campaign.
        case: The case with all its filters.
        folder: Where the file belongs.
    """

    seed: int
    case: Case
    folder: Path

    @functools.cached_property
    def name(self) -> str:
        """The name of the result's file."""
        return bound_name(self.seed, self.case.id, self.case.filter_ids)

    @property
    def path(self) -> Path:
        """The file of the result."""
        return self.folder / self.name

    @property
    def busy(self) -> Path:
        """The marker that stands while a worker computes it; it outlives a worker that is killed."""
        return self.path.with_suffix(".busy")

    def pieces(self) -> list[Block]:
        """Return nothing: a bound can't be cut."""
        return []


Task = Block | BoundTask


def bound_tasks(campaign: Campaign, folder: Path, part: tuple[int, int] = (1, 1)) -> list[BoundTask]:
    """Return the bounds that a campaign asks for; of several parts the one with a case's first runs has its bound.

    A stressed case has none: that of the stressed truth would be one for filters that are told of it.
    """
    if not campaign.bound:
        return []
    number, parts = part
    blocks = ceil(campaign.runs / campaign.block_runs)
    cases = [case for index, case in enumerate(campaign.nominal_cases) if (index * blocks + 1 - number) % parts == 0]
    return [BoundTask(campaign.seed, case, folder) for case in cases]


def bounds_left(tasks: Sequence[BoundTask], say: Callable[[str], None]) -> list[BoundTask]:
    """Return the bounds to compute: those that are not there, and those that time or memory did not suffice for.

    Args:
        tasks: The bounds that the campaign asks for.
        say: Told of the files that do not verify and of the bounds that are tried again.
    """
    left = []
    for task, bound in zip(tasks, finished_bounds(tasks, say), strict=True):
        if bound is not None and bound.retry:
            say(f"case {task.case.label} lacks a Cramér-Rao bound ({bound.reason}); trying again")
        if bound is None or bound.retry:
            left.append(task)
    return left


def finished_bounds(tasks: Sequence[BoundTask], say: Callable[[str], None]) -> list[BoundResult | None]:
    """Return bounds of one folder; None where there is none. One that does not verify is told of and removed."""
    if not tasks:
        return []
    folder = tasks[0].folder
    bundles, damaged = held_bounds(folder)
    found: list[BoundResult | None] = []
    wrong: list[str] = []
    for task in tasks:
        bound = None
        try:
            if task.name in damaged:
                raise damaged[task.name]
            if task.name in bundles:
                bound = bound_of(bundles[task.name])
                if (bound.seed, bound.case_id, bound.filter_ids) != (task.seed, task.case.id, task.case.filter_ids):
                    raise ResultsError(f"{task.path}: this is the bound of something else")
        except ResultsError as error:
            say(f"{error}; computing it again")
            wrong.append(task.name)
            bound = None
        found.append(bound)
    remove(folder, wrong)
    return found


def sound_bounds(folder: Path) -> list[BoundResult]:
    """Return the bounds in a folder of shards; damaged ones, which the campaign will compute again, are left out."""
    bounds = []
    for bundle in held_bounds(folder)[0].values():
        try:
            bounds.append(bound_of(bundle))
        except ResultsError:
            continue
    return bounds
