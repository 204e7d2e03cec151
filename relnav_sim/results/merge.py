"""Shards into one results file: verified, in run order, the same bits whatever the split into blocks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import h5py

from relnav_sim.conventions import RESERVED_NAMES
from relnav_sim.results import hdf5, layout, seal, stacks, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.results.bound import BoundResult, bound_digest, bounds_of
from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.case_rows import CaseRows, groups_alike
from relnav_sim.results.header import write_header
from relnav_sim.results.missing_runs import missing_in_words, missing_runs
from relnav_sim.results.pieces import Piece, shard_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.stack_writer import StackWriter

MERGED_FROM = "merged_from"
"""The attribute with the digest of what a results file was merged from."""


def merge_shards(
    shards: Iterable[Path], header: ResultHeader, provenance: Provenance, out: Path, complete: bool = True
) -> None:
    """Unite shards by case, filter and run into the results file; see `merge_pieces`."""
    merge_pieces([shard_piece(path) for path in shards], header, provenance, out, complete)


def merge_pieces(
    pieces: Iterable[Piece],
    header: ResultHeader,
    provenance: Provenance,
    out: Path,
    complete: bool = True,
    bounds: Iterable[BoundResult] = (),
    mark: bool = False,
) -> None:
    """Unite pieces by case, filter and run into the results file.

    A run that two pieces hold counts once if they agree bit for bit (measured times aside).
    Filters are told apart by their settings, not by their names alone. Memory is bounded
    by the largest piece. Runs beyond ``header.runs`` are left out, and so are those that lacked memory, but for why.

    Args:
        pieces: The pieces, in any order.
        header: The campaign.
        provenance: How the result came about.
        out: The results file; replaced as a whole or left as it was.
        complete: Refuse to write while runs are missing; else write what there is.
        bounds: Bounds of the cases, as far as there are any.
        mark: Whether the file says from which pieces it was merged, so that it need not be merged again.

    Raises:
        ResultsError: A piece is damaged.
        RefusedError: A piece is foreign, two disagree, or runs are missing.
        OSError: The file can't be written.
    """
    for case in header.cases:
        if bad := [name for name in case.filters if name in RESERVED_NAMES or "/" in name or name in (".", "")]:
            raise ResultsError(f"case {case.label}: a filter can't be named {bad[0]!r}")
    pieces, bounds = list(pieces), list(bounds)
    by_case = pieces_by_case(pieces, header)
    limits = bounds_of(header, bounds)
    if complete and (missing := missing_runs(by_case, header)):
        raise RefusedError(missing_in_words(missing))
    cases = [
        CaseRows(index, case, by_case[case.id], limits[case.id], header.runs)
        for index, case in enumerate(header.cases)
        if by_case[case.id]
    ]
    with written_whole(out) as temporary:
        with store.create_file(temporary) as file:
            write_header(file, header, provenance)
            hdf5.set_attributes(file.id, {seal.ATTRIBUTE: seal.NOTICE})
            if mark:
                hdf5.set_attributes(file.id, {MERGED_FROM: merged_from(header, pieces, map(bound_digest, bounds))})
            if stacks.CASES in file:
                _write_stacks(file, len(header.cases), cases)
            else:
                for rows in cases:
                    StackWriter(file[layout.case_group(rows.index)], [rows]).write()
        seal.seal(temporary)


def merged_from(header: ResultHeader, pieces: Iterable[Piece], bounds: Iterable[str]) -> str:
    """Return a digest of what a results file is merged from, in whatever order; the same digest means the same file.

    Args:
        header: The campaign.
        pieces: The pieces.
        bounds: The checksums of the bounds.
    """
    cases = [[case.id, case.label, list(case.filters), dict(case.filter_ids)] for case in header.cases]
    facts = [header.campaign_name, header.text, header.content, header.hash, header.seed, header.runs, header.only]
    told = [*facts, cases, dict(header.constants), dict(header.stopping)]
    digest = hashlib.sha256(json.dumps([layout.FORMAT_VERSION, *told], sort_keys=True).encode())
    for text in sorted({piece.checksum or str(piece.info) for piece in pieces}):
        digest.update(text.encode())
    for text in sorted(set(bounds)):
        digest.update(text.encode())
    return digest.hexdigest()


def is_merged(out: Path, digest: str) -> bool:
    """Return whether a results file is whole and was merged from what has this digest."""
    try:
        with store.open_checked(out, layout.FORMAT, whole=True) as file:
            return MERGED_FROM in file.attrs and store.text(file, MERGED_FROM) == digest
    except ResultsError:
        return False


def _write_stacks(file: h5py.File, cases: int, held: Sequence[CaseRows]) -> None:
    of_case = [-1] * cases
    for number, alike in enumerate(groups_alike(held)):
        group = file.create_group(stacks.stack_group(number))
        StackWriter(group, alike, many=True).write()
        for rows in alike:
            of_case[rows.index] = number
    store.write(file[stacks.CASES], {stacks.STACK: of_case})


def pieces_by_case(pieces: Iterable[Piece], header: ResultHeader) -> dict[str, list[Piece]]:
    """Return pieces by the id of their case, in order, each with the filters that the campaign has.

    Raises:
        RefusedError: One is of another seed or case.
    """
    known = {case.id: case for case in header.cases}
    by_case: dict[str, list[Piece]] = {case_id: [] for case_id in known}
    for piece in sorted(pieces, key=lambda p: (p.info.runs, p.info.filters, str(p.info.path))):
        info = piece.info
        if info.seed != header.seed:
            raise RefusedError(f"{info.path}: the shard has seed {info.seed}, the campaign {header.seed}")
        if info.case_id not in known:
            raise RefusedError(f"{info.path}: the campaign has no case {info.case_id}")
        # Filters that the campaign no longer has, or has with other settings, are passed over.
        ids = known[info.case_id].filter_ids
        useful = tuple(name for name in info.filters if ids.get(name) == info.filter_ids[name])
        if useful:
            kept = piece if useful == info.filters else replace(piece, info=replace(info, filters=useful))
            by_case[info.case_id].append(kept)
    return by_case
