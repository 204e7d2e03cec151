"""What a Dask worker does for a campaign: each of its threads has a block computed in a process of its own.

The thread waits, and ends the process where it takes too long, where the campaign's command has gone, or where the
worker is told to end. So compiled code that hangs holds up nothing, a process that dies takes neither the worker nor
other blocks with it, and no signal is needed, which only main threads have.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from relnav_sim.named_files import digest_of
from relnav_sim.runner.compute import Outcome
from relnav_sim.runner.executors.child_task import KEPT, carry_out, learn
from relnav_sim.runner.executors.content import Order
from relnav_sim.runner.executors.identity import differences, identity, machine
from relnav_sim.runner.executors.interface import KILLED, LOOKED_AT_EVERY_S, Fault
from relnav_sim.runner.executors.shared_folder import Token, put
from relnav_sim.runner.failure_log import NAME as LOG
from relnav_sim.runner.worker import Worker

T = TypeVar("T")
Given = TypeVar("Given")

LONGEST_IDLE_S = 300.0
"""A process without work is ended after this, so that nothing stays of a command that was killed."""
LARGEST_LOG = 200_000


@dataclass(frozen=True)
class Admitted:
    """What came of asking a worker to work.

    Attributes:
        refused: Why it can't, in words; empty: it can.
        host: Name of its machine.
        processor: Name of its processor.
    """

    refused: str
    host: str = ""
    processor: str = ""


@dataclass(frozen=True)
class Came:
    """What came of an order.

    Attributes:
        outcome: As in `Ended`.
        fault: As in `Ended`.
        reason: As in `Ended`.
        shard: The bytes of its file; None: the file is where it belongs.
        log: What is to be added to the log of failures.
    """

    outcome: Outcome | None = None
    fault: Fault | None = None
    reason: str = ""
    shard: bytes | None = None
    log: str = ""


@dataclass
class _Child:
    """A process, with the contents that it knows and the time since which it has had nothing to do."""

    worker: Worker
    knows: list[str] = field(default_factory=list)
    idle_since: float = 0.0


_contents: dict[str, tuple[bytes, tuple[Token, ...]]] = {}
_idle: list[_Child] = []
_lock = threading.Lock()


def admit(
    campaigns: dict[str, str], digest: str, packed: bytes, tokens: Sequence[Token], files: Mapping[str, str]
) -> Admitted:
    """Make this worker ready for the tasks of a content, if it is able to compute the same numbers.

    Args:
        campaigns: Identity of the campaign's own process.
        digest: Digest of the content.
        packed: The content.
        tokens: A token for each of its folders.
        files: Files that it reads, with their digests.
    """
    if different := differences(identity(), campaigns):
        return Admitted(f"it has {different}")
    for name, expected in files.items():
        try:
            found = digest_of(Path(name))
        except ValueError as error:
            return Admitted(f"it can't read a file that the campaign names: {error}")
        if found != expected:
            return Admitted(f"its {name}, which the campaign names, has other content than the one here")
    _end_in_order_by_signal()
    with _lock:
        _contents[digest] = packed, tuple(tokens)
        for old in list(_contents)[:-KEPT]:
            del _contents[old]
    try:
        child = _child(digest)
    except _GivenUpError:
        return Admitted("it is told to end")
    except Exception as error:  # whatever keeps a process from starting there
        return Admitted(f"no process can be started on it: {type(error).__name__}: {error}")
    _give_back(child)
    return Admitted("", *machine())


def compute_order(order: Order, timeout_s: float | None) -> Came:
    """Have a task computed in a process of its own; return what came of it, whatever that is.

    Args:
        order: The task.
        timeout_s: Most seconds for it, from now; None: no limit.
    """
    if order.content not in _contents:
        return Came(fault=Fault.SENT_BACK, reason="the worker has begun anew")
    tokens = _contents[order.content][1]
    try:
        child = _child(order.content)
    except _GivenUpError:
        return Came(fault=Fault.SENT_BACK, reason="the worker is told to end")
    except Exception as problem:
        why = f"no process can be started on the worker: {type(problem).__name__}: {problem}"
        return Came(fault=Fault.LOST, reason=why)
    with tempfile.TemporaryDirectory(prefix="relnav-", dir=_scratch(), ignore_cleanup_errors=True) as name:
        folder = Path(name)
        came, error = _waited_for(child, carry_out, (order, folder), timeout_s)
        if error is not None:
            child.worker.end()  # also after want of memory: who knows what it still holds
        log = _log_in(folder)
        if came is not None:
            _give_back(child)
            outcome, file = came
            left = put(folder / file, tokens[order.folder])
            return Came(outcome, shard=None if left else (folder / file).read_bytes(), log=log)
    if isinstance(error, TimeoutError):
        return Came(fault=Fault.TOO_LONG, reason=f"took longer than {timeout_s:g} s", log=log)
    if isinstance(error, _GivenUpError):
        return Came(fault=Fault.SENT_BACK, reason="the worker is told to end", log=log)
    if isinstance(error, MemoryError):
        return Came(fault=Fault.NO_MEMORY, reason=str(error), log=log)
    if _died(error):
        return Came(fault=Fault.KILLED, reason=KILLED, log=log)
    assert error is not None
    raise error


def _end_in_order_by_signal() -> None:
    """Let SIGTERM end this worker in order.

    A batch system sends it to all processes of a job. By itself a worker would go without a word, and nobody would know
    that it was no fault of its block.
    """
    from distributed import get_worker

    worker = get_worker()

    def leave(number: int, frame: object) -> None:
        worker.loop.add_callback(worker.close_gracefully, restart=True, reason="told to end by a signal")

    def heed() -> None:
        with suppress(ValueError):  # the worker is not in the main thread of its process, so that this is another's
            before = signal.getsignal(signal.SIGTERM)
            if before is signal.SIG_DFL or getattr(before, "__module__", "") == "distributed._signals":
                signal.signal(signal.SIGTERM, leave)

    worker.loop.add_callback(heed)


def end_idle() -> None:
    """End the processes that have nothing to do."""
    with _lock:
        ended = _idle[:]
        _idle.clear()
    for child in ended:
        child.worker.end()


class _GivenUpError(Exception):
    """Nobody waits for the task any more, or the worker is told to end."""


def _child(digest: str) -> _Child:
    """Return a process that knows a content; an idle one, or a new one.

    Raises:
        OSError: None can be started.
        RuntimeError: None can be started.
    """
    with _lock:
        knowing = [child for child in _idle if digest in child.knows] or _idle
        child = knowing[-1] if knowing else None
        if child is not None:
            _idle.remove(child)
    if child is None:
        with _lock, _allowed_to_start_processes():
            child = _Child(Worker())
        error = _waited(child, child.worker.started, None)[1]
        if error is not None:
            child.worker.end()
            raise error
    if digest not in child.knows:
        error = _waited_for(child, learn, (digest, _contents[digest][0]), None)[1]
        if error is not None:
            child.worker.end()
            raise error
        child.knows = [*child.knows, digest][-KEPT:]  # as it does itself
    return child


def _give_back(child: _Child) -> None:
    child.idle_since = time.monotonic()
    with _lock:
        _idle.append(child)
    timer = threading.Timer(LONGEST_IDLE_S + 1, _end_long_idle)
    timer.daemon = True
    timer.start()


def _end_long_idle() -> None:
    with _lock:
        ended = [child for child in _idle if time.monotonic() - child.idle_since > LONGEST_IDLE_S]
        for child in ended:
            _idle.remove(child)
    for child in ended:
        child.worker.end()


def _waited_for(
    child: _Child, function: Callable[[Given], T], given: Given, timeout_s: float | None
) -> tuple[T | None, BaseException | None]:
    return _waited(child, child.worker.call(function, given), timeout_s)


def _waited(child: _Child, future: Future[T], timeout_s: float | None) -> tuple[T | None, BaseException | None]:
    """Wait for a process; return what it returns, or what it raises or comes to.

    Only the time of this waiting counts, by this machine's own clock, and not a while in which the machine slept.
    """
    watched_s = 0.0
    while not future.done():
        if child.worker.is_lost:
            return None, _broken()
        if timeout_s is not None and watched_s >= timeout_s:
            return None, TimeoutError()
        if _is_given_up():
            return None, _GivenUpError()
        before = time.monotonic()
        wait([future], LOOKED_AT_EVERY_S if timeout_s is None else min(LOOKED_AT_EVERY_S, timeout_s))
        watched_s += min(time.monotonic() - before, 2 * LOOKED_AT_EVERY_S)
    error = future.exception()
    return (future.result(), None) if error is None else (None, error)


def _is_given_up() -> bool:
    """Return whether the worker is closing, or the scheduler has taken the task back: the command has ended."""
    from distributed import get_worker
    from distributed.core import Status
    from distributed.worker import thread_state

    worker = get_worker()
    if worker.status not in (Status.running, Status.paused, Status.closing_gracefully, Status.init):
        return True
    known = worker.state.tasks.get(getattr(thread_state, "key", None))
    return known is None or known.state in ("cancelled", "resumed")


def _scratch() -> str | None:
    from distributed import get_worker

    folder: str = get_worker().local_directory
    return folder if os.path.isdir(folder) else None


def _log_in(folder: Path) -> str:
    with suppress(OSError):
        return (folder / LOG).read_text(encoding="utf-8", errors="replace")[:LARGEST_LOG]
    return ""


def _broken() -> BaseException:
    from joblib.externals.loky.process_executor import BrokenProcessPool

    error: BaseException = BrokenProcessPool()
    return error


def _died(error: BaseException | None) -> bool:
    return isinstance(error, type(_broken()))


@contextmanager
def _allowed_to_start_processes() -> Iterator[None]:
    """Let this process start others. Those that a nanny starts are daemons, which multiprocessing keeps from it.

    It does so because they would outlive a daemon that is killed; ours end with it by themselves.
    """
    config: dict[str, Any] = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    before = config.get("daemon")
    config["daemon"] = False
    try:
        yield
    finally:
        config["daemon"] = before
