"""What tasks have in common, sent to each worker once, so that a task itself is a few words of plain data.

A content holds the cases of some tasks, each once with all its filters; its digest names it. An order says which of
these cases, filters and runs are meant.
"""

from __future__ import annotations

import hashlib
import pickle
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from relnav_sim.campaign import Case
from relnav_sim.options import Origin
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.work import Block, with_filters


@dataclass(frozen=True)
class Order:
    """A task as it travels.

    Attributes:
        content: Digest of the content that it speaks of.
        place: Which case of it.
        folder: Which folder of it.
        filters: Places of its filters among those of the case, as ``0-2,5``.
        runs: Numbers of the runs, as ``0-39``; empty: the bound of the case.
    """

    content: str
    place: int
    folder: int
    filters: str
    runs: str


@dataclass(frozen=True)
class Content:
    """What some tasks have in common.

    Attributes:
        blocks: A task without runs for each case of each folder, with all its filters.
        bounds: The places of those whose bound is asked for.
        folders: The folders where shards belong.
    """

    blocks: tuple[Block, ...]
    bounds: frozenset[int]
    folders: tuple[Path, ...]

    @classmethod
    def of(cls, tasks: Sequence[Task]) -> Content:
        """Return the content of tasks."""
        blocks: dict[tuple[Path, str], Block] = {}
        bounds = set()
        for task in tasks:
            key = task.folder, task.case.id
            index = task.case_index if isinstance(task, Block) else 0
            known = blocks.setdefault(key, Block(task.seed, index, task.case, (), task.folder))
            if isinstance(task, Block):
                known = replace(known, case_index=index)
            blocks[key] = replace(known, case=_with_all(known.case, task.case))
            if isinstance(task, BoundTask):
                bounds.add(list(blocks).index(key))
        return cls(tuple(blocks.values()), frozenset(bounds), tuple(dict.fromkeys(folder for folder, _ in blocks)))

    def packed(self) -> bytes:
        """Return it as bytes."""
        return zlib.compress(pickle.dumps(self, protocol=pickle.HIGHEST_PROTOCOL))

    @staticmethod
    def unpacked(packed: bytes) -> Content:
        """Return what `packed` has packed; this imports the packages of its plug-ins."""
        found: Content = pickle.loads(zlib.decompress(packed))
        return found

    def order(self, digest: str, task: Task) -> Order:
        """Return a task, one of those that the content is of or a piece of one, as it travels.

        Args:
            digest: Of the content.
            task: The task.
        """
        place = self._places[task.folder, task.case.id]
        names = list(self.blocks[place].case.config.filters)
        filters = compact(names.index(name) for name in task.case.config.filters)
        runs = compact(task.runs) if isinstance(task, Block) else ""
        return Order(digest, place, self.folders.index(task.folder), filters, runs)

    @cached_property
    def _places(self) -> dict[tuple[Path, str], int]:
        return {(block.folder, block.case.id): place for place, block in enumerate(self.blocks)}

    def task(self, order: Order, folder: Path) -> Task:
        """Return the task that an order means, its file in another folder."""
        whole = self.blocks[order.place]
        names = list(whole.case.config.filters)
        case = with_filters(whole.case, [names[place] for place in numbers(order.filters)])
        if not order.runs:
            return BoundTask(whole.seed, case, folder)
        return replace(whole, case=case, runs=tuple(numbers(order.runs)), folder=folder)

    def examples(self) -> Iterator[Task]:
        """Yield tasks that need all compiled code that any of the content's does."""
        for place, block in enumerate(self.blocks):
            yield replace(block, runs=(0,))
            if place in self.bounds:
                yield BoundTask(block.seed, block.case, block.folder)

    def files(self) -> dict[str, str]:
        """Return the files that the cases read while they are computed, with their SHA-256."""
        return dict(file for block in self.blocks for file in _files(block.case.config))


def digest_of_content(packed: bytes) -> str:
    """Return the name of a content, 16 hexadecimal digits."""
    return hashlib.sha256(packed).hexdigest()[:16]


def _with_all(case: Case, other: Case) -> Case:
    """Return a case with the filters of another one added."""
    filters = {**case.config.filters, **other.config.filters}
    if len(filters) == len(case.config.filters):
        return case
    return replace(case, config=case.config.model_copy(update={"filters": filters}))


def compact(given: Iterable[int]) -> str:
    """Return whole numbers in their order as text: ``0-39,41``."""
    spans: list[list[int]] = []
    for number in given:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ",".join(f"{first}-{last}" if last > first else f"{first}" for first, last in spans)


def numbers(text: str) -> list[int]:
    """Return the numbers that `compact` has written."""
    spans = [span.partition("-") for span in text.split(",")]
    return [n for first, dash, last in spans for n in range(int(first), int(last if dash else first) + 1)]


def _files(value: Any) -> Iterator[tuple[str, str]]:
    """Yield the files in options whose content is not in them: path, and the digest that stands beside it."""
    if isinstance(value, BaseModel):
        for name, field in type(value).model_fields.items():
            inner = getattr(value, name)
            for mark in field.metadata:
                if isinstance(mark, Origin) and mark.of.endswith("sha256") and getattr(value, mark.of) is not None:
                    yield inner, getattr(value, mark.of)
            yield from _files(inner)
    elif isinstance(value, dict):
        for inner in value.values():
            yield from _files(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _files(inner)
