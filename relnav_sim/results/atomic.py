"""Files that are either whole or absent: written under a temporary name, synced, then renamed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ERRNO = re.compile(r"errno = (\d+)")


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it takes the place of ``path`` when the block ends without an error.

    The file and then its directory are synced, so that after a loss of power the old file or the new one is
    there, never half of one. On an error the temporary file is removed and ``path`` is as it was.

    Raises:
        OSError: The directory can't be written, or the disk is full.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        with open(temporary, "rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except (OSError, RuntimeError) as error:
        temporary.unlink(missing_ok=True)
        raise _told_plainly(error, path) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_directory(path.parent)


def remove_temporaries(folder: Path, name: str = "*") -> None:
    """Remove what writers that were killed have left in a folder; none may be at work there.

    Args:
        folder: The folder.
        name: Name of the file that was being written; default: any.
    """
    for temporary in folder.glob(f".{name}.*.tmp"):
        temporary.unlink(missing_ok=True)


def sync_directory(directory: Path) -> None:
    """Sync a directory, so that a rename in it survives a loss of power."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _told_plainly(error: OSError | RuntimeError, path: Path) -> Exception:
    """Return an error of the system with the file's name and its usual words.

    HDF5 tells a full disk by a `RuntimeError` or an `OSError` whose number stands in the text only.
    """
    stated = error.errno if isinstance(error, OSError) else None
    found = _ERRNO.search(str(error))
    number = stated or (int(found[1]) if found else 0)
    return OSError(number, os.strerror(number), os.fspath(path)) if number else error
