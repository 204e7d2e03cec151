"""What a worker of another machine has computed, verified and put in its place before anybody believes it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import BoundResult, read_bound
from relnav_sim.results.shards import ShardInfo, read_shard
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.failure_log import add_to_log

if TYPE_CHECKING:
    from relnav_sim.runner.executors.on_worker import Came

LONGEST_UNSEEN_S = 10.0
"""A network file system may show this machine a new file with a delay."""


def receive(task: Task, came: Came) -> None:
    """Put the file of a task in its place, or find it there, and add to the log of failures.

    Raises:
        ResultsError: The file is damaged, or that of another task.
        OSError: It can't be written.
    """
    if came.log:
        add_to_log(task.folder, came.log)
    if came.shard is None:
        _see(task.path)
    else:
        with written_whole(task.path) as temporary:
            temporary.write_bytes(came.shard)
    try:
        _verify(task.path, task)
    except ResultsError:
        task.path.unlink(missing_ok=True)
        raise


def _see(path: Path) -> None:
    end = time.monotonic() + LONGEST_UNSEEN_S
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.1)


def _verify(path: Path, task: Task) -> None:
    found: BoundResult | ShardInfo
    if isinstance(task, BoundTask):
        found, runs_agree = read_bound(path), True
    else:
        found = info = read_shard(path)[0]
        runs_agree = info.runs == task.runs
    same = (found.seed, found.case_id, dict(found.filter_ids)) == (task.seed, task.case.id, task.case.filter_ids)
    if not (same and runs_agree):
        raise ResultsError(f"{path}: this is the result of another task")
