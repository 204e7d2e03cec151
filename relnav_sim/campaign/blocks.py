"""How a campaign's runs are cut into blocks: from its cost alone, so that no worker count shows in the plan."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options

SIZES = (1, 2, 5, 10, 20, 25, 50, 100, 200)
"""Sizes of blocks: round, so that usual numbers of runs divide evenly and most blocks stay when runs are added.

Larger blocks are no faster per run: the arrays leave the cache.
"""
BLOCK_SECONDS = 20.0
"""What a block should take, CPU seconds: this is what a kill may cost."""
LONGEST_BLOCK_SECONDS = 40.0
"""What it may take where the campaign gives the runs of a block, or a run takes long; beyond, its filters are split."""
CALLS_SHARE = 0.25
"""Share of a block's time that may go into what a step costs however few the runs."""
SIMULATION_US = 5.0
"""Truth and sensors for one run and step, us."""
STATISTICS_US = 2.0
"""Errors, consistency and quantiles of one filter for one run and step, us."""
SMOOTHER_US, LAG_US = 4.0, 11.0
"""Going back over one run and step with a smoother: over all measurements, and with a fixed lag, us."""
MOST_SAMPLES = 1_000_000
"""Samples or particles of one filter in a block: 48 MB for each array of their states."""


def sample_count(entry: Options) -> int:
    """Return how many samples or particles a filter carries for each run; 1 where it has none."""
    return int(getattr(entry, "samples", None) or getattr(entry, "particles", None) or 1)


def cost_us(config: CaseConfig) -> float:
    """Return the rough CPU time of one run-step of a case with all its filters, us."""
    return SIMULATION_US + sum(STATISTICS_US + filter_cost_us(entry) for entry in config.filters.values())


def run_seconds(config: CaseConfig) -> float:
    """Return the rough CPU time of one run of a case, s."""
    return cost_us(config) * 1e-6 * (config.clock.epochs - 1)


def block_size(runs: int, cases: Sequence[CaseConfig]) -> int:
    """Return how many runs are computed together.

    About 20 s of work, at least 1 and at most 200 runs, fewer where the filters carry many samples, and at least two
    blocks in all. Where many filters together would leave so few runs that much of the time goes into calls, as many as
    make calls a quarter of it, unless a filter then takes more than 20 s alone: `filter_groups` parts the filters.
    """
    samples = max(sample_count(entry) for case in cases for entry in case.filters.values())
    most = min(min(map(_most_runs, cases)), MOST_SAMPLES / samples)
    if len(cases) == 1:
        most = min(most, ceil(runs / 2))
    return max(size for size in SIZES if size <= max(most, 1))


def _most_runs(config: CaseConfig) -> float:
    """Return how many runs of a case are worth a block."""
    together = BLOCK_SECONDS / run_seconds(config)
    calls_us = sum(filter_kinds()[e.kind].overhead_us + e.dynamics.step_overhead_us for e in config.filters.values())
    runs_beside_calls = calls_us / cost_us(config) * (1 - CALLS_SHARE) / CALLS_SHARE
    alone_us = SIMULATION_US + STATISTICS_US + max(map(filter_cost_us, config.filters.values()))
    alone = BLOCK_SECONDS / (1e-6 * alone_us * (config.clock.epochs - 1))
    return max(together, min(runs_beside_calls, alone))


def filter_groups(config: CaseConfig, names: Sequence[str], runs: int) -> list[tuple[str, ...]]:
    """Return filters, in order, in groups that are computed one after another for so many runs.

    All together where that takes at most 40 s, else as many at a time as do; one at least. Truth and sensors are then
    simulated once for each group, which costs little beside filters that take so long.
    """
    epochs = config.clock.epochs - 1
    groups: list[tuple[str, ...]] = []
    spent = 0.0
    shared: list[Options] = []
    for name in names:
        entry = config.filters[name]
        dynamics = entry.dynamics
        own = runs * (STATISTICS_US + filter_cost_us(entry)) + dynamics.step_overhead_us
        common = dynamics.shared_overhead_us
        seconds = 1e-6 * epochs * (own if dynamics in shared else own + common)
        if groups and spent + seconds <= LONGEST_BLOCK_SECONDS:
            groups[-1] += (name,)
            spent += seconds
            shared.append(dynamics)
        else:
            groups.append((name,))
            spent = 1e-6 * epochs * (runs * SIMULATION_US + own + common)
            shared = [dynamics]
    return groups


def filter_cost_us(entry: FilterEntry) -> float:
    """Return the registered cost, in proportion to the samples where the campaign asks for another number.

    Dynamics that cost more than a product of matrices say so in `step_cost_us` and `cost_factor`.
    """
    kind = filter_kinds()[entry.kind]
    algorithm = (
        entry.dynamics.cost_factor
        * kind.cost_us
        * sample_count(entry)
        / sample_count(kind.options_model.model_construct())
    )
    back = 0.0 if entry.smoother is None else SMOOTHER_US if entry.smoother == "rts" else LAG_US
    return algorithm + entry.dynamics.step_cost_us + back
