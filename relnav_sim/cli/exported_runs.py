"""Which case and runs of a result are exported, and to which files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import target_file
from relnav_sim.cli.output import new_file

if TYPE_CHECKING:
    from relnav_sim.results import Results


def chosen_case(results: Results, case: str | None) -> int:
    """Return the index of the case of a number, label or id; None: the first."""
    return results.case_index(case or 0)


def chosen_runs(results: Results, result: Path, runs: Sequence[int]) -> list[int]:
    """Return the numbers of the runs to be written; the first that the result holds where none is asked for.

    Raises:
        UserError: The result does not hold one of them.
    """
    held = results.runs
    if not held:
        raise UserError(f"{result} holds no run yet")
    for run in runs:
        if run not in held:
            raise UserError(f"{result} holds no run {run}; its runs go from {held[0]} to {held[-1]}")
    return sorted(set(runs)) or [held[0]]


def file_of(result: Path, out: str | None, name: str, files: int, what: str) -> Path:
    """Return the file of this name that is written beside the result, or where ``--out`` says.

    Args:
        result: The result's path.
        out: The file, or a folder; None: beside the result.
        name: Name of the file in a folder.
        files: How many files are written in all.
        what: What they hold, one each: ``orbits``.

    Raises:
        UserError: They can't all go to one file.
    """
    if out is None:
        return result.with_name(name)
    path = target_file(out, name)
    if files > 1 and path.name != name:
        raise UserError(f"{files} {what} go to {files} files; give --out a folder, as {out}/")
    return path


def writable(path: Path, result: Path, overwrite: bool) -> None:
    """Refuse a file that is the result itself, or there already.

    Raises:
        UserError: It is.
    """
    if path.exists() and result.exists() and path.samefile(result):
        raise UserError(f"{path} is the result itself; give another --out")
    new_file(path, overwrite)
