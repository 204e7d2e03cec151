"""A worker process: it computes one task at a time, can be ended alone, and does not outlive who started it."""

from __future__ import annotations

import gc
import importlib
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from relnav_sim.parent_watch import end_with_parent
from relnav_sim.safe_path import safe_path

if TYPE_CHECKING:
    from relnav_sim.runner.bound_task import Task
    from relnav_sim.runner.compute import Outcome

T = TypeVar("T")
Given = TypeVar("Given")

_THREADS = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMBA", "NUMEXPR")
_ONE_THREAD = dict.fromkeys((f"{library}_NUM_THREADS" for library in _THREADS), "1") | {"VECLIB_MAXIMUM_THREADS": "1"}


class Worker:
    """A process of its own executor: if it dies or is ended, no other worker notices.

    Attributes:
        started: Done once it is ready for work, or can't be.

    Raises:
        OSError: The system has no semaphores or pipes for it.
        RuntimeError: It has no memory for it.
    """

    def __init__(self) -> None:
        from joblib.externals.loky import ProcessPoolExecutor

        with started_apart():
            self._executor: Any = ProcessPoolExecutor(
                max_workers=1, initializer=end_with_parent, initargs=(os.getpid(),), env=_ONE_THREAD
            )
            try:
                self.started: Future[None] = self._executor.submit(_make_ready)
            finally:
                # The executor forgets both when it ends.
                self._manager = self._executor._executor_manager_thread
                self._processes = list(self._executor._processes.values())

    @property
    def is_lost(self) -> bool:
        """Whether nobody hears of its end any more: the executor's thread has died, which happens without memory."""
        return self._manager is None or not self._manager.is_alive()

    def submit(self, task: Task) -> Future[Outcome]:
        """Hand over a task; the future has the exception `BrokenProcessPool` if the process dies of it."""
        from relnav_sim.runner.worker_task import work

        return self.call(work, task)

    def call(self, function: Callable[[Given], T], given: Given) -> Future[T]:
        """Have a function called in the process, as `submit` has a task computed."""
        from joblib.externals.loky.process_executor import BrokenProcessPool

        try:
            called: Future[T] = self._executor.submit(function, given)
            return called
        except BrokenProcessPool as error:  # it died while it had nothing to do
            dead: Future[T] = Future()
            dead.set_exception(error)
            return dead

    def end(self) -> None:
        """End the process at once, whatever it is at, and the processes that it has started."""
        self._executor.shutdown(kill_workers=True)
        for process in self._processes:  # as it does without its thread
            if process.is_alive() and process.pid is not None:
                os.kill(process.pid, signal.SIGKILL)
            process.join()


@contextmanager
def started_apart() -> Iterator[None]:
    """Start processes that import nothing from the working folder, and that the terminal does not end.

    A Ctrl-C, or the terminal's own end, goes to all its processes; the parent ends its workers itself.
    """
    from multiprocessing.resource_tracker import ensure_running

    from joblib.externals.loky.backend import resource_tracker

    # Workers inherit the mask. The trackers start with the first worker and would unblock SIGINT for it, so they come
    # before; SIGHUP they leave alone, and it would kill them.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        with safe_path():
            ensure_running()
            resource_tracker.ensure_running()
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _make_ready() -> None:
    """Load what tasks need, so that an environment in which that fails shows at the start and with its traceback."""
    from relnav_sim.kernels.code_folder import hush
    from relnav_sim.kernels.compiling import no_search_for_garbage
    from relnav_sim.runner.worker_process import prepare_worker

    with no_search_for_garbage():
        hush()  # the campaign's process has said it
        importlib.import_module("relnav_sim.kernels.compiler")  # before a plug-in imports numba itself
        prepare_worker()
        for name in ("relnav_sim.runner.worker_task", "scipy.linalg", "scipy.special"):  # those two within every task
            importlib.import_module(name)
    gc.freeze()
    gc.unfreeze()  # which leaves all that is loaded counted as old, and seldom looked at
