"""Which task comes next, and which is to blame: one that goes wrong is cut until what goes wrong stands alone."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path

from relnav_sim.runner.bound_task import Task

TIMES_LOST = 3
"""Workers that may be lost with a task that can't be cut."""


class TaskQueue:
    """Tasks in order, and those under suspicion, which are computed while nothing else is.

    Each method that is told what went wrong returns whether the task itself is to blame; if not, the task or its
    pieces come up again.

    Args:
        tasks: What is to be computed.
    """

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._waiting = deque(tasks)
        self._suspects: deque[Task] = deque()
        self._died_before: set[Path] = set()
        self._times_lost: dict[Path, int] = {}
        self._times_sent_back: dict[Path, int] = {}

    def __len__(self) -> int:
        return len(self._waiting) + len(self._suspects)

    @property
    def suspects(self) -> int:
        """How many tasks are to be computed alone, first of all."""
        return len(self._suspects)

    def take(self) -> Task:
        """Return the next task."""
        return (self._suspects or self._waiting).popleft()

    def take_unsuspected(self) -> Task:
        """Return the next task that need not be alone."""
        return self._waiting.popleft()

    def sent_back(self, task: Task) -> bool:
        """A worker that ended in order has not finished a task; where several have not, the task may be too long."""
        times = self._times_sent_back[task.path] = self._times_sent_back.get(task.path, 0) + 1
        if times > TIMES_LOST:
            return self.lost(task)
        is_suspect = task.path in self._died_before or task.path in self._times_lost
        (self._suspects if is_suspect else self._waiting).appendleft(task)
        return False

    def killed(self, task: Task, alone: bool) -> bool:
        """The process of a task died: by its fault, for want of memory that others had, or by somebody's hand.

        What can't be cut is blamed the second time only, and only if it was alone then.
        """
        pieces = task.pieces()
        if alone and pieces:
            self._suspects.extendleft(reversed(pieces))
            self._died_before.update(piece.path for piece in pieces)
            return False
        if alone and task.path in self._died_before:
            return True
        self._died_before.add(task.path)
        self._suspects.appendleft(task)
        return False

    def lost(self, task: Task) -> bool:
        """The worker of a task is gone, most often by no fault of the task.

        It is cut the second time only, and what can't be cut is given up the third time.
        """
        times = self._times_lost[task.path] = self._times_lost.get(task.path, 0) + 1
        pieces = task.pieces()
        if times == 1 or (not pieces and times < TIMES_LOST):
            self._suspects.appendleft(task)
            return False
        self._suspects.extendleft(reversed(pieces))
        self._times_lost.update({piece.path: 1 for piece in pieces})
        return not pieces

    def too_long(self, task: Task) -> bool:
        """A task took longer than it may."""
        pieces = task.pieces()
        self._waiting.extendleft(reversed(pieces))
        return not pieces

    def lacked_memory(self, task: Task, alone: bool) -> bool:
        """There was too little memory for a task; others may have had it unless it was alone."""
        pieces = task.pieces()
        self._waiting.extendleft(reversed(pieces))
        if not pieces and not alone:
            self._suspects.append(task)
            return False
        return not pieces
