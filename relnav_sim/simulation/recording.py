"""A campaign's simulation as a flight would have recorded it: everything that its filters are given."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.recorded.readings import Readings, SensorReadings, Start
from relnav_sim.sensors import known_orbits, readings_layout
from relnav_sim.simulation.chunks import Chunk, chunks
from relnav_sim.simulation.start import starting_belief
from relnav_sim.streams import RandomSource

_MOST_NUMBERS = 20_000_000
"""Numbers of measurements that are kept at a time; runs are simulated so many together."""


def record(config: CaseConfig, seed: int, runs: Sequence[int]) -> Iterator[Readings]:
    """Yield everything that the filters of a case are given in some runs, a run at a time.

    These are the numbers that `run_campaign` filters, to the bit: measurements of all sensors as they are read, before
    the front end; the true orbit of a host where its frame follows from that; and the start.

    Args:
        config: The case.
        seed: The campaign's seed.
        runs: Numbers of the runs.
    """
    width = sum(map(len, readings_layout(config.sensors).values()))
    at_once = max(1, _MOST_NUMBERS // (width * config.clock.epochs))
    for first in range(0, len(runs), at_once):
        yield from _together(config, RandomSource(seed, tuple(runs[first : first + at_once])))


def _together(config: CaseConfig, source: RandomSource) -> Iterator[Readings]:
    parts: list[Chunk] = []
    for chunk in chunks(config, source):
        if not parts:
            prior = starting_belief(config, chunk, source)
        parts.append(chunk)
    times_s = np.concatenate([part.truth.times_s for part in parts])
    runs = len(source.runs)
    values = {name: np.concatenate([part.z[name] for part in parts], axis=1) for name in parts[0].z}
    for craft, name in known_orbits(config.sensors).items():
        states = np.concatenate([getattr(part.truth, craft) for part in parts], axis=1)
        values[name] = np.broadcast_to(states, (runs, *states.shape[1:]))
    for place, run in enumerate(source.runs):
        sensors = {name: _recorded(times_s, z[place], run) for name, z in values.items()}
        mean, covariance = prior.mean[place], prior.covariance[place]
        # A run without a first fix has no start, and none can be made of what is recorded either.
        start = Start(mean, covariance) if np.isfinite(mean).all() else None
        yield Readings({name: one for name, one in sensors.items() if len(one.times_s)}, start, run)


def _recorded(times_s: Array, z: Array, run: int) -> SensorReadings:
    """Return what one sensor read of z (T, m)."""
    read: Any = np.flatnonzero(~np.isnan(z).all(axis=1))
    origins = np.stack([np.zeros_like(read), read], axis=1)
    return SensorReadings(times_s[read], z[read], (f"run {run}, epoch",), origins)
