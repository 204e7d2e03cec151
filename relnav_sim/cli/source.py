"""Which result a command is about: the file given, the newest, or what is finished of a campaign by now."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import existing_result, regular
from relnav_sim.cli.output import say

if TYPE_CHECKING:
    from relnav_sim.results.contents import Contents

SHARDS = ".shards"
"""What the folder of a result's shards is called besides the result's own name."""


def newest_result(folder: Path) -> Path:
    """Return the newest result in a folder, be it finished or not.

    Raises:
        UserError: There is none.
    """
    from relnav_sim.results.shard_files import newest_shard_s

    times = {path: path.stat().st_mtime for path in folder.glob("*.h5") if path.is_file()}
    for shards in folder.glob(f"*.h5{SHARDS}"):
        if newest_s := newest_shard_s(shards):
            path = folder / shards.name.removesuffix(SHARDS)
            times[path] = max(times.get(path, 0.0), newest_s)
    if not times:
        raise UserError(f"there is no result in {folder}/; first: relnav run FILE")
    return max(times, key=lambda path: times[path])


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Give the results file; of a campaign that runs or was interrupted, one of what is finished by now.

    Args:
        path: The results file, which need not exist yet, or its folder of shards.

    Raises:
        UserError: It is another directory.
    """
    from relnav_sim.runner.unfinished import results_so_far

    path, finished = _looked_at(path)
    if finished:
        yield path
        return
    with results_so_far(path) as so_far:
        yield so_far


def contents_by_now(path: Path) -> Contents:
    """Return what a result holds, or what is finished of a campaign by now; its shards are not merged for that.

    Args:
        path: As in `readable`.

    Raises:
        UserError: It is another directory.
    """
    from relnav_sim.results import open_results
    from relnav_sim.results.contents import contents_of
    from relnav_sim.runner.so_far import contents_so_far

    path, finished = _looked_at(path)
    if not finished:
        return contents_so_far(path)
    with open_results(path) as results:
        return contents_of(results)


def _looked_at(path: Path) -> tuple[Path, bool]:
    """Return the results file that is meant, and whether it holds all that its shards do."""
    from relnav_sim.runner.unfinished import is_unfinished

    if path.name.endswith(SHARDS):
        path = path.with_name(path.name.removesuffix(SHARDS))
    if path.is_dir():
        raise UserError(f"'{path}' is a directory; give a result file, as results/NAME.h5")
    if is_unfinished(path):
        say(f"{path} is not finished; this is about the runs that are", err=True)
        return path, False
    regular(path)
    return existing_result(path), True
