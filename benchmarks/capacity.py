"""What a million runs would take on a thousand cores: costs measured on this machine, the rest simulated.

The blocks of `campaigns/alpha_kf_gaussian.yaml` (12 km apart, 6000 s at 5 Hz, 15 filters) are computed once each, and
their CPU time and the size of their shards taken. Then relnav's own pool hands tasks of these lengths to a stub of an
executor with a thousand places, whose clock is a simulated one: it goes on by the CPU time that the command itself
needs, by what it needs to take and verify a shard, and to the end of the next task where nothing is left to do.

    python benchmarks/capacity.py [--quick]
"""

from __future__ import annotations

import heapq
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"

from relnav_sim.campaign import Campaign, load_campaign
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.compute import Outcome, compute
from relnav_sim.runner.event_log import NAME
from relnav_sim.runner.executors.interface import LOOKED_AT_EVERY_S, Ended
from relnav_sim.runner.executors.on_worker import Came
from relnav_sim.runner.executors.received import receive
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
SPREAD = 0.2
"""Tasks take so much more or less than measured, at random, so that places do not stay in step."""


@dataclass(frozen=True)
class Measured:
    """A kind of block: its filters, CPU time s, size of its shard, and CPU time to take and verify that, s."""

    filters: tuple[str, ...]
    runs: int
    block_s: float
    shard_bytes: int
    receive_s: float


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
        before = time.process_time()
        for _ in range(5):
            receive(short, Came(Outcome(0, {}), shard=shard))
        receive_s = (time.process_time() - before) / 5
        found.append(Measured(tuple(block.case.config.filters), len(block.runs), block_s, len(shard), receive_s))
    return found


def dask_task_s() -> float:
    """Return the CPU time of scheduler, client and worker together for a task that does nothing, s."""
    from distributed import Client, LocalCluster

    count = 100 if QUICK else 1000
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.submit(abs, -1).result()
        before = time.process_time()
        for future in [client.submit(abs, -number, pure=False) for number in range(count)]:
            future.result()
        return (time.process_time() - before) / count


class Stub:
    """An executor of many places in simulated time; a task takes what its like have been measured to take.

    Args:
        places: How many.
        costs: By filters: time of a task, and what the command needs to take its shard, s.
    """

    def __init__(self, places: int, costs: dict[tuple[str, ...], tuple[float, float]]) -> None:
        self._free, self._costs = places, costs
        self._running: list[tuple[float, int, Task]] = []
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
        seconds = self._costs[tuple(task.case.config.filters)][0] * self._random.uniform(1 - SPREAD, 1 + SPREAD)
        self.worked_s += seconds
        heapq.heappush(self._running, (self.now + seconds, self._number, task))

    def as_completed(self) -> list[Ended]:
        """Go on to the end of the next task; return those that have ended."""
        self._tick()
        self.now = max(self.now, self._running[0][0])
        ended = []
        began = self.now
        while self._running and self._running[0][0] <= self.now < began + LOOKED_AT_EVERY_S:
            _, _, task = heapq.heappop(self._running)
            seconds, taking = self._costs[tuple(task.case.config.filters)]
            self.now += taking
            self.busy_s += taking
            self._free += 1
            self.ends.append(self.now)
            ended.append(Ended(task, Outcome(0, {}, seconds=seconds)))
        self._cpu = time.process_time()
        return ended

    def discard(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def simulated(places: int, tasks: Sequence[Block], costs: dict[tuple[str, ...], tuple[float, float]]) -> Stub:
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
        task_s = dask_task_s()
        rounds = RUNS / whole.block_runs
        print("filters of a block | runs | CPU s | shard kB | take and verify, ms")
        for kind in kinds:
            print(
                f"{', '.join(kind.filters)} | {kind.runs} | {kind.block_s:.1f} | {kind.shard_bytes / 1e3:.0f} | "
                f"{1e3 * kind.receive_s:.1f}"
            )
        cpu_s, size = (rounds * sum(getattr(kind, name) for kind in kinds) for name in ("block_s", "shard_bytes"))
        blocks = rounds * len(kinds)
        print(f"dask: {1e3 * task_s:.2f} ms CPU for a task that does nothing (scheduler, client and worker together)")
        print(f"{RUNS} runs: {cpu_s / 3600:.0f} core hours, {blocks:.0f} blocks, {size / 1e9:.1f} GB of shards")
        costs = {kind.filters: (kind.block_s, kind.receive_s + task_s) for kind in kinds}
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
