"""The Dask scheduler that a campaign computes with: somebody else's, or one of this machine for the campaign alone."""

from __future__ import annotations

import logging
import re
import threading
import warnings
from concurrent.futures import Future
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from relnav_sim.results.block import RefusedError
from relnav_sim.runner.executors.interface import WorkersError
from relnav_sim.runner.worker import started_apart

if TYPE_CHECKING:
    from distributed import Client

EXTRA = "dask"
LONGEST_CONNECTION_S = 10.0
LONGEST_CLOSING_S = 5.0
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://([^\s/:]+|\[[^\s/]+\]):\d{1,5}")


def check_installed() -> None:
    """Refuse to go on without Dask's scheduler.

    Raises:
        RefusedError: It can't be imported.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise RefusedError(
            f"the backend dask needs the package distributed ({error}); install it with: "
            f"pip install 'relnav-sim[{EXTRA}]'"
        ) from None


class Connection:
    """A client of a scheduler, and the cluster where that is our own.

    Args:
        scheduler: Address; None: start a cluster on this machine.
        workers: Worker processes of that cluster, of one thread each.

    Raises:
        RefusedError: The address is none.
        WorkersError: Nobody answers there, or no cluster can be started.
    """

    def __init__(self, scheduler: str | None, workers: int) -> None:
        if scheduler is not None and not _is_address(scheduler):
            raise RefusedError(f"a Dask scheduler's address is like tcp://host:8786, not {scheduler!r}")
        self._cluster: Any = None
        self.address = scheduler or "a cluster of this machine"
        # What Dask has to say of workers that come and go, this command says itself.
        for name in ("distributed", *logging.root.manager.loggerDict):
            if name.startswith("distributed"):
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        if scheduler is None:
            self._cluster = _local_cluster(workers)
        self.client = self._connected(scheduler or self._cluster.scheduler_address)

    def _connected(self, address: str) -> Client:
        from distributed import Client

        client, connected = Client.__new__(Client), Future[None]()

        def connect() -> None:
            try:
                Client.__init__(client, address, timeout=LONGEST_CONNECTION_S, set_as_default=False, name="relnav")
                connected.set_result(None)
            except BaseException as error:
                connected.set_exception(error)

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of versions, which are looked at where they matter
                # For a server of another kind, which accepts the connection and says nothing, Dask waits for ever.
                threading.Thread(target=connect, name="relnav-connect", daemon=True).start()
                connected.result(LONGEST_CONNECTION_S + 1)
            return client
        except (OSError, TimeoutError) as error:
            client.status = "closed"  # or it tries for long to say good-bye, and tells on standard error that it can't
            self.close()
            why = f"{type(error).__name__}: {error}".rstrip(": ")
            raise WorkersError(f"no Dask scheduler answers at {address}; is it running there? ({why})") from None

    @property
    def is_own(self) -> bool:
        """Whether the cluster ends with the campaign."""
        return self._cluster is not None

    @property
    def is_up(self) -> bool:
        """Whether the scheduler is there."""
        return bool(self.client.status == "running")

    def close(self) -> None:
        """Leave the scheduler; end the cluster if it is our own."""
        if hasattr(self, "client"):
            with suppress(Exception):  # nobody may be there any more to say good-bye to
                self.client.close(LONGEST_CLOSING_S if self.is_up else 0.5)
        if self._cluster is not None:
            with suppress(Exception):
                self._cluster.close(LONGEST_CLOSING_S)
            self._cluster = None


def _is_address(text: str) -> bool:
    return _ADDRESS.fullmatch(text) is not None and int(text.rpartition(":")[2]) < 2**16


def _local_cluster(workers: int) -> Any:
    """Return a cluster of this machine whose processes a terminal does not end, and that ends with this process."""
    import dask
    from distributed import LocalCluster

    settings = {
        "distributed.scheduler.allowed-failures": 0,  # whom to blame is decided here
        "distributed.logging.distributed": "critical",
        "distributed.worker.memory.terminate": False,  # blocks are computed in processes of their own
    }
    try:
        with started_apart(), dask.config.set(settings):
            return LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",  # any free port; nobody need look at it
                worker_dashboard_address="127.0.0.1:0",
                memory_limit=0,
                silence_logs=logging.CRITICAL,
            )
    except (OSError, RuntimeError, TimeoutError, MemoryError) as error:
        raise WorkersError(f"no Dask cluster can be started on this machine: {type(error).__name__}: {error}") from None
