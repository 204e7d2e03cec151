"""Tasks over the workers of a Dask scheduler, which may come late and go at any time.

Every task is given to one thread of one worker, so that a worker that dies says which task it was at, a host can be
kept free for a suspect, and no worker of another relnav is given any. Nothing here believes another machine's clock,
its processes or its files.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures import Future as ThreadFuture
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.executors.content import Content, digest_of_content
from relnav_sim.runner.executors.dask_client import Connection, check_installed
from relnav_sim.runner.executors.identity import identity
from relnav_sim.runner.executors.interface import LOOKED_AT_EVERY_S, Ended, Fault, Say, WorkersError
from relnav_sim.runner.executors.received import MOST_TAKEN, Taken, take
from relnav_sim.runner.executors.shared_folder import Token, leave_token
from relnav_sim.runner.machines import note_machine
from relnav_sim.runner.rehearsal import compile_kernels

if TYPE_CHECKING:
    from distributed import Future

WORKERS_LOOKED_AT_EVERY_S = 1.0
POLLED_EVERY_S = 0.02
LONGEST_TRANSFER_S = 60.0
LONGEST_STOP_S = 0.5
LONGEST_WITHOUT_WORKERS_S = 120.0
"""For a cluster of our own; others may have to wait for a queue."""


@dataclass
class _Member:
    """A worker.

    Attributes:
        address: Its address, which is another one when it begins anew.
        machine: Its machine, as the scheduler sees it.
        places: Its threads.
        admission: The asking whether it can work, while that goes on.
        is_ready: Whether it can.
        is_leaving: Whether it is told to end.
        has_taken_leave: Whether it is gone, and in order.
        host: Name of its machine, as it says itself.
        processor: Its processor.
        tasks: What it is at, by future.
    """

    address: str
    machine: str
    places: int
    admission: Future | None = None
    is_ready: bool = False
    is_leaving: bool = False
    has_taken_leave: bool = False
    host: str = ""
    processor: str = ""
    tasks: dict[Future, Task] = field(default_factory=dict)

    @property
    def free(self) -> int:
        return self.places - len(self.tasks) if self.is_ready and not self.is_leaving else 0

    def __str__(self) -> str:
        return f"the worker {self.address} on {self.host or self.machine}"


@dataclass(frozen=True)
class _Taking:
    """A result that is being sent here: of which worker and task, there and here."""

    member: _Member
    task: Task
    future: Future
    taken: ThreadFuture[Taken]


class DaskCluster:
    """The workers of a Dask scheduler.

    Args:
        workers: Worker processes, where the cluster is one of this machine.
        timeout_s: Most seconds for a task, from when a worker begins it; None: no limit.
        scheduler: Address of the scheduler; None: a cluster of this machine.
        say: Told what a user should know, a sentence at a time.

    Raises:
        RefusedError: The package distributed is not installed.
    """

    def __init__(self, workers: int, timeout_s: float | None, scheduler: str | None, say: Say) -> None:
        check_installed()
        self._workers = workers
        self._timeout_s = timeout_s
        self._scheduler = scheduler
        self._say = say
        self._connection: Connection | None = None
        self._members: dict[str, _Member] = {}
        self._refused: dict[str, str] = {}
        self._looked_at = -1e9
        self._lonely_since: float | None = None
        self._waits = False
        self._begun: _Begun | None = None
        self._news: Any = None
        self._taking: list[_Taking] = []

    def make_ready(self, tasks: Sequence[Task], say: Say) -> None:
        """Have the kernels compiled where this machine computes; other workers do it when they are admitted."""
        if self._scheduler is None:
            compile_kernels(tasks, say)

    def begin(self, tasks: Sequence[Task]) -> None:
        """Connect, and have the workers that are there asked to work on these tasks."""
        if self._connection is None:
            self._connection = Connection(self._scheduler, self._workers)
        from distributed import as_completed

        self._news = as_completed(loop=self._connection.client.loop)
        self._begun = _Begun.of(tasks)
        self._members.clear()
        self._refused.clear()
        self._looked_at, self._lonely_since = -1e9, None
        self._look_at_workers()

    def free(self) -> Counter[str]:
        """Return the free threads of the workers that can work, by machine."""
        found: Counter[str] = Counter()
        for member in self._members.values():
            if member.is_ready:
                found[member.machine] += member.free
        return found

    def submit(self, task: Task, host: str) -> None:
        """Give a task to the worker on that machine that has most threads free."""
        from relnav_sim.runner.executors.on_worker import compute_order

        assert self._begun is not None
        member = max((m for m in self._members.values() if m.machine == host), key=lambda m: m.free)
        future = self._sent(member, compute_order, self._begun.order(task), self._timeout_s)
        member.tasks[future] = task

    def _sent(self, member: _Member, function: Any, *given: Any) -> Future:
        assert self._connection is not None
        options = {"workers": [member.address], "allow_other_workers": False, "pure": False, "retries": 0}
        future: Future = self._connection.client.submit(function, *given, **options)
        self._news.add(future)
        return future

    def as_completed(self) -> list[Ended]:
        """Wait a moment; return the tasks that have ended, or whose workers have gone."""
        ended = self._look_at_workers()
        began = time.monotonic()
        while True:
            while self._news.has_ready() and len(self._taking) < MOST_TAKEN:
                self._take(next(self._news))
            for taking in [taking for taking in self._taking if taking.taken.done()]:
                self._taking.remove(taking)
                ended.append(self._received(taking))
            if ended or time.monotonic() - began >= LOOKED_AT_EVERY_S:
                return ended
            wait([taking.taken for taking in self._taking], POLLED_EVERY_S, FIRST_COMPLETED)
            if not self._taking:
                time.sleep(POLLED_EVERY_S)

    def _take(self, future: Future) -> None:
        """Have what came of a task sent here; its place is free meanwhile."""
        for member in self._members.values():
            if future is member.admission:
                self._admitted(member, future)
                return
            if (task := member.tasks.pop(future, None)) is not None:
                self._taking.append(_Taking(member, task, future, take(task, future, LONGEST_TRANSFER_S)))
                return

    def _received(self, taking: _Taking) -> Ended:
        """Return what came of a task, its file written; whatever goes wrong on the way is a lost worker."""
        from distributed import CancelledError, KilledWorker
        from distributed.comm import CommClosedError

        self._check_scheduler()
        member, task = taking.member, taking.task
        try:
            taken = taking.taken.result()
        except ResultsError as error:
            return Ended(task, None, Fault.LOST, f"{member} returned a file that does not verify: {error}")
        came, problem = taken.came, taken.problem
        if isinstance(problem, KilledWorker | CancelledError | CommClosedError | TimeoutError):
            member.is_ready = False  # if it is still there, it is asked again
            member.has_taken_leave |= member.is_leaving or self._ended_in_order(member.address)
            return _gone(member, task, type(problem).__name__)
        if isinstance(problem, OSError):  # a full disk there, say
            self._put_aside(member, f"{type(problem).__name__}: {problem}")
            return Ended(task, None, Fault.SENT_BACK, f"{member} did not compute it: {problem}")
        if came is None:
            assert problem is not None
            raise problem
        if came.fault is Fault.SENT_BACK:
            member.is_ready = False  # it has begun anew under the same address, or ends
        if came.outcome is None:
            return Ended(task, None, came.fault, came.reason)
        note_machine(task.path, member.host, member.processor)
        return Ended(task, came.outcome)

    def _look_at_workers(self) -> list[Ended]:
        """Take note of the workers that have come and gone; return the tasks of those that are gone."""
        now = time.monotonic()
        if now - self._looked_at < WORKERS_LOOKED_AT_EVERY_S:
            return []
        self._looked_at = now
        there = self._there()
        ended = []
        for address in [address for address in self._members if address not in there]:
            member = self._members.pop(address)
            taking = [taking.future for taking in self._taking if taking.member is member]
            at_work = bool(member.tasks or taking)
            member.has_taken_leave = at_work and (member.is_leaving or self._ended_in_order(address))
            for future in taking:
                _give_up(future)  # what it has not sent by now, it never will
            for future, task in member.tasks.items():
                ended.append(_gone(member, task, "it is gone"))
                future.release()
            if member.admission is not None:
                member.admission.release()
        for address, info in there.items():
            member = self._members.setdefault(address, _Member(address, info["host"], info["nthreads"]))
            member.is_leaving = info["status"] not in ("running", "paused")
            unasked = not member.is_ready and member.admission is None and address not in self._refused
            if unasked and not member.is_leaving:
                self._ask(member)
        self._see_that_somebody_works(now)
        return ended

    def _there(self) -> dict[str, Any]:
        assert self._connection is not None
        self._check_scheduler()
        try:
            workers: dict[str, Any] = self._connection.client.scheduler_info(n_workers=-1)["workers"]
        except (OSError, TimeoutError):
            raise self._scheduler_gone() from None
        return workers

    def _ended_in_order(self, address: str) -> bool:
        """Return whether a worker that is gone has taken leave: at the end of its time, or told to end by a signal."""
        assert self._connection is not None
        try:
            events = self._connection.client.get_events(address)
        except (OSError, TimeoutError):
            raise self._scheduler_gone() from None
        in_order = False
        for _, event in events:
            action = event.get("action")
            in_order |= action == "closing-worker" or (action == "remove-worker" and bool(event.get("expected")))
            in_order &= action != "add-worker"  # a former one under the same address
        return in_order

    def _check_scheduler(self) -> None:
        assert self._connection is not None
        if not self._connection.is_up:
            raise self._scheduler_gone()

    def _scheduler_gone(self) -> WorkersError:
        assert self._connection is not None
        return WorkersError(
            f"the Dask scheduler is gone ({self._connection.address}); what is finished is kept, and the same command "
            "goes on once it is there again"
        )

    def _ask(self, member: _Member) -> None:
        from relnav_sim.runner.executors.on_worker import admit

        assert self._begun is not None
        begun = self._begun
        member.admission = self._sent(
            member, admit, identity(), begun.digest, begun.packed, begun.tokens, begun.content.files()
        )

    def _admitted(self, member: _Member, future: Future) -> None:
        member.admission = None
        try:
            admitted = future.result(timeout=LONGEST_TRANSFER_S)
        except Exception as error:  # its relnav is so different that it can't even be asked
            why = f"it can't run this relnav, or its scheduler can't: {type(error).__name__}: {error}"
            refused = "" if self._is_gone(member) else why
        else:
            refused = admitted.refused
            member.host, member.processor = admitted.host, admitted.processor
        finally:
            future.release()
        member.is_ready = True
        if refused:
            self._put_aside(member, refused)

    def _put_aside(self, member: _Member, why: str) -> None:
        """Give a worker nothing more; what it is at, it may bring to its end."""
        member.is_ready = False
        self._refused[member.address] = f"{member}: {why}"
        self._say(f"warning: {member} is not used: {why}")

    def _is_gone(self, member: _Member) -> bool:
        return member.address not in self._there()

    def _see_that_somebody_works(self, now: float) -> None:
        """Say that workers are waited for.

        Raises:
            RefusedError: There are some, and none can work.
            WorkersError: Ours do not come up.
        """
        assert self._connection is not None
        refused = [self._refused[address] for address in self._members if address in self._refused]
        if len(refused) < len(self._members):
            self._lonely_since, self._waits = None, False
            return
        if refused:
            raise RefusedError(
                "no Dask worker can compute this campaign; every machine needs the relnav, the Python, the packages "
                f"and the plug-ins of this one. What is finished is kept. {'; '.join(refused)}"
            )
        self._lonely_since = now if self._lonely_since is None else self._lonely_since
        if self._connection.is_own and now - self._lonely_since > LONGEST_WITHOUT_WORKERS_S:
            raise WorkersError("no Dask worker comes up on this machine; what is finished is kept")
        if not self._connection.is_own and not self._waits:
            self._waits = True
            self._say(f"waiting for workers of {self._connection.address}; there are none yet")

    def discard(self) -> None:
        """Forget all tasks; the workers end what they are at when they learn of it, within a second."""
        for member in self._members.values():
            for future in [*member.tasks, *([member.admission] if member.admission is not None else [])]:
                future.release()
        self._members.clear()
        for taking in self._taking:
            _give_up(taking.future)
        wait([taking.taken for taking in self._taking], LONGEST_STOP_S)
        self._taking.clear()
        if self._begun is not None:
            self._begun.forget()
        self._begun = None

    def close(self) -> None:
        """Leave the cluster; end it if it is our own."""
        if self._connection is not None:
            self._connection.close()
        self._connection = None


@dataclass(frozen=True)
class _Begun:
    """The tasks under way: their content, and a token in each of their folders."""

    content: Content
    digest: str
    packed: bytes
    tokens: tuple[Token, ...]

    @classmethod
    def of(cls, tasks: Sequence[Task]) -> _Begun:
        content = Content.of(tasks)
        packed = content.packed()
        return cls(content, digest_of_content(packed), packed, tuple(map(leave_token, content.folders)))

    def order(self, task: Task) -> Any:
        return self.content.order(self.digest, task)

    def forget(self) -> None:
        for token in self.tokens:
            token.path.unlink(missing_ok=True)


def _give_up(future: Future) -> None:
    """Have whoever waits for a future stop waiting; there may be no scheduler any more to tell it to."""
    with suppress(Exception):
        future.cancel()


def _gone(member: _Member, task: Task, how: str) -> Ended:
    """Return a task whose worker is gone."""
    if member.has_taken_leave:
        return Ended(task, None, Fault.SENT_BACK, f"{member} was told to end, or its time was over")
    return Ended(
        task,
        None,
        Fault.LOST,
        f"{member} was lost with it ({how}): killed, most likely for want of memory, or its machine, its link to the "
        "scheduler or its time came to an end",
    )
