"""What there is of a campaign that has not come to its end: results file and shards so far, as one results file.

Whether it has is told by what the files hold, not by their times, which a copy changes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from relnav_sim.results import layout, store
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import BoundResult, bound_name, result_bounds
from relnav_sim.results.bundle import Bundle
from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.changes import changed_keys
from relnav_sim.results.header import read_header
from relnav_sim.results.merge import MERGED_FROM, merge_pieces, merged_from
from relnav_sim.results.missing_runs import missing_runs
from relnav_sim.results.pieces import Piece, bundle_piece, result_pieces
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.shard_files import held_bounds, held_shards, holds_shards
from relnav_sim.results.shards import ShardInfo, shard_info
from relnav_sim.runner.bound_task import sound_bounds
from relnav_sim.runner.machines import machines_of
from relnav_sim.runner.sessions import past_sessions, provenance_of
from relnav_sim.runner.shard_folder import read_folder_header, shard_folder

Held = set[tuple[str, str, str, int]]
"""Case id, filter name, filter id, run."""


def is_unfinished(out: Path) -> bool:
    """Return whether the shards hold something of their campaign that the results file does not.

    A results file that can't be read is not unfinished; reading it says what is wrong.

    Raises:
        UnavailableError: A file is in use by another program, or may not be read.
    """
    folder = shard_folder(out)
    if not out.exists() or not holds_shards(folder):
        return holds_shards(folder)
    try:
        campaign = read_folder_header(folder)
        if _holds_all(out, folder, campaign):
            return False
        stored = _stored_header(out)
        pieces, stored_bounds = result_pieces(out), result_bounds(out)
    except ResultsError:
        return False
    if not grown_from(campaign, stored):
        return False
    held = _held(piece.info for piece in pieces)
    if _bounds(sound_bounds(folder), campaign, held) - _bounds(stored_bounds, campaign, held):
        return True
    if _same_end(campaign, stored) and not missing_runs(_by_case(pieces), stored):
        return False
    wanted = {(case.id, name, case.filter_ids[name]) for case in campaign.cases for name in case.filters}
    return any(key[:3] in wanted and key[3] < campaign.runs for key in _held(_known_infos(folder)) - held)


def _holds_all(out: Path, folder: Path, campaign: ResultHeader) -> bool:
    """Return whether the results file was merged from just what the folder holds, which is quick to tell."""
    with store.open_checked(out, layout.FORMAT) as file:
        if MERGED_FROM not in file.attrs:
            return False
        digest = store.text(file, MERGED_FROM)
    known = {case.id for case in campaign.cases}
    pieces = [bundle_piece(bundle) for bundle in held_shards(folder)[0].values()]
    mine = [piece for piece in pieces if piece.info.case_id in known and piece.info.seed == campaign.seed]
    return digest == merged_from(campaign, mine, _asked_for(campaign, held_bounds(folder)[0].values()))


def _asked_for(campaign: ResultHeader, bounds: Iterable[Bundle]) -> list[str]:
    """Return the checksums of the bounds that a campaign asks for."""
    cases = campaign.cases if campaign.content.get("bound", True) else ()
    names = {bound_name(campaign.seed, case.id, case.filter_ids) for case in cases}
    return [bound.checksum for bound in bounds if bound.name in names]


def _stored_header(out: Path) -> ResultHeader:
    with store.open_checked(out, layout.FORMAT) as file:
        return read_header(file)[0]


def grown_from(campaign: ResultHeader, stored: ResultHeader) -> bool:
    """Return whether the shards' campaign is that of the results file, or adds runs, filters or cases to it."""
    return stored.only is None and not changed_keys(stored.content, campaign.content)


def _same_end(campaign: ResultHeader, stored: ResultHeader) -> bool:
    """Return whether a results file without gaps is all that the shards' campaign asks for."""
    stopped = stored.stopping.get("met") is True
    return stored.content == campaign.content and (stopped or stored.runs == campaign.runs)


def _by_case(pieces: Iterable[Piece]) -> dict[str, list[Piece]]:
    by_case: dict[str, list[Piece]] = {}
    for piece in pieces:
        by_case.setdefault(piece.info.case_id, []).append(piece)
    return by_case


def _held(infos: Iterable[ShardInfo]) -> Held:
    return {
        (info.case_id, name, info.filter_ids[name], run) for info in infos for name in info.filters for run in info.runs
    }


def _known_infos(folder: Path) -> Iterator[ShardInfo]:
    for shard in held_shards(folder)[0].values():
        with suppress(ResultsError):  # a damaged one, which the campaign will compute again
            yield shard_info(shard)


def _bounds(bounds: Iterable[BoundResult], campaign: ResultHeader, held: Held) -> set[tuple[str, str]]:
    """Return case ids and filter names of bounds that a campaign asks for, as far as runs beside them are held."""
    beside = {(case, name) for case, name, _, _ in held} | {(case, "") for case, _, _, _ in held}
    ids = {case.id: case.filter_ids for case in campaign.cases} if campaign.content.get("bound", True) else {}
    found = set()
    for bound in bounds:
        own = ids.get(bound.case_id, {})
        found |= {(bound.case_id, name) for name in bound.filters if own.get(name) == bound.filter_ids.get(name)}
        if bound.case_id in ids and bound.perfect is not None:
            found.add((bound.case_id, ""))
    return found & beside


@contextmanager
def results_so_far(out: Path) -> Iterator[Path]:
    """Give a temporary results file, named like the result, of the runs that the result and the shards hold by now.

    The campaign may be running meanwhile: shards are written whole, and this only reads them.

    Raises:
        ResultsError: The results file or the shards' header is damaged.
        RefusedError: The two disagree about a run.
    """
    folder = shard_folder(out)
    header = read_folder_header(folder)
    known = {case.id for case in header.cases}
    pieces = [piece for shard in held_shards(folder)[0].values() for piece in _sound(shard)]
    bounds = sound_bounds(folder)
    if out.exists():
        store.open_checked(out, layout.FORMAT, whole=True).close()
        if grown_from(header, _stored_header(out)):
            pieces += result_pieces(out)
            bounds += result_bounds(out)
    mine = [piece for piece in pieces if piece.info.case_id in known and piece.info.seed == header.seed]
    with tempfile.TemporaryDirectory(prefix="relnav_") as place:
        path = Path(place) / out.name
        merge_pieces(mine, header, folder_provenance(folder), path, complete=False, bounds=bounds)
        yield path


def folder_provenance(folder: Path) -> Provenance:
    """Return how the shards of a folder came about; the command at work here is only looking."""
    sessions = past_sessions(folder)
    provenance = provenance_of(sessions, machines_of(folder))
    return replace(provenance, command_line=sessions[-1].command_line) if sessions else provenance


def _sound(shard: Bundle) -> list[Piece]:
    """Return a shard as a piece; nothing for a damaged one, which the campaign will compute again."""
    try:
        piece = bundle_piece(shard)
        piece.load()
        return [piece]
    except ResultsError:
        return []
