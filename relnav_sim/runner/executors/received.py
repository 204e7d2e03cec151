"""What a worker of another machine has computed, verified and put in its place before anybody believes it.

Several at a time, in threads: most of it is hashing, copying and waiting for the disk, which leave the others a turn.
"""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import BoundResult, read_bound
from relnav_sim.results.shards import ShardInfo, read_shard
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.failure_log import add_to_log

if TYPE_CHECKING:
    from distributed import Future as DaskFuture

    from relnav_sim.runner.executors.on_worker import Came

LONGEST_UNSEEN_S = 10.0
"""A network file system may show this machine a new file with a delay."""
MOST_TAKEN = 4
"""Results that are taken at a time; it bounds the memory for them, too."""


@dataclass(frozen=True)
class Taken:
    """A result that is here, or the reason why it is not.

    Attributes:
        came: What came of the task, without the bytes of its file, which is where it belongs; None: it is not here.
        problem: What has kept it there.
    """

    came: Came | None
    problem: Exception | None = None


def take(task: Task, future: DaskFuture, longest_s: float) -> Future[Taken]:
    """Have what came of a task sent here, its file put in its place, and let the cluster forget it.

    Args:
        task: The task.
        future: What came of it.
        longest_s: Most seconds for sending it.

    Returns:
        Done once that is. It has the exception `ResultsError` where the file is damaged or that of another task, and
        `OSError` where it can't be written here.
    """
    taken: Future[Taken] = Future()

    def run() -> None:
        try:
            taken.set_result(_taken(task, future, longest_s))
        except BaseException as error:
            taken.set_exception(error)

    # Of a scheduler that is gone nothing may come; the thread of an executor would then keep this process from ending.
    threading.Thread(target=run, name="relnav-take", daemon=True).start()
    return taken


def _taken(task: Task, future: DaskFuture, longest_s: float) -> Taken:
    try:
        came: Came = future.result(timeout=longest_s)
    except Exception as problem:
        return Taken(None, problem)
    finally:
        future.release()
    if came.outcome is not None:
        receive(task, came)
    return Taken(replace(came, shard=None, log=""))


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
