"""What a campaign will take, said before it runs: blocks, time, disk and memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from relnav_sim.campaign.blocks import filter_cost_us, filter_groups, sample_count
from relnav_sim.campaign.load import Campaign
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.filters.registry import filter_kinds

START_S = 3.0
"""CPU time of starting the program and two workers, whatever the campaign, s."""
_BOUND_US = 300.0
"""CPU time of a case's Cramér-Rao bound for one epoch, us."""
_SIMULATION_US, _STATISTICS_US = 0.5, 1.2
_SIMULATION_OVERHEAD_US, _STATISTICS_OVERHEAD_US = 10.0, 18.0
"""CPU time of truth and sensors, and of one filter's statistics: for each run and step, and for a step of a block.

Blocks are cut by the larger, safer figures of `blocks`, which change no estimate.
"""

_PROGRAM_BYTES = 150e6
"""The interpreter with NumPy and SciPy, resident."""
_EPOCH_BYTES = 8 * (18 + 12 + 12)
"""Truth of two spacecraft, measurements and their noise, for one run and epoch."""
_FILTER_EPOCH_BYTES = 8 * (6 + 36 + 2 + 30)
"""A filter's history and what the statistics make of it, for one run and epoch."""
_STORED_BYTES = 4 * 14
"""Error, sigma, NIS and NEES of one filter at one stored epoch, single precision."""
_COVARIANCE_STORED_BYTES = 4 * 21
"""The root of its covariance there, where it is stored."""
_TRUTH_STORED_BYTES = 8 * 6
_SAMPLE_BYTES = 8 * 6 * 6
"""A sample's state in the six or so arrays of one filter step."""
_SUMMARY_BYTES = 8 * 200
"""The statistics of one run of one filter, about two hundred numbers."""


@dataclass(frozen=True)
class Plan:
    """What a campaign will take; times and sizes are estimates, good to a factor of two.

    Attributes:
        blocks: Pieces of work, each some runs of one case with some of its filters.
        filter_steps: Filter steps in all: cases x runs x epochs x filters.
        cpu_s: CPU time of the simulation, the filters and the bound, s; `START_S` comes on top.
        disk_bytes: Size of the result file.
        memory_bytes: Memory of one worker.
    """

    blocks: int
    filter_steps: int
    cpu_s: float
    disk_bytes: float
    memory_bytes: float


def plan_campaign(campaign: Campaign) -> Plan:
    """Return the plan of a campaign; it depends on the campaign alone, not on the machine or the workers."""
    configs = [case.config for case in campaign.cases]
    block_runs = min(campaign.block_runs, campaign.runs)
    return Plan(
        blocks=sum(count * len(groups) for config in configs for count, _, groups in _blocks(config, campaign)),
        filter_steps=campaign.runs * sum((config.clock.epochs - 1) * len(config.filters) for config in configs),
        cpu_s=sum(_case_seconds(config, campaign) for config in configs),
        disk_bytes=campaign.runs * sum(_stored_bytes(config) for config in configs),
        memory_bytes=_PROGRAM_BYTES + block_runs * max(_held_bytes(config) for config in configs),
    )


def _blocks(config: CaseConfig, campaign: Campaign) -> list[tuple[int, int, list[tuple[str, ...]]]]:
    """Return how a case is cut: so many times so many runs, with the filters in these groups."""
    whole, rest = divmod(campaign.runs, campaign.block_runs)
    cuts = [(whole, campaign.block_runs), (1, rest)]
    names = tuple(config.filters)
    return [(count, runs, filter_groups(config, names, runs)) for count, runs in cuts if count and runs]


def _case_seconds(config: CaseConfig, campaign: Campaign) -> float:
    filtered = sum(
        count * block_seconds(config, names, runs)
        for count, runs, groups in _blocks(config, campaign)
        for names in groups
    )
    return filtered + (bound_seconds(config) if campaign.bound else 0.0)


def bound_seconds(config: CaseConfig) -> float:
    """Return the CPU time of the Cramér-Rao bound of a case, s."""
    return 1e-6 * _BOUND_US * config.clock.epochs


def block_seconds(config: CaseConfig, names: Sequence[str], runs: int) -> float:
    """Return the CPU time of a block of so many runs of a case with some of its filters, s.

    A step costs calls, however few the runs, and the arithmetic of each run. Filters with the same dynamics
    share what these do for all of them.
    """
    step_us = _SIMULATION_OVERHEAD_US + runs * _SIMULATION_US
    shared: list[DynamicsOptions] = []
    for name in names:
        entry = config.filters[name]
        dynamics = entry.dynamics
        step_us += filter_kinds()[entry.kind].overhead_us + dynamics.step_overhead_us
        step_us += _STATISTICS_OVERHEAD_US + runs * (_STATISTICS_US + filter_cost_us(entry))
        if dynamics not in shared:
            step_us += dynamics.shared_overhead_us
            shared.append(dynamics)
    return 1e-6 * step_us * (config.clock.epochs - 1)


def _stored_bytes(config: CaseConfig) -> float:
    """Return what one run of a case leaves in the result file, bytes."""
    filters = len(config.filters)
    stored = (config.clock.epochs - 1) // config.clock.store_every + 1
    series = _STORED_BYTES + (_COVARIANCE_STORED_BYTES if config.clock.store_covariance else 0)
    return stored * (series * filters + _TRUTH_STORED_BYTES) + _SUMMARY_BYTES * filters


def _held_bytes(config: CaseConfig) -> float:
    """Return what one run of a case holds in memory while its block is computed, bytes."""
    chunk = min(CHUNK_EPOCHS, config.clock.epochs)
    samples = max(map(sample_count, config.filters.values()))
    distinct: list[DynamicsOptions] = []
    for entry in config.filters.values():
        distinct += [entry.dynamics] if entry.dynamics not in distinct else []
    shared = sum(dynamics.shared_epoch_bytes for dynamics in distinct)
    return chunk * (_EPOCH_BYTES + _FILTER_EPOCH_BYTES + shared) + samples * _SAMPLE_BYTES + 2 * _stored_bytes(config)
