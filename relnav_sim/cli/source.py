"""Which result a command is about: the file given, the newest, or what is finished of a campaign by now."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import RESULTS, existing, regular
from relnav_sim.cli.output import say

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
    if path.name.endswith(SHARDS):
        path = path.with_name(path.name.removesuffix(SHARDS))
    if path.is_dir():
        raise UserError(f"'{path}' is a directory; give a result file, as results/NAME.h5")
    from relnav_sim.runner.unfinished import is_unfinished, results_so_far

    if not is_unfinished(path):
        regular(path)
        yield existing(path, RESULTS)
        return
    say(f"{path} is not finished; this is about the runs that are", err=True)
    with results_so_far(path) as so_far:
        yield so_far
