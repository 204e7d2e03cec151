"""What a campaign has finished by now, as its shards say of themselves: no results file is merged for it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from relnav_sim.results.block import BlockResult, Failure, ResultsError
from relnav_sim.results.bundle import Bundle
from relnav_sim.results.case_failures import CaseFailures
from relnav_sim.results.case_rows import CaseRows
from relnav_sim.results.contents import Contents
from relnav_sim.results.merge import pieces_by_case
from relnav_sim.results.pieces import Piece, bundle_piece, result_pieces
from relnav_sim.results.read import open_results
from relnav_sim.results.shard_files import held_shards
from relnav_sim.runner.shard_folder import read_folder_header, shard_folder
from relnav_sim.runner.unfinished import folder_provenance, grown_from

_NOTHING = np.empty(0)


def contents_so_far(out: Path) -> Contents:
    """Return what the result and the shards hold by now; every shard is read once, to verify its checksum.

    Raises:
        ResultsError: The results file or the shards' header is damaged.
        RefusedError: The two disagree about why a run failed.
    """
    folder = shard_folder(out)
    header = read_folder_header(folder)
    pieces = [*_of_shards(held_shards(folder)[0].values()), *(_of_result(out, folder) if out.exists() else ())]
    known = {case.id for case in header.cases}
    mine = [piece for piece in pieces if piece.info.case_id in known and piece.info.seed == header.seed]
    by_case = pieces_by_case(mine, header)
    runs: dict[tuple[int, str], list[int]] = {}
    failures: list[tuple[str, Failure]] = []
    for index, case in enumerate(header.cases):
        rows = CaseRows(index, case, by_case[case.id], (), header.runs)
        found = CaseFailures(rows)
        for piece in rows.pieces:
            found.take(piece.info, piece.load())
        runs |= {(index, name): rows.filters.get(name, []) for name in case.filters}
        failures += [(case.label, failure) for failure in found.in_order()]
    return Contents(header, folder_provenance(folder), True, runs, tuple(failures))


def _of_shards(shards: Iterable[Bundle]) -> Iterator[Piece]:
    """Yield sound shards as pieces that remember no numbers; damaged ones will be computed again."""
    for shard in shards:
        try:
            piece = bundle_piece(shard)
            block = replace(piece.load(), time_s=_NOTHING, relative=_NOTHING, filters={})
        except ResultsError:
            continue
        yield replace(piece, load=partial(_same, block))


def _of_result(out: Path, folder: Path) -> Iterator[Piece]:
    """Yield what a results file that the campaign grew from holds, without its numbers."""
    with open_results(out) as results:
        if not grown_from(read_folder_header(folder), results.header):
            return
        failures = [[f for _, f in results.failures(index)] for index in range(len(results.headers))]
    for piece in result_pieces(out):
        info = piece.info
        own = tuple(f for f in failures[info.case_index] if f.run in info.runs and f.filter in ("", *info.filters))
        block = BlockResult(info.case_index, info.case_id, info.runs, _NOTHING, _NOTHING, {}, own, info.shared_truth)
        yield replace(piece, load=partial(_same, block))


def _same(block: BlockResult) -> BlockResult:
    return block
