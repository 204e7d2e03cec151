"""Tasks over worker processes: who computes what, how long it may take, and what becomes of those that go wrong."""

from __future__ import annotations

import importlib
import time
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Literal, Self

from relnav_sim.crlb.case_bound import failed_bound
from relnav_sim.kernels import CompilerError
from relnav_sim.results.bound import write_bound
from relnav_sim.results.shards import write_shard
from relnav_sim.runner.blame import TaskQueue
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.compute import compute
from relnav_sim.runner.fault_isolation import failed_block, unknown_truth
from relnav_sim.runner.headline import Figures
from relnav_sim.runner.worker import Worker
from relnav_sim.simulation.learned import Learned

Backend = Literal["loky", "sequential"]

KILLED = "the worker process died: killed by the system, most likely out of memory, or a crash in compiled code"
LOOKED_AT_EVERY_S = 0.5
LONGEST_START_S = 300.0
TRIES = 2


class WorkersError(OSError):
    """No worker process can be started, or nothing can be computed; the message says why, as far as it is known."""


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


@dataclass
class _Seat:
    """A place for a worker.

    Attributes:
        worker: Its process; None: none has been started.
        future: What it is at, its start or a task; None: nothing.
        task: The task; None: none.
        alone: Whether no other task may be computed meanwhile.
        watched_s: How long it has been at it.
        failed_starts: How often in succession no process came up.
    """

    worker: Worker | None = None
    future: Future[Any] | None = None
    task: Task | None = None
    alone: bool = False
    watched_s: float = 0.0
    failed_starts: int = 0

    @property
    def is_idle(self) -> bool:
        return self.worker is not None and self.future is None

    @property
    def is_free(self) -> bool:
        """Whether it is idle or about to be."""
        return self.worker is not None and self.task is None

    @property
    def is_lost(self) -> bool:
        return self.worker is not None and self.worker.is_lost

    def start(self) -> None:
        self.worker = Worker()
        self._begin(self.worker.started, None)

    def compute(self, task: Task, alone: bool) -> None:
        assert self.worker is not None
        self.alone = alone
        self._begin(self.worker.submit(task), task)

    def _begin(self, future: Future[Any], task: Task | None) -> None:
        self.future, self.task, self.watched_s = future, task, 0.0

    def rest(self) -> None:
        self.future = self.task = None

    def end(self) -> None:
        if self.worker is not None:
            self.worker.end()
        self.worker = None
        self.rest()


