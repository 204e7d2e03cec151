"""A task in a worker process, which keeps what it has learned from one task to the next."""

from __future__ import annotations

from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.compute import Outcome, compute
from relnav_sim.simulation.learned import Learned

_LEARNED = Learned()
"""The worker's own: nothing but its modules lasts in an executor's process from call to call."""


def work(task: Task) -> Outcome:
    """Compute a task and write its file, see `compute`."""
    return compute(task, _LEARNED)
