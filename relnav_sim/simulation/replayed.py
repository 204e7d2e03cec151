"""What came of recorded measurements: what each filter said, and where it all came from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign import Campaign, Case
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.filters.channel_residuals import ChannelResiduals
from relnav_sim.filters.failed_runs import FailedRun
from relnav_sim.measurements.channel import Channel
from relnav_sim.recorded.readings import Readings
from relnav_sim.results.block import BlockResult
from relnav_sim.simulation.breakdown import Breakdown


@dataclass(frozen=True)
class ReplayedFilter:
    """What one filter made of recorded measurements; the leading axis of every array is the runs'.

    Attributes:
        channels: The numbers of a measurement as this filter takes it, by sensor.
        names: The components of the state, (n,).
        mean: Estimates, (runs, T, n): position and velocity, RTN, m and m/s, and the augmented states behind them.
        sigma: Standard deviations that the filter states, (runs, T, n).
        nis: Normalised innovation squared by sensor, with the R that the filter works with, each (runs, T); NaN where
            it was not read.
        dof: Channels read by sensor, each (runs, T).
        residuals: Residuals by sensor and channel.
        smoothed_change: (x_f - x_s) / sqrt(P_f - P_s), (runs, T, n): by how much later measurements moved each
            estimate, in sigmas of what they may move it by; NaN where they tell nothing.
        failures: The runs that failed, by their place.
    """

    channels: Mapping[str, tuple[Channel, ...]]
    names: tuple[str, ...]
    mean: Array
    sigma: Array
    nis: Mapping[str, Array]
    dof: Mapping[str, Integers]
    residuals: Mapping[str, ChannelResiduals]
    smoothed_change: Array
    failures: tuple[FailedRun, ...]


@dataclass(frozen=True)
class ReplayedBlock:
    """What came of the recorded measurements of some runs.

    Attributes:
        times_s: The epochs, (T,), s.
        config: The case with the duration that was replayed.
        filters: By the filter's name; those that broke are left out.
        broken: Why those did.
        results: Errors against the truth, those of some runs each; none where it is not known.
        longest_late_s: The longest time between a measurement and the epoch at which it counted, s.
        warnings: What the user should know: sentences.
    """

    times_s: Array
    config: CaseConfig
    filters: Mapping[str, ReplayedFilter]
    broken: Mapping[str, Breakdown]
    results: tuple[BlockResult, ...]
    longest_late_s: float
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class RecordedFile:
    """A file of measurements.

    Attributes:
        path: Its name as the user gave it.
        sha256: Digest of its content.
    """

    path: str
    sha256: str


@dataclass(frozen=True)
class Replay:
    """What came of recorded measurements.

    Attributes:
        campaign: The campaign with the one case that was replayed.
        case: The case with the filters that were replayed.
        files: The files.
        recorded: What they hold, a run each.
        block: What the filters made of it.
        truth: What the estimates are scored against, in words; empty where nothing is.
        unscored: Why nothing is known to score them against, a sentence; empty where they are scored, or not to be.
        started: When the replay began.
        wall_time_s: How long it took, s.
        notes: What the user should know: sentences.
    """

    campaign: Campaign
    case: Case
    files: tuple[RecordedFile, ...]
    recorded: tuple[Readings, ...]
    block: ReplayedBlock
    truth: str
    unscored: str
    started: datetime
    wall_time_s: float
    notes: tuple[str, ...]


def joined(parts: Sequence[ReplayedBlock]) -> ReplayedBlock:
    """Return what came of all runs, from blocks of some each; a filter that broke in one of them is left out."""
    broken = {name: why for part in parts for name, why in part.broken.items()}
    names = [name for name in parts[0].config.filters if name not in broken]
    return replace(
        parts[0],
        filters={name: _joined_filter([part.filters[name] for part in parts]) for name in names},
        broken=broken,
        results=tuple(result for part in parts for result in part.results),
        longest_late_s=max(part.longest_late_s for part in parts),
        warnings=tuple(dict.fromkeys(sentence for part in parts for sentence in part.warnings)),
    )


def _joined_filter(parts: Sequence[ReplayedFilter]) -> ReplayedFilter:
    sensors = list(parts[0].nis)
    begins = np.cumsum([0, *(len(part.mean) for part in parts)]).tolist()

    def stacked(series: Iterable[Array]) -> Array:
        return np.concatenate(list(series))

    return replace(
        parts[0],
        mean=stacked(part.mean for part in parts),
        sigma=stacked(part.sigma for part in parts),
        nis={sensor: stacked(part.nis[sensor] for part in parts) for sensor in sensors},
        dof={sensor: np.concatenate([part.dof[sensor] for part in parts]) for sensor in sensors},
        residuals={
            sensor: ChannelResiduals(
                stacked(part.residuals[sensor].residual for part in parts),
                stacked(part.residuals[sensor].sigma for part in parts),
                np.concatenate([part.residuals[sensor].rejected for part in parts]),
            )
            for sensor in sensors
        },
        smoothed_change=stacked(part.smoothed_change for part in parts),
        failures=tuple(
            replace(failure, run=failure.run + begin)
            for part, begin in zip(parts, begins, strict=False)
            for failure in part.failures
        ),
    )
