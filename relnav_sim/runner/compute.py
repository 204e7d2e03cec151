"""One task, a block of runs or a bound, computed and written to its file; in a worker process or in this one."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from relnav_sim.crlb.case_bound import bound_surviving
from relnav_sim.results.bound import write_bound
from relnav_sim.results.failure_kinds import kind_of
from relnav_sim.results.shards import write_shard
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.failure_log import log_failure
from relnav_sim.runner.fault_isolation import simulate_surviving
from relnav_sim.runner.headline import Figures, headline_figures
from relnav_sim.runner.peak_memory import peak_memory
from relnav_sim.runner.work import Block
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory, memory_in_words


@dataclass(frozen=True)
class Outcome:
    """What became of a task whose file is written; small, so that a worker hands it over in one go.

    Attributes:
        failures: Failed runs of filters in it.
        figures: The headline figures of its runs.
        kinds: How many of the failures there are of each kind.
        seconds: What it took, s.
        memory_bytes: Most memory that the process has had by then, this task or one before.
    """

    failures: int
    figures: Figures
    kinds: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    memory_bytes: int = 0


def compute(task: Task, learned: Learned) -> Outcome:
    """Compute a task and write its file.

    Args:
        task: The task.
        learned: What this process has learned; it grows.

    Raises:
        MemoryError: There is too little memory for it; the message says what there was none for.
        OSError: The file can't be written.
    """
    from threadpoolctl import get_cached_controller

    task.busy.touch()
    began = time.monotonic()
    try:
        # Threads of BLAS would fight with the other workers; the matrices here are small.
        with get_cached_controller().limit(limits=1):
            outcome = _bound(task, learned) if isinstance(task, BoundTask) else _simulated(task, learned)
        return replace(outcome, seconds=time.monotonic() - began, memory_bytes=peak_memory())
    except Exception as error:
        if lacks_memory(error):
            raise MemoryError(memory_in_words(error)) from None
        raise
    finally:
        task.busy.unlink(missing_ok=True)


def _bound(task: BoundTask, learned: Learned) -> Outcome:
    write_bound(task.path, bound_surviving(task.case, task.seed, learned))
    return Outcome(0, {})


def _simulated(block: Block, learned: Learned) -> Outcome:
    result = simulate_surviving(
        block.case, block.seed, block.runs, block.case_index, partial(log_failure, block.folder), learned
    )
    write_shard(block.path, result, block.seed, block.filter_ids)
    kinds = Counter(kind_of(failure.reason) for failure in result.failures)
    return Outcome(len(result.failures), headline_figures(result), kinds)
