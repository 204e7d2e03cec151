"""The kernels that a campaign needs, compiled before its workers start: its first epochs, run in another process.

Nothing comes of that process but compiled code. Whatever goes wrong in it goes wrong again where it counts, and a
kernel that it does not come by is compiled by the worker that needs it. A file in the folder of compiled code says of
each shape of a case, which is the case without its numbers, that this has been done.

Where there is a second processor, another process halves the time. Both first run fewer epochs with kernels as plain
Python, which tells in a second which ones are called, and share these out.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import wait
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relnav_sim.campaign import Case
from relnav_sim.campaign.blocks import filter_cost_us
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.kernels.code_folder import (
    code_folder,
    hush,
    is_being_compiled,
    is_kept,
    kernel_names,
    not_kept,
    not_writable,
    say_compiling,
    tell,
)
from relnav_sim.kernels.compiling import compile_kernel, interpreted, no_search_for_garbage
from relnav_sim.kernels.shares import shares
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.work import with_filters
from relnav_sim.runner.worker import Worker

if TYPE_CHECKING:
    from relnav_sim.simulation.learned import Learned

EPOCHS = 128
"""Epochs of a rehearsal: enough that sensors which seldom read have done so."""
FEWEST_EPOCHS = 8
LONGEST_IDLE_S = 5.0
"""A rehearsal in which nothing has been compiled for so much processor time, as when dynamics learn, is given up."""
FILTER_SECONDS = 0.2
"""What a filter in a rehearsal may take; one with many samples has fewer epochs."""
RUNS = (0, 1)
PREVIEW_EPOCHS = 4
"""Epochs that are run in plain Python."""
PREVIEW_S = 5.0
"""What they may take altogether."""
PREVIEW_COST_US = 300.0
"""Filters that take longer for a step would take too long in plain Python, which is up to 10000 times as slow."""
LOOKED_AT_EVERY_S = 0.1
LONGEST_SILENCE_S = 60.0
"""A rehearsal in which no kernel has been compiled for so long is at something else, and ended."""


def compile_kernels(tasks: Iterable[Task], say: Callable[[str], None]) -> None:
    """Have the kernels compiled that tasks need; return soon where that has been done on this machine.

    Args:
        tasks: What is to be computed.
        say: Told that it takes a while, and what keeps the code from being kept.
    """
    shapes = _shapes(tasks)
    if not shapes or all(map(is_kept, kernel_names())):
        return
    try:
        places = {code_folder() / f"rehearsed.{shape}": task for shape, task in shapes.items()}
    except RuntimeError:  # nobody knows where
        places = {Path(os.devnull, shape): task for shape, task in shapes.items()}
    left = {place: task for place, task in places.items() if not place.exists()}
    if not left:
        return
    if (reason := not_writable()) is not None:
        say(f"warning: {not_kept(reason)}")
        hush()
        return
    if _rehearsed(list(left.values()), say):
        for place in left:
            with suppress(OSError):
                place.touch()


def _rehearsed(tasks: Sequence[Task], say: Callable[[str], None]) -> bool:
    """Run a rehearsal in a process of its own; return whether another one would do no better."""
    from joblib import cpu_count  # as many as this process may use

    try:
        worker = Worker()
    except (OSError, RuntimeError, MemoryError):
        return False  # the campaign's own workers will say it
    tell(say)
    before = time.monotonic()
    last, seen, told = before, _changed(), False
    helper = None
    try:
        if cpu_count() > 1:
            with suppress(OSError, RuntimeError, MemoryError):
                helper = Worker()
                helper.call(partial(compile_ahead, place=1), tasks)
        ended = worker.call(partial(rehearse, is_helped=helper is not None), tasks)
        while not ended.done() and not worker.is_lost and time.monotonic() - last < LONGEST_SILENCE_S:
            wait([ended], LOOKED_AT_EVERY_S)
            if _changed() != seen:
                last, seen, told = time.monotonic(), _changed(), True
                say_compiling()
        is_up = worker.started.done() and worker.started.exception() is None
        # A process that died, or was ended, says nothing of it.
        reason = ended.result() if ended.done() and ended.exception() is None else None
    finally:
        worker.end()
        if helper is not None:
            helper.end()
    if told:
        say(f"compiled in {max(time.monotonic() - before, 1):.0f} s")
    if reason is not None:
        say(f"warning: {not_kept(reason)}")
        hush()
    return is_up and reason is None


def _changed() -> int:
    """Return when a kernel was last begun or kept."""
    with suppress(OSError):
        return code_folder().stat().st_mtime_ns
    return 0


def _shapes(tasks: Iterable[Task]) -> dict[str, Task]:
    """Return tasks that need all kernels that any of these does, by what tells them apart: a block for each filter."""
    cases = {(isinstance(task, BoundTask), task.case.id, *task.case.config.filters): task for task in tasks}
    found: dict[str, Task] = {}
    for task in cases.values():
        if isinstance(task, BoundTask):
            found.setdefault(_shape(("bound", _content(task.case.config))), task)
            continue
        common = _content(task.case.config.model_copy(update={"filters": {}}))
        for name, entry in task.case.config.filters.items():
            shape = _shape((common, entry.model_dump(mode="json")))
            found.setdefault(shape, replace(task, case=with_filters(task.case, [name])))
    return found


def _content(config: CaseConfig) -> dict[str, Any]:
    content = config.model_dump(mode="json", exclude={"name"})
    return content if config.untold is None else {**content, "untold": config.untold.model_dump(mode="json")}


def _shape(content: Any) -> str:
    return hashlib.sha256(json.dumps(_blank(content), sort_keys=True).encode()).hexdigest()[:20]


def _blank(content: Any) -> Any:
    """Return plain data in which a number is only zero or not, and a list holds what is different in it."""
    if isinstance(content, dict):
        return {name: _blank(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return sorted({json.dumps(_blank(value), sort_keys=True) for value in content})
    if isinstance(content, int | float) and not isinstance(content, bool):
        return content != 0
    return content


def rehearse(tasks: Sequence[Task], is_helped: bool) -> str | None:
    """Run the first epochs of tasks for what is compiled by it; return why that could not be kept, None where it was.

    To be called in a process of its own, of which nobody hears.

    Args:
        tasks: What is to be computed.
        is_helped: Whether another process compiles ahead, as this one then does too.
    """
    from threadpoolctl import get_cached_controller

    from relnav_sim.kernels import code_folder as folder
    from relnav_sim.simulation.learned import Learned

    _be_silent()
    if is_helped:
        with suppress(Exception):
            compile_ahead(tasks, place=0)
    learned, idle_s = Learned(), 0.0
    with get_cached_controller().limit(limits=1):
        for task in tasks:
            before, kept_before = time.process_time(), sum(map(is_kept, kernel_names()))
            _run(task, EPOCHS, RUNS, learned)
            in_vain = sum(map(is_kept, kernel_names())) == kept_before
            idle_s = idle_s + time.process_time() - before if in_vain else 0.0
            if idle_s > LONGEST_IDLE_S:
                break
    return folder.trouble()


def compile_ahead(tasks: Sequence[Task], place: int) -> None:
    """Compile what tasks need, as far as a few epochs in plain Python tell, beside another process that does so.

    Args:
        tasks: What is to be computed.
        place: Which of the two processes this is, 0 or 1; it compiles its own share, then what is left of the other's.
    """
    from relnav_sim.simulation.learned import Learned

    _be_silent()
    learned, before = Learned(), time.process_time()
    with interpreted() as called:
        for task in tasks:
            soon = isinstance(task, BoundTask) or _cost_us(task.case) < PREVIEW_COST_US
            if soon and time.process_time() - before < PREVIEW_S:
                _run(task, PREVIEW_EPOCHS, RUNS[:1], learned)
    own = set(kernel_names())
    both = shares([name for name in called if name in own])  # one of another package is left to its user
    names = [*both[place], *reversed(both[1 - place])]
    with no_search_for_garbage():
        for is_at_it in (is_being_compiled, lambda name: False):  # at last wait for what the other one has begun
            for name in names:
                if not is_kept(name) and not is_at_it(name):
                    with suppress(Exception):
                        compile_kernel(name)


def _be_silent() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


def _run(task: Task, epochs: int, runs: tuple[int, ...], learned: Learned) -> None:
    """Run the first epochs of a task, whatever comes of it."""
    from relnav_sim.crlb.case_bound import case_bound
    from relnav_sim.simulation.block import simulate_block

    with suppress(Exception):
        case = _first_epochs(task.case, epochs)
        if isinstance(task, BoundTask):
            case_bound(case, task.seed, learned)
        else:
            simulate_block(case, task.seed, runs, learned=learned)


def _first_epochs(case: Case, most: int = EPOCHS) -> Case:
    clock = case.config.clock
    within = max(FEWEST_EPOCHS, int(FILTER_SECONDS / (1e-6 * len(RUNS) * _cost_us(case))))
    duration_s = clock.step_s * min(most, within, clock.epochs - 1)
    clock = clock.model_copy(update={"duration_s": duration_s, "store_every_s": clock.step_s})
    return replace(case, config=case.config.model_copy(update={"clock": clock}))


def _cost_us(case: Case) -> float:
    return max(map(filter_cost_us, case.config.filters.values()))
