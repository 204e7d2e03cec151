"""Files that commands are given: those that must be there, with the nearest name if not, and those to write."""

from __future__ import annotations

import errno
import os
import shlex
from collections.abc import Iterable
from pathlib import Path

from relnav_sim.cli.failures import UserError

CAMPAIGNS = ("*.yaml", "*.yml", "campaigns/*.yaml")
RESULTS = ("*.h5", "results/*.h5")
_MOST_NAMED = 5
_OF_CAMPAIGNS = (".yaml", ".yml")
_OF_RESULTS = (".h5", ".hdf5", "")


def existing(path: Path, patterns: Iterable[str]) -> Path:
    """Return a path that is there.

    Args:
        path: The path.
        patterns: What files of its kind are called, in its folder and in the working folder.

    Raises:
        FileNotFoundError: It is not there; the message names the nearest one that is.
    """
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT) + _hint(path, patterns), os.fspath(path))
    return path


def existing_result(path: Path) -> Path:
    """Return a results file that is there.

    Raises:
        UserError: It is a campaign.
        FileNotFoundError: It is not there; the message names the nearest one that is.
    """
    if existing(path, RESULTS).suffix.lower() in _OF_CAMPAIGNS:
        raise UserError(f"{path} is a campaign, no result; first: relnav run {shlex.quote(str(path))}")
    return path


def result_name(path: Path) -> Path:
    """Return a path that may become a results file.

    Raises:
        UserError: Its name ends as that of another format.
    """
    if path.suffix.lower() not in _OF_RESULTS:
        raise UserError(
            f"{path}: a result is an HDF5 file; give a name that ends in .h5 (relnav export makes a table of it)"
        )
    return path


def _hint(path: Path, patterns: Iterable[str]) -> str:
    from relnav_sim.near_names import nearest

    folders = (path.parent, Path()) if path.parent.is_dir() else (Path(),)
    found = dict.fromkeys(
        str(file) for folder in folders for pattern in patterns for file in sorted(folder.glob(pattern))
    )
    names: dict[str, str] = {}
    for file in found:
        names.setdefault(Path(file).name, file)
    near = nearest(path.name, names)
    if near is not None:
        return f"; did you mean {names[near]}?"
    verb = "is" if len(found) == 1 else "are"
    return f"; there {verb} {', '.join(found)}" if 0 < len(found) <= _MOST_NAMED else ""


def target_file(given: str | Path, name: str) -> Path:
    """Return the file that ``--out`` means: in a folder, which is there or ends in a slash, the file of this name.

    A folder that ends in a slash is made.

    Raises:
        UserError: It is a device or another special file.
        OSError: The folder can't be made.
    """
    path = Path(given)
    if str(given).endswith(("/", os.sep)):
        path.mkdir(parents=True, exist_ok=True)
    return regular(path / name if path.is_dir() else path)


def regular(path: Path) -> Path:
    """Return a path at which a file may be written or replaced.

    Raises:
        UserError: It names no file, or what is there is a folder, a device or a pipe.
    """
    if path.name in ("", ".", ".."):
        raise UserError(f"'{path}' names no file")
    if path.is_dir():
        raise UserError(f"{path} is a folder; give the name of a file in it")
    if path.exists() and not path.is_file():
        raise UserError(f"{path} is no regular file; give another name")
    return path
