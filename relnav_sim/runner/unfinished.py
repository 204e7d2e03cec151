"""What there is of a campaign that has not come to its end: the shards so far, as a results file."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from relnav_sim.results.block import ResultsError
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import Piece, shard_piece
from relnav_sim.results.shards import read_shard
from relnav_sim.runner.bound_task import sound_bounds
from relnav_sim.runner.folder import read_folder_header, shard_folder
from relnav_sim.runner.sessions import past_sessions, provenance_of


def is_unfinished(out: Path) -> bool:
    """Return whether shards have been finished that the results file does not hold yet."""
    newest = max((shard.stat().st_mtime for shard in shard_folder(out).glob("*.h5")), default=0.0)
    return newest > (out.stat().st_mtime if out.exists() else 0.0)


@contextmanager
def results_so_far(out: Path) -> Iterator[Path]:
    """Give a temporary results file, named like the result, of the runs that are finished by now.

    The campaign may be running meanwhile: shards are written whole, and this only reads them.

    Raises:
        ResultsError: The shards' header is damaged.
    """
    folder = shard_folder(out)
    header = read_folder_header(folder)
    known = {case.id for case in header.cases}
    pieces = [piece for shard in sorted(folder.glob("*.h5")) for piece in _sound(shard)]
    mine = [piece for piece in pieces if piece.info.case_id in known and piece.info.seed == header.seed]
    with tempfile.TemporaryDirectory(prefix="relnav_") as place:
        path = Path(place) / out.name
        sessions = past_sessions(folder)
        provenance = provenance_of(sessions)
        if sessions:  # the command at work here is only looking
            provenance = replace(provenance, command_line=sessions[-1].command_line)
        merge_pieces(mine, header, provenance, path, complete=False, bounds=sound_bounds(folder))
        yield path


def _sound(shard: Path) -> list[Piece]:
    """Return a shard as a piece; nothing for a damaged one, which the campaign will compute again."""
    try:
        read_shard(shard)
        return [shard_piece(shard)]
    except ResultsError:
        return []
