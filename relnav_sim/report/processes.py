"""The cases of a large campaign, made by several processes at once, of which this one is the first."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from relnav_sim.parent_watch import end_with_parent
from relnav_sim.safe_path import safe_path

T = TypeVar("T")
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def shared_out(function: Callable[..., T], todo: Sequence[tuple[Any, ...]], processes: int) -> list[T]:
    """Return what a function makes of each set of arguments, in their order.

    This process takes from the end, the others from the start, until they meet: to start a process and to import all
    that it needs costs as much as a case, so that one fewer is started. The others have ended when this
    returns, with the semaphores that lead to them.

    Args:
        function: One that another process can import.
        todo: The arguments of each call.
        processes: How many processes, this one included.
    """
    others = min(processes, len(todo)) - 1
    if others < 1:
        return [function(*arguments) for arguments in todo]
    from joblib.externals.loky import ProcessPoolExecutor

    left = deque(range(len(todo)))
    found: dict[int, T] = {}

    def take_turns(take: Callable[[], int], call: Callable[[tuple[Any, ...]], T]) -> None:
        while left:
            try:
                place = take()
            except IndexError:  # another was quicker
                return
            found[place] = call(todo[place])

    with safe_path():
        pool = ProcessPoolExecutor(max_workers=others, initializer=_prepared, initargs=(os.getpid(),), env=_ONE_THREAD)
    try:
        pool.submit(int)  # starts them here: they would end with the thread that started them
        with ThreadPoolExecutor(others) as threads:
            try:
                elsewhere = [
                    threads.submit(
                        take_turns, left.popleft, lambda arguments: pool.submit(function, *arguments).result()
                    )
                    for _ in range(others)
                ]
                take_turns(left.pop, lambda arguments: function(*arguments))
            finally:
                left.clear()  # after a failure nothing else is begun
            for each in elsewhere:
                each.result()
    except BaseException:
        pool.shutdown(kill_workers=True)
        raise
    pool.shutdown()
    return [found[place] for place in range(len(todo))]


def _prepared(parent: int) -> None:
    """Make this process end with its parent, and not when it holds 300 MB more than at its start."""
    from joblib.externals.loky import process_executor

    from relnav_sim.kernels.code_folder import hush

    hush()  # the parent calls the same kernels, and says it if they can't be kept
    end_with_parent(parent)
    process_executor._MAX_MEMORY_LEAK_SIZE = sys.maxsize  # Loky takes what a case needs for a leak; it has no option
