"""The options that say where the work is done, the same for every command that computes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import UserError

if TYPE_CHECKING:
    from relnav_sim.runner.executors.interface import Backend


class BackendName(StrEnum):
    """Where the work is done."""

    LOKY = "loky"
    SEQUENTIAL = "sequential"
    DASK = "dask"


BackendOption = Annotated[
    BackendName,
    typer.Option(
        "--backend",
        case_sensitive=False,
        help="loky: in worker processes; sequential: in this process, for debugging; dask: on a cluster.",
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, help="Processes on this machine; the results do not depend on it.", show_default="2"
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="With --backend dask: the scheduler whose workers compute, as tcp://host:8786.",
    ),
]
LocalClusterOption = Annotated[
    int | None,
    typer.Option(
        "--local-cluster", metavar="N", min=1, help="With --backend dask: a cluster of N workers on this machine."
    ),
]


@dataclass(frozen=True)
class Where:
    """Where the work is done.

    Attributes:
        backend: The backend.
        workers: Processes on this machine.
        scheduler: Address of a Dask scheduler.
    """

    backend: Backend
    workers: int
    scheduler: str | None


def where(backend: BackendName, workers: int | None, scheduler: str | None, local_cluster: int | None) -> Where:
    """Return what the options mean together.

    Raises:
        UserError: They don't fit together.
    """
    if backend is not BackendName.DASK and (scheduler is not None or local_cluster is not None):
        option = "--scheduler" if scheduler is not None else "--local-cluster"
        raise UserError(f"{option} goes with --backend dask")
    if scheduler is not None and (local_cluster is not None or workers is not None):
        option = "--local-cluster" if local_cluster is not None else "--workers"
        raise UserError(f"--scheduler computes with the workers that are there; leave out {option}")
    if local_cluster is not None and workers is not None:
        raise UserError("--local-cluster N says how many workers there are; leave out --workers")
    return Where(backend.value, local_cluster or workers or 2, scheduler)
