"""What an executor of tasks is: it takes them, and tells which have ended and which have gone wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Literal, Protocol

from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.compute import Outcome

Backend = Literal["loky", "sequential", "dask"]
Say = Callable[[str], None]

KILLED = "the worker process died: killed by the system, most likely out of memory, or a crash in compiled code"
LOOKED_AT_EVERY_S = 0.5
"""How long an executor waits for news at a time."""


class WorkersError(OSError):
    """No worker process can be started, or nothing can be computed; the message says why, as far as it is known."""


class Fault(Enum):
    """What has gone wrong with a task, as far as it can be seen from outside."""

    KILLED = "killed"
    """The process that computed it died."""
    LOST = "lost"
    """The worker is gone, with whatever it was at: killed, its machine down, its time over."""
    SENT_BACK = "sent back"
    """Nothing is wrong with it: its worker did not begin, or was told to end."""
    TOO_LONG = "too long"
    NO_MEMORY = "no memory"


@dataclass(frozen=True)
class Ended:
    """A task that an executor is done with.

    Attributes:
        task: The task.
        outcome: What came of it, its file written where it belongs; None where something went wrong.
        fault: What that was.
        reason: Why, in words.
    """

    task: Task
    outcome: Outcome | None
    fault: Fault | None = None
    reason: str = ""


class Executor(Protocol):
    """Computes tasks in places, each on a host; a place computes one task at a time.

    A task's bits do not depend on where it is computed.
    """

    def make_ready(self, tasks: Sequence[Task], say: Say) -> None:
        """Have what tasks need prepared before any is submitted: compiled kernels."""
        ...

    def begin(self, tasks: Sequence[Task]) -> None:
        """Take note of what is to come, before the first of these tasks or of their pieces is submitted.

        Raises:
            WorkersError: Nothing can be computed.
        """
        ...

    def free(self) -> Counter[str]:
        """Return how many tasks each host can take now; hosts whose places are all taken count zero."""
        ...

    def submit(self, task: Task, host: str) -> None:
        """Have a task computed on a host that is free for it."""
        ...

    def as_completed(self) -> list[Ended]:
        """Wait a moment for tasks to end; return those that have.

        Raises:
            WorkersError: Nothing can be computed any more; what is finished is kept.
            OSError: A file can't be written.
        """
        ...

    def discard(self) -> None:
        """End all tasks that are being computed, without news of them."""
        ...

    def close(self) -> None:
        """End."""
        ...