class Pool:
    """Worker processes that stay from one set of tasks to the next; a context manager.

    A task whose process dies, that takes too long or that lacks memory is cut until the run and the filter to blame
    stand alone; these are written as failed, and the others are kept.

    Args:
        workers: Processes; the results do not depend on it.
        backend: ``loky`` or ``sequential``, in this process.
        timeout_s: Most seconds for a task, from when a worker begins it; None: no limit.

    Raises:
        ValueError: A limit of time for tasks in this process, which nothing could end.
    """

    def __init__(self, workers: int = 2, backend: Backend = "loky", timeout_s: float | None = None) -> None:
        if backend == "sequential" and timeout_s is not None:
            raise ValueError("timeout_s needs worker processes: what hangs in this process can't be ended from outside")
        self._backend = backend
        self._timeout_s = timeout_s
        self._seats = [_Seat() for _ in range(workers)]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for seat in self._seats:
            seat.end()

    def computed(self, tasks: Sequence[Task]) -> Generator[Done, None, None]:
        """Compute tasks in any order; yield each, or each of its pieces, as soon as its file is written.

        Raises:
            WorkersError: No worker comes up; what is finished is kept.
            OSError: A file can't be written.
        """
        queue = TaskQueue(tasks)
        yield from self._here(queue) if self._backend == "sequential" else self._by_workers(queue)

    def _here(self, queue: TaskQueue) -> Iterator[Done]:
        try:
            importlib.import_module("relnav_sim.kernels.compiler")
        except CompilerError as error:  # in a block it would be the failure of every run
            raise WorkersError(str(error)) from error
        learned = Learned()
        while queue:
            task = queue.take()
            try:
                outcome = compute(task, learned)
            except MemoryError as error:
                if queue.lacked_memory(task, alone=True):
                    yield failed_task(task, str(error), retry=True)
            else:
                yield Done(task, outcome.failures, outcome.figures)

    def _by_workers(self, queue: TaskQueue) -> Iterator[Done]:
        try:
            while queue or self._computing():
                self._hand_out(queue)
                for seat in self._news():
                    if seat.task is None:
                        self._seat_started(seat)
                    elif (done := self._ended(seat, seat.task, queue)) is not None:
                        yield done
        finally:
            for seat in self._computing():
                seat.end()

    def _computing(self) -> list[_Seat]:
        return [seat for seat in self._seats if seat.task is not None]

    def _hand_out(self, queue: TaskQueue) -> None:
        """Give tasks to the workers that have none, and start as many workers as there are tasks for."""
        if any(seat.alone for seat in self._computing()):
            return
        for seat in self._seats:
            alone = queue.suspecting or len(self._seats) == 1
            if queue and seat.is_idle and not (alone and self._computing()):
                seat.compute(queue.take(), alone)
                if alone:
                    return
        missing = (1 if queue.suspecting else len(queue)) - sum(seat.is_free for seat in self._seats)
        empty = [seat for seat in self._seats if seat.worker is None]
        for seat in empty[: max(missing, 0)]:
            try:
                seat.start()
            except (OSError, RuntimeError, MemoryError) as error:
                self._not_started(seat, error)

    def _news(self) -> list[_Seat]:
        """Wait a moment; return the seats whose work or start has ended or has taken too long.

        Only the time of this waiting counts: not that of whoever takes the results, nor a while in which this process
        was stopped itself.
        """
        busy = {seat.future: seat for seat in self._seats if seat.future is not None}
        before = time.monotonic()
        finished, going_on = wait(busy, LOOKED_AT_EVERY_S, FIRST_COMPLETED)
        watched_s = min(time.monotonic() - before, 2 * LOOKED_AT_EVERY_S)
        for future in going_on:
            busy[future].watched_s += watched_s
        return [s for future, s in busy.items() if future in finished or s.is_lost or self._too_long(s)]

    def _too_long(self, seat: _Seat) -> bool:
        limit = LONGEST_START_S if seat.task is None else self._timeout_s
        return limit is not None and seat.watched_s >= limit

    def _seat_started(self, seat: _Seat) -> None:
        assert seat.future is not None
        error: BaseException | None = TimeoutError(f"it was not ready for work in {LONGEST_START_S:g} s")
        if seat.future.done():
            error = seat.future.exception()
        elif seat.is_lost:
            error = RuntimeError("no thread to watch over it could be started, most likely for want of memory")
        if error is not None:
            self._not_started(seat, error)
            return
        seat.failed_starts = 0
        seat.rest()

    def _not_started(self, seat: _Seat, error: BaseException) -> None:
        """Try once more; then go on without this seat, if there is another one whose worker is at work."""
        seat.end()
        if isinstance(error, CompilerError):
            raise WorkersError(str(error)) from error
        seat.failed_starts += 1
        if seat.failed_starts < TRIES:
            return
        self._seats.remove(seat)
        if not any(other.is_idle or other.task is not None for other in self._seats):
            raise WorkersError(_cannot_start(error)) from None

    def _ended(self, seat: _Seat, task: Task, queue: TaskQueue) -> Done | None:
        """Return what came of a task; None where it or its pieces come up again."""
        from joblib.externals.loky.process_executor import BrokenProcessPool

        assert seat.future is not None
        future, alone = seat.future, seat.alone
        error = future.exception() if future.done() else BrokenProcessPool() if seat.is_lost else None
        if future.done() and error is None:
            seat.rest()
            outcome = future.result()
            return Done(task, outcome.failures, outcome.figures)
        seat.end()  # also after want of memory: who knows what it still holds
        task.busy.unlink(missing_ok=True)
        if error is None:
            reason = f"took longer than {self._timeout_s:g} s"
            return failed_task(task, reason, retry=False) if queue.too_long(task) else None
        if isinstance(error, BrokenProcessPool):
            return failed_task(task, KILLED, retry=False) if queue.killed(task, alone) else None
        if isinstance(error, MemoryError):
            return failed_task(task, str(error), retry=True) if queue.lacked_memory(task, alone) else None
        raise error


def failed_task(task: Task, reason: str, retry: bool) -> Done:
    """Write a task that can't be computed nor cut as failed, without a look at its truth, which may be the cause.

    Args:
        task: The task.
        reason: Why, in words.
        retry: Whether its runs lacked memory, so that they count as missing.
    """
    if isinstance(task, BoundTask):
        write_bound(task.path, failed_bound(task.case, task.seed, reason, retry=True))
        return Done(task, 0, {})
    (name,) = task.case.config.filters  # what can't be cut has no more
    truth = unknown_truth(task.case, task.runs)
    result = failed_block(task.case, task.runs, truth, reason, task.case_index, name, retry)
    write_shard(task.path, result, task.seed, task.filter_ids)
    return Done(task, 0 if retry else 1, {})


def _cannot_start(error: BaseException) -> str:
    """Return that no worker came up and why: what it said, or that it ended without a word to this process."""
    from joblib.externals.loky.process_executor import BrokenProcessPool

    if isinstance(error, BrokenProcessPool):
        why = "it ends as soon as it begins; what it says stands above"
    else:
        why = f"{type(error).__name__}: {error}\n{error.__cause__ or ''}".rstrip()
    return (
        "no worker process could be started; what is finished is kept, the same command goes on once this is mended, "
        f"and --backend sequential needs no workers; the reason: {why}"
    )
