"""Opening a file to read: what is no file, not permitted or in use is told from what is damaged."""

from __future__ import annotations

import fcntl
from pathlib import Path
from typing import BinaryIO

from relnav_sim.results.block import ResultsError, UnavailableError


def open_locked(path: Path) -> BinaryIO:
    """Open a file that no other program writes to.

    Raises:
        ResultsError: It is missing, empty or no file.
        UnavailableError: It is in use by another program, or may not be read.
    """
    try:
        if path.is_dir():
            raise ResultsError(f"{path} is a directory; give a file in it")
        if not path.exists():
            raise ResultsError(f"{path}: no such file")
        if not path.is_file():
            raise ResultsError(f"{path} is no regular file")
        raw = open(path, "rb")  # noqa: SIM115 - it stays open for the caller, who closes it
    except OSError as error:
        raise UnavailableError(f"{path} can't be opened: {error.strerror or error}") from None
    try:
        if not raw.read(1):
            raise ResultsError(f"{path} is empty")
        fcntl.flock(raw, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        raw.close()
        raise in_use(path) from None
    except ResultsError:
        raw.close()
        raise
    except OSError:
        pass  # Some file systems can't lock.
    return raw


def in_use(path: Path) -> UnavailableError:
    """Return the error of a file that another program writes to."""
    return UnavailableError(f"{path} is in use: another program has it open to write; close it there and try again")
