"""Tasks over an executor: who computes what, and what becomes of those that go wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from relnav_sim.crlb.case_bound import failed_bound
from relnav_sim.results.bound import write_bound
from relnav_sim.results.shards import write_shard
from relnav_sim.runner.blame import TIMES_LOST, TaskQueue
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.executors.choice import executor_of
from relnav_sim.runner.executors.interface import Backend, Ended, Fault, Say
from relnav_sim.runner.fault_isolation import failed_block, unknown_truth
from relnav_sim.runner.headline import Figures
from relnav_sim.runner.watch import Observer, Unwatched


@dataclass(frozen=True)
class Done:
    """A block or a bound whose file is written.

    Attributes:
        block: What was computed.
        failures: Failed runs of filters in it.
        figures: The headline figure of its runs.
    """

    block: Task
    failures: int
    figures: Figures


@dataclass(frozen=True)
class _Placed:
    """Where a task is computed, and whether no other task of ours is on that host meanwhile."""

    host: str
    alone: bool


class Pool:
    """Workers that stay from one set of tasks to the next; a context manager.

    A task whose process dies, that takes too long or that lacks memory is cut until the run and the filter to blame
    stand alone; these are written as failed, and the others are kept.

    Args:
        workers: Processes on this machine; the results do not depend on it.
        backend: ``loky`` or ``dask``, in worker processes; ``sequential``, in this process.
        timeout_s: Most seconds for a task, from when a worker begins it; None: no limit.
        scheduler: With ``dask``, the address of a scheduler, whose workers compute; None: a cluster of this machine.
        say: Told what a user should know, a sentence at a time.
        observer: Told what becomes of the tasks.

    Raises:
        ValueError: A limit of time for tasks in this process, which nothing could end.
        RefusedError: A backend whose package is not installed.
    """

    def __init__(
        self,
        workers: int = 2,
        backend: Backend = "loky",
        timeout_s: float | None = None,
        scheduler: str | None = None,
        say: Say = lambda sentence: None,
        observer: Observer | None = None,
    ) -> None:
        self._executor = executor_of(backend, workers, timeout_s, scheduler, say)
        self._placed: dict[Path, _Placed] = {}
        self._observer = observer or Unwatched()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.close()

    def make_ready(self, tasks: Sequence[Task], say: Say) -> None:
        """Have the kernels compiled that tasks need, before they are computed.

        Args:
            tasks: What is to be computed.
            say: Told that it takes a while.
        """
        self._executor.make_ready(tasks, say)

    def computed(self, tasks: Sequence[Task]) -> Generator[Done, None, None]:
        """Compute tasks in any order; yield each, or each of its pieces, as soon as its file is written.

        Raises:
            WorkersError: No worker comes up; what is finished is kept.
            RefusedError: All workers are of another relnav.
            OSError: A file can't be written.
        """
        if not tasks:
            return
        queue = TaskQueue(tasks)
        try:
            self._executor.begin(tasks)
            while queue or self._placed:
                self._hand_out(queue)
                self._observer.look()
                for ended in self._executor.as_completed():
                    alone = self._placed.pop(ended.task.path).alone
                    done = _judged(ended, alone, queue)
                    self._observer.ended(ended, None if done is None else done.failures)
                    if done is not None:
                        yield done
        finally:
            self._placed.clear()
            self._observer.discarded()
            self._executor.discard()

    def _hand_out(self, queue: TaskQueue) -> None:
        """Give tasks to free places: suspects to hosts that do nothing else, which are held back for them."""
        free = self._executor.free()
        busy = Counter(placed.host for placed in self._placed.values())
        closed = {placed.host for placed in self._placed.values() if placed.alone}
        hosts = sorted({*free, *busy} - closed, key=lambda host: (busy[host], host))
        held = hosts[: queue.suspects]
        for host in held:
            if free[host] and not busy[host]:
                self._submit(queue.take(), host, alone=True)
        for host in hosts[len(held) :]:
            for _ in range(min(free[host], len(queue) - queue.suspects)):
                self._submit(queue.take_unsuspected(), host, alone=free[host] + busy[host] == 1)

    def _submit(self, task: Task, host: str, alone: bool) -> None:
        self._placed[task.path] = _Placed(host, alone)
        self._observer.began(task, host)
        self._executor.submit(task, host)


def _judged(ended: Ended, alone: bool, queue: TaskQueue) -> Done | None:
    """Return what came of a task; None where it or its pieces come up again."""
    task = ended.task
    match ended.fault:
        case Fault.KILLED:
            return failed_task(task, ended.reason, retry=False) if queue.killed(task, alone) else None
        case Fault.LOST:
            # It may have been the worker's time, or its machine: no evidence against a run, which is tried again.
            again = f"{TIMES_LOST} workers were lost with it; of the last: {ended.reason}"
            return failed_task(task, again, retry=True) if queue.lost(task) else None
        case Fault.TOO_LONG:
            return failed_task(task, ended.reason, retry=False) if queue.too_long(task) else None
        case Fault.NO_MEMORY:
            return failed_task(task, ended.reason, retry=True) if queue.lacked_memory(task, alone) else None
        case Fault.SENT_BACK:
            return failed_task(task, ended.reason, retry=True) if queue.sent_back(task) else None
    assert ended.outcome is not None
    return Done(task, ended.outcome.failures, ended.outcome.figures)


def failed_task(task: Task, reason: str, retry: bool) -> Done:
    """Write a task that can't be computed nor cut as failed, without a look at its truth, which may be the cause.

    Args:
        task: The task.
        reason: Why, in words.
        retry: Whether its runs lacked memory, or a worker, so that they count as missing.
    """
    if isinstance(task, BoundTask):
        write_bound(task.path, failed_bound(task.case, task.seed, reason, retry=True))
        return Done(task, 0, {})
    (name,) = task.case.config.filters  # what can't be cut has no more
    truth = unknown_truth(task.case, task.runs)
    result = failed_block(task.case, task.runs, truth, reason, task.case_index, name, retry)
    write_shard(task.path, result, task.seed, task.filter_ids)
    return Done(task, 0 if retry else 1, {})
