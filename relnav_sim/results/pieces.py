"""What a results file is merged from: pieces, each some runs of one case, in a shard or in another results file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from relnav_sim.results import layout, store
from relnav_sim.results.block import AnyArray, BlockResult, CaseHeader, Failure, FilterResult, ResultsError
from relnav_sim.results.header import read_header
from relnav_sim.results.shards import ShardInfo, read_shard, read_shard_info

RUNS_AT_ONCE = 200
"""Runs of one filter that are held in memory together when they come from a results file."""


@dataclass(frozen=True)
class Piece:
    """Some runs of one case with some of its filters.

    Attributes:
        info: What it holds; ``path`` is the file it lies in.
        load: Reads and verifies the numbers; raises `ResultsError` where they are damaged.
    """

    info: ShardInfo
    load: Callable[[], BlockResult]


def shard_piece(path: Path) -> Piece:
    """Return a shard as a piece.

    Raises:
        ResultsError: The file is missing, torn or no shard.
    """
    return Piece(read_shard_info(path), lambda: read_shard(path)[1])


def result_pieces(path: Path) -> list[Piece]:
    """Return the pieces of a results file: filter by filter, some runs at a time.

    Raises:
        ResultsError: The file is missing, damaged or no result.
    """
    with store.open_checked(path, layout.FORMAT) as file:
        header, _ = read_header(file)
        pieces = []
        for index, case in enumerate(header.cases):
            for name, rows, runs, shared in _parts(store.subgroup(file, layout.case_group(index)), case):
                ids = {name: case.filter_ids[name]}
                columns = columns_of(store.subgroup(store.subgroup(file, layout.case_group(index)), name))
                info = ShardInfo(path, header.seed, index, case.id, (name,), ids, runs, shared, {name: columns})
                pieces.append(Piece(info, partial(_read_part, info, rows)))
    return pieces


def _parts(group: h5py.Group, case: CaseHeader) -> Iterator[tuple[str, slice, tuple[int, ...], bool]]:
    """Yield filter, rows, runs and whether all runs share one truth."""
    for name in case.filters:
        if name not in store.names(group):
            continue
        shared = store.read(group, layout.DIMENSIONS["trajectory"]).tolist() == [-1]
        runs = store.read(store.subgroup(group, name), layout.DIMENSIONS["run"]).tolist()
        for first in range(0, len(runs), RUNS_AT_ONCE):
            rows = slice(first, min(first + RUNS_AT_ONCE, len(runs)))
            yield name, rows, tuple(runs[rows]), shared


def _read_part(info: ShardInfo, rows: slice) -> BlockResult:
    (name,) = info.filters
    with store.open_checked(info.path, layout.FORMAT) as file:
        group = store.subgroup(file, layout.case_group(info.case_index))
        own = store.subgroup(group, name)
        columns = info.columns[name]
        arrays: dict[str, AnyArray] = {spec.name: store.read(own, spec, rows) for spec in columns.datasets}
        failures = read_failures(group)
        return BlockResult(
            case_index=info.case_index,
            case_id=info.case_id,
            runs=info.runs,
            time_s=store.read(group, layout.DIMENSIONS["time"]),
            relative=store.read(group, layout.TRUTH, ... if info.shared_truth else _truth_rows(group, info)),
            filters={name: FilterResult.of_arrays(arrays, columns)},
            failures=tuple(f for f in failures if f.run in info.runs and f.filter in ("", name)),
            shared_truth=info.shared_truth,
        )


def _truth_rows(group: h5py.Group, info: ShardInfo) -> AnyArray:
    owners = store.read(group, layout.DIMENSIONS["trajectory"])
    rows = np.searchsorted(owners, info.runs)
    if (rows >= len(owners)).any() or (owners[rows] != info.runs).any():
        raise ResultsError(f"{info.path}: {group.name} has no truth of some of its runs")
    return rows


def columns_of(group: h5py.Group) -> layout.Columns:
    """Return what a filter's group holds beyond what all of them hold.

    Raises:
        ResultsError: The names are damaged.
    """

    def labels(spec: layout.Dataset | layout.Dimension) -> tuple[str, ...]:
        return tuple(map(str, store.read(group, spec))) if spec.name in store.names(group) else ()

    dimensions = layout.DIMENSIONS
    extra, units = labels(dimensions["extra"]), labels(layout.AUGMENTED_UNIT)
    if len(extra) != len(units):
        raise ResultsError(f"{group.file.filename}: {group.name} lacks units of its augmented states")
    names = ("sensor", "edited", "factor", "channel")
    sensors, edited, factor, channels = (labels(dimensions[name]) for name in names)
    return layout.Columns(labels(dimensions["diagnostic"]), extra, units, sensors, edited, factor, channels)


def read_failures(group: h5py.Group) -> tuple[Failure, ...]:
    """Return the failures of a case from its group; none where nothing has been computed yet.

    Raises:
        ResultsError: They are damaged.
    """
    if "failures" not in store.names(group):
        return ()
    part = store.subgroup(group, "failures")
    table = {spec.name: store.read(part, spec) for spec in layout.FAILURES}
    rows = zip(table["run"], table["filter"], table["epoch"], table["reason"], strict=True)
    return tuple(Failure(int(run), name, int(epoch), reason) for run, name, epoch, reason in rows)
