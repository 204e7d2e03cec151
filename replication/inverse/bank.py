"""A bank of short campaigns drawn from a paper's prior: made once, in blocks that any number of workers fill."""

from __future__ import annotations

import hashlib
import json
import os
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.cli.failures import UserError
from replication.inverse.prior import Unknown
from replication.inverse.table import Number


class Paper(Protocol):
    """A paper whose numbers can be made anew in any setting of what it leaves open."""

    @property
    def name(self) -> str:
        """Its name in papers.yaml."""

    @property
    def block(self) -> int:
        """How many settings are flown at a time and kept in one file."""

    @property
    def unknowns(self) -> Sequence[Unknown]:
        """What it leaves open."""

    @property
    def numbers(self) -> Sequence[Number]:
        """What it prints."""

    @property
    def printed(self) -> Array:
        """What it prints, (numbers,)."""

    @property
    def tables(self) -> Mapping[str, Paper]:
        """Its tables, each as a paper of its own that prints some of the numbers."""

    @property
    def outcomes(self) -> Sequence[str]:
        """What its claims are about besides, without a printed number."""

    def effective(self, u: Array) -> Array:
        """Return uniform numbers (n, unknowns) with those in place that act where settings share a value."""

    @property
    def acting(self) -> Indices:
        """The unknowns that act on any number once `apart` has moved settings."""

    @property
    def groups(self) -> Sequence[tuple[Indices, Indices]]:
        """Groups of numbers, and the unknowns that act on this group alone once `apart` has moved settings."""

    def apart(self, u: Array) -> Array:
        """Return uniform numbers (n, unknowns), moved to where the groups share no value."""

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the numbers of single runs, (n, runs, numbers), of settings.

        Args:
            u: Uniform numbers that the laws of the unknowns turn into values, (n, unknowns).
            seeds: Seed of each setting's noise.
            runs: Runs of each setting.
        """

    def banked(self, u: Array, seeds: Sequence[Sequence[int]]) -> Array:
        """Return what the bank keeps of one run of settings, (n, numbers + outcomes)."""


class WithoutTables:
    """What papers share that print no tables: nothing to compare with, and settings that share nothing."""

    printed = np.empty(0)
    groups: Sequence[tuple[Indices, Indices]] = ()
    tables: Mapping[str, Paper] = MappingProxyType({})
    outcomes: Sequence[str] = ()
    acting = np.empty(0, dtype=np.int64)

    @abstractmethod
    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the numbers of single runs; as `Paper.flown`."""

    def banked(self, u: Array, seeds: Sequence[Sequence[int]]) -> Array:
        """Return the numbers of one run."""
        return np.asarray(self.flown(u, seeds, 1)[:, 0])

    def effective(self, u: Array) -> Array:
        """Return the settings as they are: nothing is shared."""
        return u

    def apart(self, u: Array) -> Array:
        """Return the settings as they are: there are no groups."""
        return u


@dataclass(frozen=True)
class Bank:
    """Settings and the numbers that one run of each gave.

    Attributes:
        seed: Its seed.
        u: Uniform numbers of the settings, (n, unknowns).
        numbers: What a paper would print of one run, (n, numbers).
        outcomes: What else its claims are about, (n, outcomes).
        cpu_s: Processor time that it took.
    """

    seed: int
    u: Array
    numbers: Array
    outcomes: Array
    cpu_s: float

    @property
    def digest(self) -> str:
        """A digest of all that it keeps in single precision."""
        kept = np.concatenate([self.numbers, self.outcomes], axis=1)
        return hashlib.sha256(kept.astype("<f4").tobytes()).hexdigest()[:16]


def of_table(bank: Bank, paper: Paper, table: Paper) -> Bank:
    """Return a paper's bank with the numbers of one of its tables alone."""
    places = [paper.numbers.index(number) for number in table.numbers]
    return replace(bank, numbers=bank.numbers[:, places], outcomes=bank.outcomes[:, :0])


