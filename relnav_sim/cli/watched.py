"""The options with which a command that computes for long is watched, the same for every such command."""

from __future__ import annotations

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
    """Refuse a log that is a folder.

    Raises:
        UserError: It is.
    """
    if log is not None and log.is_dir():
        raise UserError(f"--log {log} is a directory; give a file's name")


def check_timeout(timeout_s: float | None, backend: BackendName) -> None:
    """Refuse a limit of time where nothing could end what takes longer.

    Raises:
        UserError: There is one.
    """
    if backend is BackendName.SEQUENTIAL and timeout_s is not None:
        raise UserError("--timeout-s needs worker processes, which can be ended; leave out --backend sequential")
