"""The sessions of a campaign: each command that computed a part of it, kept beside the shards.

A session that is killed can't write its end; the next one fills it in with the time of the last finished block. All
this is only history: nothing in it, or none, keeps a campaign from going on.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from relnav_sim import __version__
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.provenance import (
    Provenance,
    Session,
    collect_provenance,
    command_line,
    relnav_in_words,
    stored_session,
)
from relnav_sim.results.shard_files import newest_shard_s

SESSIONS = "sessions.json"


def begin_session(folder: Path) -> None:
    """Note that this command begins to compute."""
    now = datetime.now(UTC)
    _write(folder, [*past_sessions(folder), Session(command_line(), _iso(now), "", 0.0, relnav_in_words())])


def end_session(folder: Path) -> None:
    """Note that this command, the last that began, has ended."""
    match _read(folder):
        case [*earlier, last]:
            _write(folder, [*earlier, _ended(last, datetime.now(UTC))])


def past_sessions(folder: Path) -> list[Session]:
    """Return the sessions of a folder of shards, each with an end; none is told of that lies in the future."""
    sessions = _read(folder)
    newest = newest_shard_s(folder)
    now = datetime.now(UTC)
    last_block = datetime.fromtimestamp(min(newest, now.timestamp()), UTC)
    ended = [session if session.finished else _ended(session, last_block) for session in sessions]
    return [_before(session, now) for session in ended]


def other_versions(folder: Path) -> list[str]:
    """Return the other versions of relnav that have computed a part of what is in a folder of shards."""
    return sorted({session.relnav.partition(" ")[0] for session in _read(folder)} - {__version__, ""})


def provenance_of(sessions: Sequence[Session], machines: Mapping[str, int] | None = None) -> Provenance:
    """Return the provenance of what these sessions, on these machines, have computed and this command writes."""
    if not sessions:
        now = datetime.now(UTC)
        return collect_provenance(now, now, 0.0, machines=machines)
    return collect_provenance(
        min(datetime.fromisoformat(session.started) for session in sessions),
        max(datetime.fromisoformat(session.finished) for session in sessions),
        sum(session.wall_time_s for session in sessions),
        sessions=sessions,
        machines=machines,
    )


def _before(session: Session, now: datetime) -> Session:
    """Return a session with times that a clock which was wrong has put into the future set to now."""
    start, end = (min(datetime.fromisoformat(time), now) for time in (session.started, session.finished))
    if start < now > end:
        return session
    wall_time_s = min(session.wall_time_s, max((end - start).total_seconds(), 0.0))
    return replace(session, started=_iso(start), finished=_iso(end), wall_time_s=wall_time_s)


def _ended(session: Session, end: datetime) -> Session:
    start = datetime.fromisoformat(session.started)
    end = max(start, end)
    return replace(session, finished=_iso(end), wall_time_s=(end - start).total_seconds())


def _iso(time: datetime) -> str:
    return time.isoformat(timespec="milliseconds")


def _read(folder: Path) -> list[Session]:
    try:
        stored = json.loads((folder / SESSIONS).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return []
    sessions = []
    for one in stored if isinstance(stored, list) else []:
        with suppress(ValueError):
            sessions.append(stored_session(one))
    return sessions


def _write(folder: Path, sessions: Sequence[Session]) -> None:
    with written_whole(folder / SESSIONS) as temporary:
        temporary.write_text(json.dumps([asdict(session) for session in sessions], indent=1), encoding="utf-8")
