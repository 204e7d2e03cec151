"""Tasks in this process, one after the other, for debugging and where processes are not to be had."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Sequence

from relnav_sim.kernels import CompilerError
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.compute import compute
from relnav_sim.runner.executors.interface import Ended, Fault, Say, WorkersError
from relnav_sim.runner.rehearsal import compile_kernels
from relnav_sim.simulation.learned import Learned

HERE = "here"


class Sequential:
    """One place: this process."""

    def __init__(self) -> None:
        self._task: Task | None = None
        self._learned = Learned()

    def make_ready(self, tasks: Sequence[Task], say: Say) -> None:
        """Have the kernels compiled."""
        compile_kernels(tasks, say)

    def begin(self, tasks: Sequence[Task]) -> None:
        """Load the compiler; in a block its absence would be the failure of every run."""
        self._learned = Learned()
        try:
            importlib.import_module("relnav_sim.kernels.compiler")
        except CompilerError as error:
            raise WorkersError(str(error)) from error

    def free(self) -> Counter[str]:
        """Return the one place."""
        return Counter({HERE: 1 if self._task is None else 0})

    def submit(self, task: Task, host: str) -> None:
        """Take a task."""
        self._task = task

    def as_completed(self) -> list[Ended]:
        """Compute the task."""
        task, self._task = self._task, None
        if task is None:
            return []
        try:
            return [Ended(task, compute(task, self._learned))]
        except MemoryError as error:
            return [Ended(task, None, Fault.NO_MEMORY, str(error))]

    def discard(self) -> None:
        """Forget the task."""
        self._task = None

    def close(self) -> None:
        """Do nothing."""
