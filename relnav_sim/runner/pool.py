"""Blocks over worker processes: joblib for the work, and isolation for a block that kills its worker."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Literal

from relnav_sim.results.shards import write_shard
from relnav_sim.runner.survive import BlockTimeout, failed_block, simulate_surviving, time_limit
from relnav_sim.runner.work import Block

Backend = Literal["loky", "sequential"]

KILLED = "the worker process was killed, most likely out of memory"


@dataclass(frozen=True)
class Done:
    """A block whose shard is written.

    Attributes:
        block: The block.
        failures: Failed runs of filters in it.
    """

    block: Block
    failures: int


def computed(blocks: Sequence[Block], workers: int, backend: Backend, timeout_s: float | None) -> Iterator[Done]:
    """Compute blocks in any order; yield each as soon as its shard is written.

    A worker that the operating system kills takes down all workers. Blocks that were being computed then are
    suspects: each is computed alone, and halved until the run that kills stands alone; that run is recorded as failed.

    Args:
        blocks: What to compute.
        workers: Processes.
        backend: ``loky`` or ``sequential``, in this process.
        timeout_s: Most seconds for a block; its runs then count as failed.
    """
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    waiting = {block.path: block for block in blocks}
    for block in blocks:
        block.busy.unlink(missing_ok=True)
    options = {"inner_max_num_threads": 1} if backend == "loky" else {}
    while waiting:
        try:
            with parallel_config(backend=backend, n_jobs=workers, **options):
                calls = (delayed(compute)(block, timeout_s) for block in list(waiting.values()))
                results = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")(calls)
                for done in results:
                    del waiting[done.block.path]
                    yield done
        except TerminatedWorkerError:
            for suspect in [block for block in waiting.values() if block.busy.exists()]:
                del waiting[suspect.path]
                yield from _computed_alone(suspect, timeout_s)


def compute(block: Block, timeout_s: float | None) -> Done:
    """Compute one block and write its shard."""
    from threadpoolctl import threadpool_limits

    block.busy.touch()
    try:
        # Threads of BLAS would fight with the other workers; the matrices here are small.
        with threadpool_limits(1), time_limit(timeout_s):
            result = simulate_surviving(block.case, block.seed, block.runs, block.case_index)
    except BlockTimeout:
        reason = f"the block took longer than {timeout_s:g} s"
        result = failed_block(block.case, block.seed, block.runs, reason, block.case_index)
    write_shard(block.path, result, block.seed, block.filter_ids)
    block.busy.unlink(missing_ok=True)
    return Done(block, len(result.failures))


def _computed_alone(block: Block, timeout_s: float | None) -> Iterator[Done]:
    """Compute a suspect in a process of its own; if that is killed as well, its halves."""
    try:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
            yield executor.submit(compute, block, timeout_s).result()
    except BrokenProcessPool:
        block.busy.unlink(missing_ok=True)
        if len(block.runs) > 1:
            for half in block.halves():
                yield from _computed_alone(half, timeout_s)
            return
        result = failed_block(block.case, block.seed, block.runs, KILLED, block.case_index)
        write_shard(block.path, result, block.seed, block.filter_ids)
        yield Done(block, len(result.failures))
