"""The executor that is asked for."""

from __future__ import annotations

from relnav_sim.runner.executors.interface import Backend, Executor, Say
from relnav_sim.runner.executors.loky import Loky
from relnav_sim.runner.executors.sequential import Sequential


def executor_of(backend: Backend, workers: int, timeout_s: float | None, scheduler: str | None, say: Say) -> Executor:
    """Return an executor; nothing is started before the first task.

    Args:
        backend: Where tasks are computed.
        workers: Processes on this machine.
        timeout_s: Most seconds for a task; None: no limit.
        scheduler: Address of a Dask scheduler; None: with ``dask`` a cluster of this machine.
        say: Told what a user should know, a sentence at a time.

    Raises:
        ValueError: A limit of time for tasks in this process, which nothing could end; a scheduler for another backend.
        RefusedError: A backend whose package is not installed.
    """
    if scheduler is not None and backend != "dask":
        raise ValueError(f"a scheduler is for the backend dask, not {backend}")
    if backend == "sequential":
        if timeout_s is not None:
            raise ValueError("timeout_s needs worker processes: what hangs in this process can't be ended from outside")
        return Sequential()
    if backend == "loky":
        return Loky(workers, timeout_s)
    from relnav_sim.runner.executors.dask_cluster import DaskCluster

    return DaskCluster(workers, timeout_s, scheduler, say)
