"""Are recorded measurements those that a campaign simulates? Then its simulated truth is theirs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.measurements.interface import wrap_angle
from relnav_sim.recorded.readings import Readings, SensorReadings
from relnav_sim.sensors import relative_sensors
from relnav_sim.simulation.recorded_chunks import ON_EPOCH
from relnav_sim.simulation.recording import record

_SAME = 1e-3
"""Sigmas within which two measurements are the same: files may have fewer digits, and by chance 1 in 1000 is."""


def difference_from_campaign(config: CaseConfig, seed: int, recorded: Sequence[Readings]) -> str:
    """Return in words where measurements first differ from those that a campaign simulates for the same runs.

    Empty where they are the campaign's own.

    More than half of the measurements of every relative sensor must be: some may have been left out, or spoilt on
    purpose to see what a filter makes of them.

    Args:
        config: The case.
        seed: The campaign's seed.
        recorded: The measurements, a run each.
    """
    sensors = relative_sensors(config.sensors)
    simulated = record(config, seed, [one.run for one in recorded])
    for one, own in zip(recorded, simulated, strict=True):
        found: list[tuple[float, str]] = []
        for name in (name for name in sensors if name in one.sensors):
            read, options = one.sensors[name], sensors[name]
            angles = np.array([channel.angle for channel in options.reading])
            same = np.zeros(len(read.times_s), dtype=bool)
            if name in own.sensors:
                same = _same(read, own.sensors[name], options.sigmas, angles, config.clock.step_s)
            if not np.mean(same) > 0.5:
                row = int(np.argmin(same))
                found.append((float(read.times_s[row]), f"{name} at {read.times_s[row]:g} s ({read.where(row)})"))
        if found:
            return f"run {one.run} differs first in {min(found)[1]}"
    return ""


def _same(one: SensorReadings, own: SensorReadings, sigmas: Array, angles: Mask, step_s: float) -> Mask:
    """Return which rows (N,) of recorded measurements are among those that were simulated, at the epochs."""
    moments, others_moments = (np.rint(each.times_s / (ON_EPOCH * step_s)) for each in (one, own))
    _, places, others = np.intersect1d(moments, others_moments, return_indices=True)
    difference = one.values[places] - own.values[others]
    difference = np.where(angles, wrap_angle(difference), difference)
    same = np.zeros(len(one.times_s), dtype=bool)
    there = np.isfinite(difference)
    same[places] = (np.abs(np.where(there, difference, 0.0)) <= _SAME * sigmas).all(axis=1) & there.any(axis=1)
    return same
