"""What a results file is merged from: pieces, each some runs of one case, in a shard or in another results file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from relnav_sim.results import layout, store
from relnav_sim.results.block import AnyArray, BlockResult, FilterResult, ResultsError
from relnav_sim.results.bundle import Bundle
from relnav_sim.results.campaign_header import CaseHeader
from relnav_sim.results.header import read_header
from relnav_sim.results.shards import ShardInfo, epochs_of, open_shard, shard_block, shard_info
from relnav_sim.results.stored_cases import StoredCases, StoredPart

RUNS_AT_ONCE = 200
"""Runs of one filter that are held in memory together when they come from a results file."""


@dataclass(frozen=True)
class Piece:
    """Some runs of one case with some of its filters.

    Attributes:
        info: What it holds; ``path`` is the file it lies in.
        load: Reads and verifies the numbers; raises `ResultsError` where they are damaged.
        checksum: Of a shard, over all that it holds; empty for a part of a results file.
    """

    info: ShardInfo
    load: Callable[[], BlockResult]
    checksum: str = ""


def shard_piece(path: Path) -> Piece:
    """Return a shard as a piece.

    Raises:
        ResultsError: The file is missing, torn or no shard.
    """
    return bundle_piece(open_shard(path))


def bundle_piece(bundle: Bundle) -> Piece:
    """Return a shard, wherever it lies, as a piece.

    Raises:
        ResultsError: What it says of itself is damaged.
    """
    return Piece(shard_info(bundle), partial(shard_block, bundle), bundle.checksum)


def result_pieces(path: Path) -> list[Piece]:
    """Return the pieces of a results file: filter by filter, some runs at a time.

    Raises:
        ResultsError: The file is missing, damaged or no result.
    """
    with store.open_checked(path, layout.FORMAT) as file:
        header, _ = read_header(file)
        cases = StoredCases(file)
        pieces = []
        for index, case in enumerate(header.cases):
            beside = cases.case(index)
            for name in case.filters if beside is not None else ():
                part = cases.filter(index, name)
                if beside is None or part is None:
                    continue
                shared = beside.read(layout.DIMENSIONS["trajectory"]).tolist() == [-1]
                epochs = epochs_of(beside.read(layout.DIMENSIONS["time"]))
                runs = part.read(layout.DIMENSIONS["run"]).tolist()
                for first in range(0, len(runs), RUNS_AT_ONCE):
                    rows = slice(first, min(first + RUNS_AT_ONCE, len(runs)))
                    info = ShardInfo(
                        path,
                        header.seed,
                        index,
                        case.id,
                        (name,),
                        {name: case.filter_ids[name]},
                        tuple(runs[rows]),
                        shared,
                        {name: part.columns()},
                        epochs,
                    )
                    pieces.append(Piece(info, partial(_read_part, info, case, rows)))
    return pieces


def _read_part(info: ShardInfo, case: CaseHeader, rows: slice) -> BlockResult:
    (name,) = info.filters
    with store.open_checked(info.path, layout.FORMAT) as file:
        cases = StoredCases(file)
        group, own = cases.case(info.case_index), cases.filter(info.case_index, name)
        if group is None or own is None:
            raise ResultsError(f"{info.path}: case {case.label}, filter {name} is missing")
        columns = info.columns[name]
        arrays: dict[str, AnyArray] = {spec.name: own.read(spec, rows) for spec in columns.datasets}
        failures = cases.failures(info.case_index)
        return BlockResult(
            case_index=info.case_index,
            case_id=info.case_id,
            runs=info.runs,
            time_s=group.read(layout.DIMENSIONS["time"]),
            relative=group.read(layout.TRUTH, ... if info.shared_truth else _truth_rows(group, info)),
            filters={name: FilterResult.of_arrays(arrays, columns)},
            failures=tuple(f for f in failures if f.run in info.runs and f.filter in ("", name)),
            shared_truth=info.shared_truth,
        )


def _truth_rows(group: StoredPart, info: ShardInfo) -> AnyArray:
    owners = group.read(layout.DIMENSIONS["trajectory"])
    rows = np.searchsorted(owners, info.runs)
    if (rows >= len(owners)).any() or (owners[rows] != info.runs).any():
        raise ResultsError(f"{info.path}: {group.group.name} has no truth of some of its runs")
    return rows
