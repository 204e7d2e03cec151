"""What a worker of another machine has computed, verified and put in its place before anybody believes it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import read_bound
from relnav_sim.results.shards import read_shard
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
        _verify(task.path, task)
        return
    with written_whole(task.path) as temporary:
        temporary.write_bytes(came.shard)
        _verify(temporary, task)


def _see(path: Path) -> None:
    end = time.monotonic() + LONGEST_UNSEEN_S
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.1)


def _verify(path: Path, task: Task) -> None:
    if isinstance(task, BoundTask):
        bound = read_bound(path)
        found = bound.seed, bound.case_id, dict(bound.filter_ids), ()
    else:
        info, _ = read_shard(path)
        found = info.seed, info.case_id, dict(info.filter_ids), info.runs
    runs = () if isinstance(task, BoundTask) else task.runs
    if found != (task.seed, task.case.id, task.case.filter_ids, runs):
        raise ResultsError(f"{path}: this is the result of another task")
