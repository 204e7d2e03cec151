"""What a million runs would take on a thousand cores: costs measured on this machine, the rest simulated.

The blocks of `campaigns/alpha_kf_gaussian.yaml` (12 km apart, 6000 s at 5 Hz, 15 filters) are computed once each, and
their CPU time and the size of their shards taken. Then relnav's own pool hands tasks of these lengths to a stub of an
executor with a thousand places, whose clock is a simulated one: it goes on by the CPU time that the command itself
needs, by what of taking a shard leaves other threads no turn, and to the next end of a task or of taking its result.

    python benchmarks/capacity.py [--quick]
"""

from __future__ import annotations

import hashlib
import heapq
import os
import random
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"

from relnav_sim.campaign import Campaign, load_campaign
from relnav_sim.results.atomic import written_whole
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.compute import Outcome, compute
from relnav_sim.runner.event_log import NAME
from relnav_sim.runner.executors.interface import Ended
from relnav_sim.runner.executors.on_worker import Came
from relnav_sim.runner.executors.received import MOST_TAKEN, receive
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import Block, blocks_left
from relnav_sim.simulation.learned import Learned

ROOT = Path(__file__).parents[1]
QUICK = "--quick" in sys.argv
RUNS, WORKERS = 1_000_000, (100, 300, 1000) if not QUICK else (10,)
SHORTER = 25 if not QUICK else 50
"""The blocks are computed over this share of their time, with as many stored epochs, and their CPU time multiplied."""
TASKS_EACH = 6 if not QUICK else 4
"""Simulated tasks of each place."""
SENT, REPEATED = (100, 20) if not QUICK else (5, 2)
"""How often sending and taking a shard are repeated."""
SPREAD = 0.2
"""Tasks take so much more or less than measured, at random, so that places do not stay in step."""


@dataclass(frozen=True)
class Measured:
    """A kind of block.

    Attributes:
        filters: Its filters.
        runs: Its runs.
        block_s: CPU time, s.
        shard_bytes: Size of its shard.
        receive_s: CPU time to write and verify that, s.
        shared_s: How much of this leaves other threads a turn, s: hashing, writing.
    """

    filters: tuple[str, ...]
    runs: int
    block_s: float
    shard_bytes: int
    receive_s: float
    shared_s: float


def measured(whole: Campaign, folder: Path) -> list[Measured]:
    """Compute the blocks of the first runs once, shortened; return their costs."""
    (case,) = whole.cases
    clock = case.config.clock
    factor = {"duration_s": clock.duration_s / SHORTER, "store_every_s": clock.store_every_s / SHORTER}
    settling = case.config.statistics.model_copy(update={"settle_s": factor["duration_s"] / 2})
    update = {"clock": clock.model_copy(update=factor), "statistics": settling}
    found = []
    for block in blocks_left(replace(whole, runs=whole.block_runs), {}, folder):
        short = replace(block, case=replace(block.case, config=block.case.config.model_copy(update=update)))
        once = replace(short, runs=short.runs[:1])
        compute(once, Learned())  # loads the kernels
        before = time.process_time()
        compute(short, Learned())
        block_s = (time.process_time() - before) * SHORTER
        shard = short.path.read_bytes()
        receive_s = _cpu_of(partial(receive, short, Came(Outcome(0, {}), shard=shard)))
        shared_s = _cpu_of(partial(_hash_and_write, shard, short.path))
        names = tuple(block.case.config.filters)
        found.append(Measured(names, len(block.runs), block_s, len(shard), receive_s, shared_s))
    return found


def _cpu_of(function: Callable[[], object]) -> float:
    function()
    before = time.process_time()
    for _ in range(REPEATED):
        function()
    return (time.process_time() - before) / REPEATED


def _hash_and_write(shard: bytes, path: Path) -> None:
    hashlib.sha256(shard)
    with written_whole(path) as temporary:
        temporary.write_bytes(shard)


@dataclass(frozen=True)
class Sent:
    """CPU time of sending a result of a block here: of this process, s, and of the scheduler, s."""

    here_s: float
    scheduler_s: float


def sent(size: int) -> Sent:
    """Return what a task costs that does nothing but return so many bytes; scheduler and worker are other processes."""
    from distributed import Client

    dask = [sys.executable, "-m", "distributed.cli."]
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = subprocess.Popen([*dask[:2], f"{dask[2]}dask_scheduler", "--no-dashboard", "--host", address], **quiet)
    worker = subprocess.Popen([*dask[:2], f"{dask[2]}dask_worker", "--no-nanny", "--no-dashboard", address], **quiet)
    try:
        with Client(address, timeout=60) as client:
            client.submit(random.randbytes, size).result()
            before = time.process_time(), _cpu_s(scheduler.pid)
            for _ in range(SENT):
                client.submit(random.randbytes, size, pure=False).result()
            here_s, scheduler_s = time.process_time() - before[0], _cpu_s(scheduler.pid) - before[1]
    finally:
        for process in (worker, scheduler):
            process.kill()
            process.wait()
    return Sent(here_s / SENT, scheduler_s / SENT)


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Cost:
    """What a block costs: its own time, s; that of a thread that takes its result, s; and of the interpreter, s."""

    block_s: float
    taking_s: float
    held_s: float


