"""Where a result came from: versions, source revision, machine, times, command."""

from __future__ import annotations

import importlib.metadata
import math
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGES = ("numpy", "scipy", "h5py", "joblib", "pydantic", "PyYAML", "scikit-learn", "threadpoolctl")


@dataclass(frozen=True)
class Session:
    """One command that worked on a result.

    Attributes:
        command_line: The command.
        started: Start, UTC, ISO 8601.
        finished: End; of a command that was killed the time of its last finished block; empty while it runs.
        wall_time_s: Seconds between the two.
        relnav: Version of relnav, with the first letters of its source's commit where that is known.
    """

    command_line: str
    started: str
    finished: str
    wall_time_s: float
    relnav: str


def stored_session(stored: Any) -> Session:
    """Return a session from plain data.

    Raises:
        ValueError: It is none.
    """
    if not isinstance(stored, dict) or stored.keys() != {each.name for each in fields(Session)}:
        raise ValueError("no session")
    session = Session(**stored)
    if not all(isinstance(text, str) for text in (session.command_line, session.finished, session.relnav)):
        raise ValueError("no session")
    checked_moment(session.started)
    if session.finished:
        checked_moment(session.finished)
    checked_duration(session.wall_time_s)
    return session


def checked_moment(text: Any) -> datetime:
    """Return a moment with its time zone from ISO 8601.

    Raises:
        ValueError: It is none.
    """
    moment = datetime.fromisoformat(text) if isinstance(text, str) else None
    if moment is None or moment.tzinfo is None:
        raise ValueError(f"{text!r} is no moment")
    return moment


def checked_duration(seconds: Any) -> float:
    """Return a number of seconds.

    Raises:
        ValueError: It is none.
    """
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0 <= seconds < math.inf:
        raise ValueError(f"{seconds!r} is no duration")
    return float(seconds)


@dataclass(frozen=True)
class Provenance:
    """How a result came about.

    Attributes:
        versions: Version of Python, of relnav and of the packages that compute, by name.
        git_commit: Commit of relnav's source, empty where it does not run from a git work tree.
        git_dirty: 1 if that source had changes, 0 if not, -1 if not known.
        machine: Operating system, processor and number of cores.
        command_line: The command that wrote the file.
        started: Start of the first session, UTC, ISO 8601.
        finished: End of the last, UTC, ISO 8601.
        wall_time_s: Seconds of wall time that the simulation took, over all sessions.
        sessions: Every command that computed a part of the result, in order; interrupted campaigns have several.
            Versions, commit and machine above are those of the last.
        machines: How many blocks of runs each machine of a cluster has computed, by its name and processor; empty where
            all were computed on the machine above.
    """

    versions: dict[str, str]
    git_commit: str
    git_dirty: int
    machine: dict[str, str]
    command_line: str
    started: str
    finished: str
    wall_time_s: float
    sessions: tuple[Session, ...] = ()
    machines: Mapping[str, int] = field(default_factory=dict)


def collect_provenance(
    started: datetime,
    finished: datetime,
    wall_time_s: float,
    command: Sequence[str] | None = None,
    sessions: Sequence[Session] = (),
    machines: Mapping[str, int] | None = None,
) -> Provenance:
    """Return the provenance of a campaign that ran here.

    Args:
        started: Start, with its time zone.
        finished: End, with its time zone.
        wall_time_s: Seconds of wall time.
        command: The command line; default: this process' own.
        sessions: The commands that computed it, where there were several.
        machines: The machines of a cluster that computed it, with the number of their blocks.
    """
    commit, dirty = _own_revision()
    return Provenance(
        versions=dict(_versions()),
        git_commit=commit,
        git_dirty=dirty,
        machine=_machine(),
        command_line=command_line(command),
        started=started.astimezone(UTC).isoformat(timespec="seconds"),
        finished=finished.astimezone(UTC).isoformat(timespec="seconds"),
        wall_time_s=wall_time_s,
        sessions=tuple(sessions),
        machines=dict(machines or {}),
    )


def command_line(command: Sequence[str] | None = None) -> str:
    """Return a command line as text, without the folder of the program; default: this process' own."""
    command = sys.argv if command is None else command
    return shlex.join([Path(command[0]).name, *command[1:]]) if command else ""


def relnav_in_words() -> str:
    """Return the version of relnav, and the commit of its source where that is known: ``0.1.0 4bd0d51``."""
    from relnav_sim import __version__

    commit, dirty = _own_revision()
    return f"{__version__} {commit[:7]}{'+' if dirty == 1 else ''}".rstrip()


@cache
def _own_revision() -> tuple[str, int]:
    """Return the revision of relnav's source as this process found it first: what it has loaded stays as it was."""
    return source_revision(Path(__file__).resolve().parents[1])


def source_revision(package: Path) -> tuple[str, int]:
    """Return the commit of the work tree that tracks this package, and 1 if it has changes, 0 if not.

    A package that was installed into some environment may lie inside a stranger's work tree without being part
    of it; then, and without git, the commit is empty and the flag -1.
    """
    if _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return "", -1
    commit = _git(package, "rev-parse", "HEAD")
    changes = _git(package, "status", "--porcelain", "--", ".")
    if commit is None or changes is None:
        return "", -1
    return commit, int(bool(changes))


def _git(directory: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "--no-optional-locks", "-C", str(directory), *arguments],  # writes nothing, not even its index
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


@cache
def _versions() -> dict[str, str]:
    from relnav_sim import __version__

    versions = {"relnav": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return versions


def _machine() -> dict[str, str]:
    return {"system": platform.platform(), "processor": processor(), "cores": str(os.cpu_count() or 0)}


def processor() -> str:
    """Return the name of this machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
