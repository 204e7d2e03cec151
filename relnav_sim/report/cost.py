"""What filters cost beside one another, in a sentence, where enough processor time was measured to say it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import Span
from relnav_sim.report.metrics import CPU
from relnav_sim.wording import listed, significant

LEAST_CPU_S = 1.0
"""Of less, the memory that a process touches for the first time is too much: up to 0.1 s of its first filter."""


def cost_in_words(per_filter: Sequence[tuple[str, Sequence[tuple[FilterFacts, Span]]]]) -> list[str]:
    """Return what a step of each filter costs, or that too little was measured; nothing where nothing was.

    Args:
        per_filter: Each filter's name with what is known of it in each case, and the span that is looked at.
    """
    known, took_s = [], []
    for name, items in per_filter:
        cost = float(np.mean(np.concatenate([CPU.per_run(item, span)[item.ok] for item, span in items])))
        if math.isfinite(cost) and cost > 0:
            known.append((cost, name))
            took_s.append(sum(_cpu_s(item) for item, _ in items))
    if not known:
        return []
    if len(known) > 1 and min(took_s) < LEAST_CPU_S:
        least_s = significant(max(min(took_s), 1e-3), 1)
        return [
            f"Cost: not compared; {least_s} s of CPU time, which is all that a filter took, is too little to measure."
        ]
    (lowest, cheapest), *others = sorted(known)
    text = f"Cost: {cheapest} {significant(lowest)} {CPU.unit} of CPU per filter step"
    times = [f"{name} takes {significant(cost / lowest)} times that" for cost, name in others]
    return [f"{text}; {listed(times)}." if times else f"{text}."]


def _cpu_s(item: FilterFacts) -> float:
    """Return the processor time that a filter took for its completed runs of a case, s."""
    epochs = item.stored["epochs"][item.ok, 0]
    return float(np.nansum(item.cpu_us[item.ok] * epochs)) / 1e6
