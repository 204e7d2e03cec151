"""How probable it is that the filters get a measurement, at the true states of some epochs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relnav_sim.options import Options
from relnav_sim.sensors.noise import OutageNoise, noise_parts
from relnav_sim.sensors.options import SensorsOptions
from relnav_sim.sensors.radar import in_sight, steps_per_reading, true_reading
from relnav_sim.sensors.suite import TrueStates, carrier_and_other

Array = NDArray[np.float64]


def reading_probability(sensors: SensorsOptions, truth: TrueStates, first_epoch: int, step_s: float) -> Array:
    """Return the probability of a measurement, (runs or 1, K): 0 or 1 unless outages are random.

    Radar limits, field of view, period and fixed outages decide for certain. Random outages count by the probability
    that the sensor works: every run starts working, and working and outage times are exponentially distributed. A
    measurement needs the radar and, where there are any, the GNSS receiver and the star tracker.

    Args:
        sensors: The sensors, with a radar.
        truth: Epochs (K,) and true states.
        first_epoch: Number of the first epoch.
        step_s: Time between epochs, s.
    """
    radar = sensors.radar
    assert radar is not None  # a campaign has one: its filters need it
    carrier, other = carrier_and_other(sensors, truth)
    epochs = np.arange(first_epoch, first_epoch + len(truth.times_s))
    probability = np.where(in_sight(radar, true_reading(radar, carrier, other)), 1.0, 0.0)
    probability *= epochs % steps_per_reading(radar.period_s, step_s) == 0
    return probability * working_probability(sensors, truth.times_s)


def working_probability(sensors: SensorsOptions, times_s: Array) -> Array:
    """Return the probability (K,) that no outage of a sensor that a measurement needs is on."""
    probability = np.ones(len(times_s))
    for sensor in (sensors.radar, sensors.gnss, sensors.star_tracker):
        if sensor is not None:
            probability *= _working(noise_parts(sensor.noise), times_s)
    return probability


def _working(parts: Sequence[Options], times_s: Array) -> Array:
    """Return the probability (K,) that no outage of a sensor is on."""
    probability = np.ones(len(times_s))
    for part in parts:
        if not isinstance(part, OutageNoise):
            continue
        for start, end in part.windows_s:
            probability[(times_s >= start) & (times_s < end)] = 0.0
        if part.rate_per_hour is not None and part.mean_duration_s is not None:
            fails, recovers = part.rate_per_hour / 3600, 1 / part.mean_duration_s
            both = fails + recovers
            probability *= (recovers + fails * np.exp(-both * times_s)) / both
    return probability
