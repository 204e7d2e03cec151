"""Parts of a campaign from several machines into one result."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from relnav_sim.results import layout, store
from relnav_sim.results.atomic import remove_temporaries, target
from relnav_sim.results.block import RefusedError
from relnav_sim.results.bound import BoundResult, result_bounds
from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.changes import changed_keys
from relnav_sim.results.header import read_header
from relnav_sim.results.merge import merge_pieces, pieces_by_case
from relnav_sim.results.missing_runs import MissingRuns, missing_in_words, missing_runs
from relnav_sim.results.pieces import Piece, bundle_piece, result_pieces
from relnav_sim.results.provenance import Provenance, collect_provenance
from relnav_sim.results.shard_files import held_shards
from relnav_sim.runner.bound_task import sound_bounds
from relnav_sim.runner.machines import machines_of
from relnav_sim.runner.sessions import past_sessions, provenance_of
from relnav_sim.runner.shard_folder import read_folder_header, shard_folder
from relnav_sim.wording import first_of

_ALL_PARTS = (
    "The same command with --missing lists them all. Name every part, its result file or its .shards folder; a part "
    "that nobody has computed is: relnav run FILE --shard I/N --out PATH"
)


@dataclass(frozen=True)
class _Parts:
    """What parts of one campaign hold together."""

    header: ResultHeader
    pieces: list[Piece]
    bounds: list[BoundResult]
    histories: list[Provenance]

    def missing(self) -> list[MissingRuns]:
        return missing_runs(pieces_by_case(self.pieces, self.header), self.header)


def merge_results(out: str | os.PathLike[str], parts: Sequence[str | os.PathLike[str]]) -> Path:
    """Unite results of one campaign; the file holds the bits that one machine would have computed.

    Args:
        out: The results file to write; it must not exist.
        parts: Results files, or folders of shards, for example of machines that did not finish.

    Raises:
        RefusedError: The parts belong to different campaigns, disagree about a run, or leave runs out.
        ResultsError: A part is damaged.
        OSError: A file can't be read or written.
    """
    out = Path(out)
    if out.exists() or shard_folder(out).exists():
        raise RefusedError(f"{out} exists; give the merged result another name")
    remove_temporaries(target(out).parent, target(out).name)
    held = _read_all(parts)
    if missing := held.missing():
        raise RefusedError(f"{missing_in_words(missing)}. {_ALL_PARTS}")
    out.parent.mkdir(parents=True, exist_ok=True)
    merge_pieces(held.pieces, held.header, _united(held.histories), out, bounds=held.bounds)
    return out


def missing_of_parts(parts: Sequence[str | os.PathLike[str]]) -> list[MissingRuns]:
    """Return the runs of a campaign that none of its parts holds.

    Args:
        parts: Results files or folders of shards, as for `merge_results`.

    Raises:
        RefusedError: The parts belong to different campaigns.
        ResultsError: A part is damaged.
        OSError: A file can't be read.
    """
    return _read_all(parts).missing()


def _read_all(parts: Sequence[str | os.PathLike[str]]) -> _Parts:
    headers: list[ResultHeader] = []
    pieces: list[Piece] = []
    bounds: list[BoundResult] = []
    histories: list[Provenance] = []
    for path in map(Path, parts):
        header, found, limits, history = _read(path)
        if headers:
            _check_same(Path(parts[0]), headers[0], path, header)
        headers.append(header)
        pieces += found
        bounds += limits
        histories.append(history)
    return _Parts(headers[0], pieces, bounds, histories)


def _read(path: Path) -> tuple[ResultHeader, list[Piece], list[BoundResult], Provenance]:
    if path.is_dir():
        # A folder holds shards of filters and cases that the campaign had once, too; these are passed over.
        header = read_folder_header(path)
        shards, damaged = held_shards(path)
        for error in damaged.values():
            raise error
        found = [bundle_piece(shard) for shard in shards.values()]
        known = {case.id for case in header.cases}
        history = provenance_of(past_sessions(path), machines_of(path))
        found = [piece for piece in found if piece.info.case_id in known and piece.info.seed == header.seed]
        return header, found, sound_bounds(path), history
    with store.open_checked(path, layout.FORMAT, whole=True) as file:
        header, provenance = read_header(file)
    if header.only is not None:
        raise RefusedError(f"{path} holds a single run for a closer look (relnav run --only); leave it out")
    if header.replay is not None:
        raise RefusedError(f"{path} is of recorded measurements (relnav replay); leave it out, or replay all at once")
    return header, result_pieces(path), result_bounds(path), provenance


def _check_same(first_path: Path, first: ResultHeader, path: Path, header: ResultHeader) -> None:
    if keys := changed_keys(first.content, header.content):
        raise RefusedError(f"{first_path} and {path} belong to different campaigns: {first_of(keys)} differ")
    for what in ("runs", "cases", "stopping"):
        if getattr(first, what) != getattr(header, what):
            raise RefusedError(
                f"{first_path} and {path} differ in their {what}; run both with the same campaign file and options"
            )


def _united(histories: Sequence[Provenance]) -> Provenance:
    """Return where the result came from: from the first start to the last end of its parts, merged here."""
    return collect_provenance(
        datetime.fromisoformat(min(part.started for part in histories)),
        datetime.fromisoformat(max(part.finished for part in histories)),
        sum(part.wall_time_s for part in histories),
        sessions=[session for part in histories for session in part.sessions],
        machines=sum((Counter(part.machines) for part in histories), Counter()),
    )
