"""What a campaign will take, said before it runs: blocks, time, disk and memory."""

from __future__ import annotations

from dataclasses import dataclass

from relnav_sim.campaign.blocks import filter_groups, run_seconds, sample_count
from relnav_sim.campaign.load import Campaign
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.options import Options

STRETCH = 512
"""Epochs that a block holds at once."""

_PROGRAM_BYTES = 150e6
"""The interpreter with NumPy and SciPy, resident."""
_EPOCH_BYTES = 8 * (18 + 12 + 12)
"""Truth of two spacecraft, measurements and their noise, for one run and epoch."""
_FILTER_EPOCH_BYTES = 8 * (6 + 36 + 2 + 30)
"""A filter's history and what the statistics make of it, for one run and epoch."""
_STORED_BYTES = 4 * 14
"""Error, sigma, NIS and NEES of one filter at one stored epoch, single precision."""
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
        cpu_s: CPU time, s.
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
        blocks=sum(_blocks(config, campaign.runs, campaign.block_runs) for config in configs),
        filter_steps=campaign.runs * sum((config.clock.epochs - 1) * len(config.filters) for config in configs),
        cpu_s=campaign.runs * sum(run_seconds(config) for config in configs),
        disk_bytes=campaign.runs * sum(_stored_bytes(config) for config in configs),
        memory_bytes=_PROGRAM_BYTES + block_runs * max(_held_bytes(config) for config in configs),
    )


def _blocks(config: CaseConfig, runs: int, block_runs: int) -> int:
    whole, rest = divmod(runs, block_runs)
    names = tuple(config.filters)
    last = len(filter_groups(config, names, rest)) if rest else 0
    return whole * len(filter_groups(config, names, block_runs)) + last


def _stored_bytes(config: CaseConfig) -> float:
    """Return what one run of a case leaves in the result file, bytes."""
    filters = len(config.filters)
    stored = (config.clock.epochs - 1) // config.clock.store_every + 1
    return stored * (_STORED_BYTES * filters + _TRUTH_STORED_BYTES) + _SUMMARY_BYTES * filters


def _held_bytes(config: CaseConfig) -> float:
    """Return what one run of a case holds in memory while its block is computed, bytes."""
    stretch = min(STRETCH, config.clock.epochs)
    samples = max(map(sample_count, config.filters.values()))
    distinct: list[Options] = []
    for entry in config.filters.values():
        distinct += [entry.dynamics] if entry.dynamics not in distinct else []
    shared = sum(float(getattr(dynamics, "shared_epoch_bytes", 0.0)) for dynamics in distinct)
    return stretch * (_EPOCH_BYTES + _FILTER_EPOCH_BYTES + shared) + samples * _SAMPLE_BYTES + 2 * _stored_bytes(config)
