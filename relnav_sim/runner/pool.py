"""Blocks over worker processes: joblib for the work, and isolation for a block that kills its worker."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from relnav_sim.results.bound import write_bound
from relnav_sim.results.shards import write_shard
from relnav_sim.runner.bound import bound_surviving, failed_bound
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.failure_log import log_failure
from relnav_sim.runner.headline import Figures, headline_figures
from relnav_sim.runner.survive import failed_block, simulate_surviving
from relnav_sim.runner.work import Block
from relnav_sim.runner.worker_process import packed, prepare_worker, unpacked

Backend = Literal["loky", "sequential"]

KILLED = "the worker process died: killed by the system, most likely out of memory, or a crash in compiled code"
PARENT_CHECKED_EVERY_S = 0.25


@dataclass(frozen=True)
class Done:
    """A block or a bound whose file is written.

    Attributes:
        block: What was computed.
        failures: Failed runs of filters in it.
        figures: The headline figure of its runs.
    """

    block: Task
    failures: int
    figures: Figures


def computed(
    blocks: Sequence[Task], workers: int, backend: Backend, timeout_s: float | None
) -> Generator[Done, None, None]:
    """Compute blocks in any order; yield each as soon as its shard is written.

    A worker that the operating system kills takes down all workers. Blocks that were being computed then are
    suspects: each is computed alone, and cut until the run that kills stands alone; that run is recorded as failed.

    Args:
        blocks: What to compute; no other process is at work on them and no marker of theirs stands.
        workers: Processes.
        backend: ``loky`` or ``sequential``, in this process.
        timeout_s: Most seconds for a block; one that takes longer is cut until the runs that do stand alone.
    """
    if backend == "sequential":
        for block in blocks:
            yield compute(block, timeout_s)
    elif workers == 1:
        # With one worker joblib computes in this process, which a bad run would then take with it.
        yield from _one_by_one(blocks, timeout_s)
    else:
        yield from _in_parallel(blocks, workers, timeout_s)


def compute(block: Task, timeout_s: float | None) -> Done:
    """Compute one block or bound and write its file."""
    from threadpoolctl import threadpool_limits

    block.busy.touch()
    # Threads of BLAS would fight with the other workers; the matrices here are small.
    with threadpool_limits(1):
        done = _bound(block, timeout_s) if isinstance(block, BoundTask) else _simulated(block, timeout_s)
    block.busy.unlink(missing_ok=True)
    return done


def _bound(task: BoundTask, timeout_s: float | None) -> Done:
    write_bound(task.path, bound_surviving(task.case, task.seed, timeout_s))
    return Done(task, 0, {})


def _simulated(block: Block, timeout_s: float | None) -> Done:
    log = partial(log_failure, block.folder)
    result = simulate_surviving(block.case, block.seed, block.runs, block.case_index, timeout_s, log)
    write_shard(block.path, result, block.seed, block.filter_ids)
    return Done(block, len(result.failures), headline_figures(result))


def _in_parallel(blocks: Sequence[Task], workers: int, timeout_s: float | None) -> Iterator[Done]:
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    waiting = {block.path: block for block in blocks}
    while waiting:
        try:
            with parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
                parallel = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
                calls = (
                    delayed(_compute_as_worker)(packed(block), timeout_s, os.getpid())
                    for block in list(waiting.values())
                )
                with _no_interrupt_for_children():
                    results = parallel(calls)
                with closing(results):
                    for done in results:
                        del waiting[done.block.path]
                        yield done
        except TerminatedWorkerError:
            suspects = [block for block in waiting.values() if block.busy.exists()]
            for suspect in suspects:
                del waiting[suspect.path]
            yield from _one_by_one(suspects, timeout_s, suspects={suspect.path for suspect in suspects})


def _one_by_one(
    blocks: Sequence[Task], timeout_s: float | None, suspects: Collection[Path] = frozenset()
) -> Iterator[Done]:
    """Compute blocks in one worker process, so that it is known which of them kills it; cut that one.

    What can't be cut is blamed the second time only: the first time it may have been somebody who killed the worker.

    Args:
        blocks: What to compute.
        timeout_s: As in `computed`.
        suspects: Files of the blocks that were being computed when a worker died.
    """
    from joblib.externals.loky import ProcessPoolExecutor
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    waiting = list(reversed(blocks))
    suspects = set(suspects)
    while waiting:
        executor = ProcessPoolExecutor(max_workers=1, env={"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"})
        try:
            while waiting:
                with _no_interrupt_for_children():
                    future = executor.submit(_compute_as_worker, packed(waiting[-1]), timeout_s, os.getpid())
                done = future.result()
                waiting.pop()
                yield done
        except TerminatedWorkerError:
            block = waiting.pop()
            block.busy.unlink(missing_ok=True)
            if pieces := block.pieces():
                waiting += reversed(pieces)
                suspects.update(piece.path for piece in pieces)
            elif block.path not in suspects:
                suspects.add(block.path)
                waiting.append(block)
            else:
                yield _blamed(block)
        finally:
            executor.shutdown(kill_workers=True)


def _blamed(block: Task) -> Done:
    if isinstance(block, BoundTask):
        write_bound(block.path, failed_bound(block.case, block.seed, KILLED, retry=True))
        return Done(block, 0, {})
    result = failed_block(block.case, block.seed, block.runs, KILLED, block.case_index, _only_filter(block))
    write_shard(block.path, result, block.seed, block.filter_ids)
    return Done(block, len(result.failures), {})


def _only_filter(block: Block) -> str:
    """Return the block's filter, which is then to blame; empty where the truth of the run itself may be.

    A block of one run and one filter of several was cut out of one that killed; the other filters have run through.
    """
    names = tuple(block.case.config.filters)
    return names[0] if len(names) == 1 else ""


def _compute_as_worker(task: bytes, timeout_s: float | None, parent: int) -> Done:
    """Compute a block in a worker process, which ends by itself if the campaign's process is killed."""
    if os.getppid() != parent:
        os._exit(1)
    if not any(thread.name == _WATCH for thread in threading.enumerate()):
        threading.Thread(target=_end_with_parent, args=(parent,), name=_WATCH, daemon=True).start()
        prepare_worker()
    return compute(unpacked(task), timeout_s)


_WATCH = "relnav-parent-watch"


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECKED_EVERY_S)
    os._exit(1)


@contextmanager
def _no_interrupt_for_children() -> Iterator[None]:
    """Start processes that a Ctrl-C at the terminal or its end does not reach: the parent ends them."""
    from multiprocessing.resource_tracker import ensure_running

    from joblib.externals.loky.backend import resource_tracker

    # Workers inherit the mask. The trackers start with the first worker and would unblock SIGINT for it, so they come
    # before; SIGHUP they leave alone, and it would kill them.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        ensure_running()
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
