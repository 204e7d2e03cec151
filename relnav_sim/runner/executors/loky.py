"""Worker processes on this machine, each with an executor of its own, so that one that dies takes no other with it."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any

from relnav_sim.kernels import CompilerError
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.executors.interface import KILLED, LOOKED_AT_EVERY_S, Ended, Fault, Say, WorkersError
from relnav_sim.runner.rehearsal import compile_kernels
from relnav_sim.runner.worker import Worker

LONGEST_START_S = 300.0
TRIES = 2
HERE = "here"


@dataclass
class _Seat:
    """A place for a worker.

    Attributes:
        worker: Its process; None: none has been started.
        future: What it is at, its start or a task; None: nothing.
        task: The task; None: none.
        watched_s: How long it has been at it.
        failed_starts: How often in succession no process came up.
    """

    worker: Worker | None = None
    future: Future[Any] | None = None
    task: Task | None = None
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

    def compute(self, task: Task) -> None:
        assert self.worker is not None
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


class Loky:
    """Worker processes that stay from one set of tasks to the next; as many are started as there are tasks for.

    Args:
        workers: Most processes.
        timeout_s: Most seconds for a task, from when a worker begins it; None: no limit.
    """

    def __init__(self, workers: int, timeout_s: float | None) -> None:
        self._timeout_s = timeout_s
        self._seats = [_Seat() for _ in range(workers)]
        self._waiting: deque[Task] = deque()

    def make_ready(self, tasks: Sequence[Task], say: Say) -> None:
        """Have the kernels compiled."""
        compile_kernels(tasks, say)

    def begin(self, tasks: Sequence[Task]) -> None:
        """Do nothing: a task carries all that it needs."""

    def free(self) -> Counter[str]:
        """Return the seats without a task."""
        taken = sum(seat.task is not None for seat in self._seats) + len(self._waiting)
        return Counter({HERE: len(self._seats) - taken})

    def submit(self, task: Task, host: str) -> None:
        """Take a task; it is handed over as soon as a worker is up."""
        self._waiting.append(task)
        self._hand_over()

    def _hand_over(self) -> None:
        for seat in self._seats:
            if self._waiting and seat.is_idle:
                seat.compute(self._waiting.popleft())
        missing = len(self._waiting) - sum(seat.is_free for seat in self._seats)
        empty = [seat for seat in self._seats if seat.worker is None]
        for seat in empty[: max(missing, 0)]:
            try:
                seat.start()
            except (OSError, RuntimeError, MemoryError) as error:
                self._not_started(seat, error)

    def as_completed(self) -> list[Ended]:
        """Wait a moment; return the tasks that have ended or have taken too long."""
        self._hand_over()
        ended = []
        for seat in self._news():
            if seat.task is None:
                self._seat_started(seat)
            else:
                ended.append(self._ended(seat, seat.task))
        self._hand_over()
        return ended

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

    def _ended(self, seat: _Seat, task: Task) -> Ended:
        from joblib.externals.loky.process_executor import BrokenProcessPool

        assert seat.future is not None
        future = seat.future
        error = future.exception() if future.done() else BrokenProcessPool() if seat.is_lost else None
        if future.done() and error is None:
            seat.rest()
            return Ended(task, future.result())
        seat.end()  # also after want of memory: who knows what it still holds
        task.busy.unlink(missing_ok=True)
        if error is None:
            return Ended(task, None, Fault.TOO_LONG, f"took longer than {self._timeout_s:g} s")
        if isinstance(error, BrokenProcessPool):
            return Ended(task, None, Fault.KILLED, KILLED)
        if isinstance(error, MemoryError):
            return Ended(task, None, Fault.NO_MEMORY, str(error))
        raise error

    def discard(self) -> None:
        """End the workers that are at a task."""
        self._waiting.clear()
        for seat in self._seats:
            if seat.task is not None:
                seat.end()

    def close(self) -> None:
        """End all workers."""
        for seat in self._seats:
            seat.end()


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
