"""What a process of a cluster's worker does: it keeps the contents it was told of, and what it has learned."""

from __future__ import annotations

import signal
from pathlib import Path

from relnav_sim.runner.compute import Outcome, compute
from relnav_sim.runner.executors.content import Content, Order
from relnav_sim.runner.rehearsal import compile_kernels
from relnav_sim.simulation.learned import Learned

KEPT = 4
"""Contents that are kept; a tuning has one for each round."""

_LEARNED = Learned()
_KNOWN: dict[str, Content] = {}


def learn(told: tuple[str, bytes]) -> None:
    """Keep a content by its digest, and have the kernels compiled that it needs, where this machine has not."""
    # Whoever ends a batch job sends it to all its processes; this one ends with its worker, which first takes leave.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    digest, packed = told
    _KNOWN[digest] = Content.unpacked(packed)
    for old in list(_KNOWN)[:-KEPT]:
        del _KNOWN[old]
    compile_kernels(list(_KNOWN[digest].examples()), lambda sentence: None)


def carry_out(ordered: tuple[Order, Path]) -> tuple[Outcome, str]:
    """Compute a task into a folder; return what came of it and the name of its file there."""
    order, folder = ordered
    task = _KNOWN[order.content].task(order, folder)
    return compute(task, _LEARNED), task.path.name