class Stub:
    """An executor of many places in simulated time; a task takes what its like have been measured to take.

    Args:
        places: How many.
        costs: By filters.
    """

    def __init__(self, places: int, costs: dict[tuple[str, ...], Cost]) -> None:
        self._free, self._costs = places, costs
        self._running: list[tuple[float, int, Task, float]] = []
        self._taken: list[tuple[float, int, Task, float]] = []
        self._takers = [0.0] * MOST_TAKEN
        self._number = 0
        self._random = random.Random(1)
        self.ends: list[float] = []
        self._cpu = time.process_time()
        self.now = self.busy_s = self.worked_s = 0.0

    def _tick(self) -> None:
        spent, self._cpu = time.process_time() - self._cpu, time.process_time()
        self.now += spent
        self.busy_s += spent

    @property
    def rate(self) -> float:
        """Tasks a second while all places have something to do: neither the start nor the end counts."""
        first, last = len(self.ends) // 4, len(self.ends) * 3 // 4
        return (last - first) / (self.ends[last] - self.ends[first])

    def make_ready(self, tasks: Sequence[Task], say: object) -> None:
        """Do nothing."""

    def begin(self, tasks: Sequence[Task]) -> None:
        """Start the clock."""
        self._cpu = time.process_time()

    def free(self) -> Counter[str]:
        """Return the places, eight on each host."""
        hosts, rest = divmod(self._free, 8)
        return Counter({f"host {number}": 8 for number in range(hosts)} | ({"host": rest} if rest else {}))

    def submit(self, task: Task, host: str) -> None:
        """Begin a task."""
        self._tick()
        self._free -= 1
        self._number += 1
        seconds = self._cost(task).block_s * self._random.uniform(1 - SPREAD, 1 + SPREAD)
        self.worked_s += seconds
        heapq.heappush(self._running, (self.now + seconds, self._number, task, seconds))

    def _cost(self, task: Task) -> Cost:
        return self._costs[tuple(task.case.config.filters)]

    def as_completed(self) -> list[Ended]:
        """Go on until a result has been taken; return those that have been."""
        self._tick()
        ended: list[Ended] = []
        while not ended:
            self.now = max(self.now, min(one[0][0] for one in (self._running, self._taken) if one))
            while self._running and self._running[0][0] <= self.now:
                end, number, task, seconds = heapq.heappop(self._running)
                self._free += 1
                taken = max(end, heapq.heappop(self._takers)) + self._cost(task).taking_s
                heapq.heappush(self._takers, taken)
                heapq.heappush(self._taken, (taken, number, task, seconds))
            while self._taken and self._taken[0][0] <= self.now:
                _, _, task, seconds = heapq.heappop(self._taken)
                held_s = self._cost(task).held_s
                self.now += held_s
                self.busy_s += held_s
                self.ends.append(self.now)
                ended.append(Ended(task, Outcome(0, {}, seconds=seconds)))
        self._cpu = time.process_time()
        return ended

    def discard(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def simulated(places: int, tasks: Sequence[Block], costs: dict[tuple[str, ...], Cost]) -> Stub:
    """Have relnav's own pool compute tasks on a stub; return it."""
    stub = Stub(places, costs)
    watch = Watch()
    watch.expect(tasks)
    with tempfile.TemporaryDirectory() as folder, watch.logging(Path(folder), [Path(folder) / NAME]):
        pool = Pool(1, "sequential", observer=watch)
        pool._executor = stub
        for done in pool.computed(tasks):
            assert not done.failures
    return stub


def main() -> None:
    """Measure, simulate and print."""
    whole = load_campaign(ROOT / "campaigns" / "alpha_kf_gaussian.yaml", [f"runs={RUNS}"])
    with tempfile.TemporaryDirectory() as place:
        kinds = measured(whole, Path(place))
        rounds = RUNS / whole.block_runs
        print("filters of a block | runs | CPU s | shard kB | take and verify, ms | of it shared, ms")
        for kind in kinds:
            print(
                f"{', '.join(kind.filters)} | {kind.runs} | {kind.block_s:.1f} | {kind.shard_bytes / 1e3:.0f} | "
                f"{1e3 * kind.receive_s:.1f} | {1e3 * kind.shared_s:.1f}"
            )
        cpu_s, size = (rounds * sum(getattr(kind, name) for kind in kinds) for name in ("block_s", "shard_bytes"))
        blocks = rounds * len(kinds)
        travels, news = sent(round(size / blocks)), sent(300)
        for name, one in (("a shard that travels", travels), ("news alone", news)):
            print(f"{name}: {1e3 * one.here_s:.1f} ms CPU of the command, {1e3 * one.scheduler_s:.1f} of the scheduler")
        print(f"{RUNS} runs: {cpu_s / 3600:.0f} core hours, {blocks:.0f} blocks, {size / 1e9:.1f} GB of shards")
        costs = {
            kind.filters: Cost(kind.block_s, kind.receive_s, kind.receive_s - kind.shared_s + travels.here_s)
            for kind in kinds
        }
        print("places | simulated blocks | command, ms a block | blocks/s | places at work | hours in all | MB/s")
        for places in WORKERS:
            count = -(-places * TASKS_EACH // len(kinds))
            part = replace(whole, runs=count * whole.block_runs)
            tasks = [replace(block, folder=Path(place)) for block in blocks_left(part, {}, Path(place))]
            stub = simulated(places, tasks, costs)
            at_work = stub.rate * stub.worked_s / len(tasks) / places
            print(
                f"{places} | {len(tasks)} | {1e3 * stub.busy_s / len(tasks):.1f} | {stub.rate:.2f} | "
                f"{100 * at_work:.0f} % | {blocks / stub.rate / 3600:.2f} | {size / blocks * stub.rate / 1e6:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