def settings(paper: Paper, seed: int, first: int, count: int) -> Array:
    """Return the uniform numbers of settings from `first` on, (count, unknowns); each depends on its number alone."""
    return np.stack(
        [np.random.default_rng([seed, n, 0]).random(len(paper.unknowns)) for n in range(first, first + count)]
    )


def fill(paper: Paper, folder: Path, size: int, seed: int, workers: int, say: Callable[[str], None]) -> Bank:
    """Fill what a bank lacks and return it; the same numbers whatever the workers and however often it was interrupted.

    Raises:
        UserError: The size is no multiple of the block, or the folder holds a bank of another seed or other unknowns.
    """
    from joblib import Parallel, delayed

    if size % paper.block:
        raise UserError(f"--size is {size}; {paper.name} is flown in blocks: give a multiple of {paper.block}")
    _claim(paper, folder, seed)
    missing = [first for first in range(0, size, paper.block) if not _file(folder, first).exists()]
    pending = (delayed(_fill_block)(paper, folder, seed, first) for first in missing)
    done = Parallel(n_jobs=workers, return_as="generator_unordered")(pending)
    for count, _ in enumerate(done, 1):
        if count % 10 == 0 or count == len(missing):
            say(f"{paper.name}: {count} of {len(missing)} blocks of {paper.block} settings")
    return read(paper, folder, size)


def read(paper: Paper, folder: Path, size: int | None = None) -> Bank:
    """Return a bank from its folder: its first `size` settings, or all that are there without a gap.

    Raises:
        UserError: The folder holds no bank.
    """
    if not (folder / "bank.json").exists():
        raise UserError(f"{folder} holds no bank; make one with: python -m replication.inverse bank {paper.name}")
    seed = int(json.loads((folder / "bank.json").read_text())["seed"])
    blocks = list(_blocks(folder, size, paper.block))
    if not blocks:
        raise UserError(
            f"the bank in {folder} is empty; continue it with: python -m replication.inverse bank {paper.name}"
        )
    kept = np.concatenate([block for block, _ in blocks])[:size]
    printed = len(paper.numbers)
    if kept.shape[1] != printed + len(paper.outcomes):
        raise UserError(f"{folder} holds a bank of other numbers; give --out another folder and fill it anew")
    cpu_s = sum(cpu for _, cpu in blocks)
    return Bank(seed, settings(paper, seed, 0, len(kept)), kept[:, :printed], kept[:, printed:], cpu_s)


def _blocks(folder: Path, size: int | None, block: int) -> Iterator[tuple[Array, float]]:
    first = 0
    while _file(folder, first).exists() and (size is None or first < size):
        with np.load(_file(folder, first)) as kept:
            yield kept["numbers"].astype(float), float(kept["cpu_s"])
        first += block


def _claim(paper: Paper, folder: Path, seed: int) -> None:
    """Note whose the bank is, or make sure of it."""
    folder.mkdir(parents=True, exist_ok=True)
    owner = {"paper": paper.name, "seed": seed, "unknowns": [unknown.name for unknown in paper.unknowns]}
    path = folder / "bank.json"
    if path.exists():
        if json.loads(path.read_text()) != owner:
            raise UserError(f"{folder} holds a bank of another seed or of other unknowns; give --out another folder")
        return
    _write(path, json.dumps(owner, indent=1).encode())


def _fill_block(paper: Paper, folder: Path, seed: int, first: int) -> None:
    before = time.process_time()
    seeds = [[seed, n, 1] for n in range(first, first + paper.block)]
    numbers = paper.banked(settings(paper, seed, first, paper.block), seeds)
    temporary = folder / f"{first:07d}.{os.getpid()}.npz"
    np.savez(temporary, numbers=numbers.astype(np.float32), cpu_s=time.process_time() - before)
    os.replace(temporary, _file(folder, first))


def _file(folder: Path, first: int) -> Path:
    return folder / f"block_{first:07d}.npz"


def _write(path: Path, content: bytes) -> None:
    temporary = path.with_suffix(f".{os.getpid()}")
    temporary.write_bytes(content)
    os.replace(temporary, path)
