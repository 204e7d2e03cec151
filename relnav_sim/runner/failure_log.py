"""The log of a campaign's failures, beside its shards: the full traceback of what the results tell in a line."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from relnav_sim.runner.shard_folder import shard_folder

NAME = "failures.log"
LARGEST = 10_000_000
"""Bytes after which nothing is added: the first failures tell most."""


def log_beside(out: Path) -> Path | None:
    """Return the log that belongs to a results file, of a campaign or of a single run; None where there is none."""
    places = (shard_folder(out) / NAME, out.with_name(f"{out.name}.{NAME}"))
    return next((place for place in places if place.exists()), None)


def keep_log(folder: Path, out: Path) -> None:
    """Move the log out of a folder that is to be removed, to the results file of its single run."""
    kept = out.with_name(f"{out.name}.{NAME}")
    kept.unlink(missing_ok=True)
    if (folder / NAME).exists():
        (folder / NAME).rename(kept)


def log_failure(folder: Path, heading: str, traceback: str) -> None:
    """Add a failure to the log; workers may do so at the same time.

    Args:
        folder: The shards' folder.
        heading: Whose failure it is.
        traceback: The traceback.
    """
    add_to_log(folder, f"{heading}\n{traceback.rstrip()}\n\n")


def add_to_log(folder: Path, text: str) -> None:
    """Add entries to the log; workers may do so at the same time.

    Args:
        folder: The shards' folder.
        text: The entries.
    """
    entry = text.encode(errors="backslashreplace")
    with contextlib.suppress(OSError):  # the failure is in the results; a log that can't be written must not end them
        log = os.open(folder / NAME, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        try:
            if os.fstat(log).st_size < LARGEST:
                os.write(log, entry)
        finally:
            os.close(log)
