"""The options with which a command that computes for long is watched, the same for every such command."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.backend import BackendName
from relnav_sim.cli.failures import UserError

LogOption = Annotated[
    Path | None,
    typer.Option("--log", metavar="FILE", help="Add a line of JSON to this file for everything that happens."),
]
NotifyOption = Annotated[
    str | None,
    typer.Option("--notify", metavar="COMMAND", help="Run this once at the end, also after a failure or Ctrl-C."),
]
TimeoutOption = Annotated[
    float | None,
    typer.Option(
        "--timeout-s",
        metavar="S",
        min=0.1,
        help="Most seconds for a block of runs; a run that takes longer fails. Not with --backend sequential.",
    ),
]


def check_log(log: Path | None) -> None:
    """Refuse a log that can't be written, before anything else is.

    Raises:
        UserError: It is a folder.
        OSError: It has no folder, or may not be written.
    """
    if log is not None and log.is_dir():
        raise UserError(f"--log {log} is a directory; give a file's name")
    if log is not None and not log.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), os.fspath(log))
    if log is not None and not os.access(log if log.exists() else log.parent, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(log))


def check_timeout(timeout_s: float | None, backend: BackendName) -> None:
    """Refuse a limit of time where nothing could end what takes longer.

    Raises:
        UserError: There is one.
    """
    if backend is BackendName.SEQUENTIAL and timeout_s is not None:
        raise UserError("--timeout-s needs worker processes, which can be ended; leave out --backend sequential")
