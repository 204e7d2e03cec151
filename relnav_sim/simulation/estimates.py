"""What a filter says in one run, with its whole covariance, which results do not store."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import eci_from_rtn
from relnav_sim.campaign import Campaign, Case
from relnav_sim.filters.belief import Filter
from relnav_sim.filters.history import FilterHistory
from relnav_sim.simulation.block import filter_block
from relnav_sim.simulation.chunks import Chunk, chunks
from relnav_sim.streams import RandomSource

_LARGE = 1e6


@dataclass(frozen=True)
class EstimatedOrbit:
    """The deputy's orbit as a filter estimates it, set on the chief's true one.

    Attributes:
        times_s: Epochs, (T,), s.
        states: ECI, (T, 6), m and m/s; NaN from the epoch on at which the filter failed.
        covariance: Of the same, (T, 6, 6): that of the relative state alone, as the chief's orbit is the true one.
    """

    times_s: Array
    states: Array
    covariance: Array


def estimated_orbit(campaign: Campaign, case: int, filter: str, run: int) -> EstimatedOrbit:
    """Return the deputy's orbit as a filter estimates it in a run, at every epoch: the estimates of `run_campaign`.

    Args:
        campaign: From `load_campaign`.
        case: Index of the case.
        filter: The filter's name.
        run: Number of the run.

    Raises:
        RuntimeError: The filter raised an exception.
    """
    whole = campaign.cases[case]
    config = whole.config.model_copy(update={"filters": {filter: whole.config.filters[filter]}})
    alone = Case(whole.id, whole.label, whole.variables, config)
    source = RandomSource(campaign.seed, (run,))
    watch = _Estimates()
    outcome = filter_block(alone, source, chunks(config, source), case, watch=watch)
    if outcome.broken:
        raise RuntimeError(outcome.broken[filter].reason)
    parts = watch.smoothed or watch.filtered
    return EstimatedOrbit(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("times_s", "states", "covariance"))
    )


class _Estimates:
    """Keeps the orbit as it is estimated, chunk by chunk."""

    def __init__(self) -> None:
        self.filtered: list[EstimatedOrbit] = []
        self.smoothed: list[EstimatedOrbit] = []

    def __call__(self, name: str, filter: Filter, chunk: Chunk, before: Array, history: FilterHistory) -> None:
        """Keep what a filter says."""
        self.filtered.append(_estimated(chunk, history))

    def afterwards(self, name: str, chunk: Chunk, history: FilterHistory) -> None:
        """Keep what a smoother makes of it."""
        self.smoothed.append(_estimated(chunk, history))


def _estimated(chunk: Chunk, history: FilterHistory) -> EstimatedOrbit:
    truth, mean = chunk.truth, history.mean[0, :, :6]
    assert truth.normal_acceleration_m_s2 is not None  # of a simulated truth it is known
    chief, normal = truth.chief[0], truth.normal_acceleration_m_s2[0]
    states = eci_from_rtn(chief, mean, normal)
    # The map is affine: its columns are differences, of arguments as large as the orbit for the sake of digits.
    columns = (eci_from_rtn(chief[:, None], _LARGE * np.eye(6), normal[:, None]) - chief[:, None]) / _LARGE
    J = np.swapaxes(columns, 1, 2)
    covariance = J @ history.covariance[0, :, :6, :6] @ np.swapaxes(J, 1, 2)
    return EstimatedOrbit(truth.times_s, states, covariance)
