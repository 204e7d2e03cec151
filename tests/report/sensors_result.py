"""Two sensors of different dimension, one of them with an outage and readings that lack channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from relnav_sim.measurements.channel import Channel
from relnav_sim.results.block import FilterResult
from relnav_sim.statistics.errors import ErrorAccumulator, ScoringRules
from relnav_sim.statistics.readings import NisOfSensors

CHANNELS: Mapping[str, tuple[Channel, ...]] = {
    "camera": (Channel("azimuth", "rad", "azimuth", True), Channel("elevation", "rad", "elevation", True)),
    "lidar": (Channel("range", "m", "range"),),
}
OUT = (200.0, 420.0)
"""When the camera gives no readings, s."""


def nis_of_sensors(runs: int, epochs: int, step_s: float, seed: int = 3, scale: float = 1.0) -> NisOfSensors:
    """Return the NIS of consistent filters: the camera at every epoch but for an outage, the lidar at every fourth.

    In every fifth of its readings the camera has one channel instead of two.
    """
    rng = np.random.default_rng(seed)
    times_s = step_s * np.arange(1, epochs + 1)
    camera = np.where(rng.uniform(size=(runs, epochs)) < 0.2, 1, 2)
    camera[:, (times_s >= OUT[0]) & (times_s < OUT[1])] = 0
    lidar = np.zeros((runs, epochs), dtype=int)
    lidar[:, 3::4] = 1
    dof = {"camera": camera, "lidar": lidar}
    nis = {name: np.where(d > 0, scale * rng.chisquare(np.maximum(d, 1)), np.nan) for name, d in dof.items()}
    return NisOfSensors(nis, dof)


def with_sensors(result: FilterResult, step_s: float, store_every: int, settle_s: float, scale: float) -> FilterResult:
    """Return a filter's result with the NIS of two sensors in place of its own."""
    runs, times = result.nis.shape
    epochs = (times - 1) * store_every
    rules = ScoringRules(step_s, epochs + 1, store_every, settle_s, 10.0, 50.0)
    given = nis_of_sensors(runs, epochs, step_s, scale=scale)
    known = np.array([np.isfinite(values) for values in given.nis.values()])
    total = np.where(known.any(axis=0), np.nansum(list(given.nis.values()), axis=0), np.nan)
    errors = ErrorAccumulator(runs, rules)
    shape = runs, epochs
    errors.add(
        step_s * np.arange(1, epochs + 1), np.zeros((*shape, 6)), np.broadcast_to(np.eye(6), (*shape, 6, 6)), total,
        np.zeros(shape), by_sensor=given,
    )  # fmt: skip
    counted = errors.result()
    told = {name: counted.summary[name] for name in ("epochs", "updates", "nis_mean", "nis_lag1")}
    return replace(result, summary={**result.summary, **told}, nis=counted.nis, by_sensor=counted.by_sensor)
