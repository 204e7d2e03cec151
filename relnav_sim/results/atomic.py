"""Files that are either whole or absent: written under a temporary name, synced, then renamed."""

from __future__ import annotations

import errno
import fcntl
import glob
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_ERRNO = re.compile(r"errno = (\d+)")


@contextmanager
def written_whole(path: Path, synced: bool = True) -> Iterator[Path]:
    """Give a temporary path to write to; it takes the place of ``path`` when the block ends without an error.

    The file and then its directory are synced, so that after a loss of power the old file or the new one is
    there, never half of one. On an error the temporary file is removed and ``path`` is as it was. Where ``path`` is a
    symbolic link, the file that it points to is written, and need not exist.

    Args:
        path: The file.
        synced: False for files that are soon made again, so that what a loss of power does to them doesn't matter.

    Raises:
        OSError: The directory can't be written, the disk is full, or the link points to itself.
    """
    path = target(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "ab") as mine:
            with suppress(OSError):  # some file systems can't lock
                fcntl.flock(mine, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _check_room(mine.fileno(), path)
            yield temporary
            if synced:
                os.fsync(mine.fileno())
        os.replace(temporary, path)
    except (OSError, RuntimeError) as error:
        temporary.unlink(missing_ok=True)
        raise _told_plainly(error, path) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if synced:
        sync_directory(path.parent)


def _check_room(file: int, path: Path) -> None:
    """Refuse to begin where not even what is replaced would fit a second time.

    HDF5 may crash, instead of telling it, where the disk is full before a group or a dataset is complete.

    Raises:
        OSError: The disk is full, or files may not be that large.
    """
    if path.is_file() and hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, 0, max(1, path.stat().st_size))
        os.ftruncate(file, 0)


def target(path: Path) -> Path:
    """Return the file that a symbolic link points to, which need not exist; any other path as it is.

    Raises:
        OSError: The link points to itself.
    """
    if not path.is_symlink():
        return path
    goal = Path(os.path.realpath(path))
    if goal.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
    return goal


def remove_temporaries(folder: Path, name: str | None = None) -> None:
    """Remove what writers that were killed have left in a folder; those at work hold a lock.

    Args:
        folder: The folder.
        name: Name of the file that was being written; default: any.
    """
    for temporary in folder.glob(f".{'*' if name is None else glob.escape(name)}.*.tmp"):
        with suppress(OSError), open(temporary, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            temporary.unlink()


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
