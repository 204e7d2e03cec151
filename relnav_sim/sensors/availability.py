"""How probable it is that the filters get each channel of a sensor, at the true states of some epochs."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.sensors.campaign_sensors import Sensors, own_sensor, relative_sensors
from relnav_sim.sensors.due import due
from relnav_sim.sensors.interface import Craft, RelativeSensorOptions, Sensed, SensorOptions
from relnav_sim.sensors.noise import OutageNoise, noise_parts
from relnav_sim.sensors.suite import TrueStates


def sensed(truth: TrueStates, host: Craft, step_s: float) -> Sensed:
    """Return the true states as a sensor on one craft meets them, without latency."""
    states = (truth.chief, truth.deputy) if host == "chief" else (truth.deputy, truth.chief)
    return Sensed(truth.times_s, *states, None, step_s)


def reading_at_every_epoch(sensors: Sensors) -> dict[str, SensorOptions]:
    """Return the same sensors, due at every epoch from the start on: for some epochs out of all that there are."""
    return {name: each.model_copy(update={"period_s": None, "offset_s": 0.0}) for name, each in sensors.items()}


def reading_probability(sensors: Sensors, name: str, truth: TrueStates, first_epoch: int, step_s: float) -> Array:
    """Return the probability of each channel of a sensor, (runs or 1, K, m): 0 or 1 unless outages are random.

    Its limits, field of view, period and fixed outages decide for certain. Random outages count by the probability that
    the sensor works: every run starts working, and working and outage times are exponentially distributed. A channel
    that needs a direction needs a measurement of its host's star tracker too, where it has one, and one fix of its GNSS
    receiver, from which on it carries its orbit on by itself; random outages count as no hindrance to that one.

    Args:
        sensors: All sensors of the campaign.
        name: The sensor's name; a relative one.
        truth: Epochs (K,) and true states.
        first_epoch: Number of the first epoch.
        step_s: Time between epochs, s.
    """
    options = relative_sensors(sensors)[name]
    epochs = np.arange(first_epoch, first_epoch + len(truth.times_s))
    probability = np.where(options.in_reach(sensed(truth, options.host, step_s)), 1.0, 0.0)
    probability *= due(epochs, options.period_s, options.offset_s, step_s)
    probability *= working_probability(options, truth.times_s)
    direction = probability * _direction_known(sensors, options, epochs, truth.times_s, step_s)
    return np.stack([direction if needed else probability for needed in options.needs_direction()], axis=-1)


def _direction_known(
    sensors: Sensors, options: RelativeSensorOptions, epochs: Integers, times_s: Array, step_s: float
) -> Array:
    """Return the probability (K,) that a sensor's host knows its orbit, and its attitude where that matters."""
    probability = np.ones(len(times_s))
    for role in options.direction_from:
        found = own_sensor(sensors, role, options.host)
        if found is None:
            continue
        own: SensorOptions = found[1]
        if role == "orbit":
            probability *= times_s >= first_reading_s(own, step_s)
        else:
            probability *= due(epochs, own.period_s, own.offset_s, step_s) * working_probability(own, times_s)
    return probability


def channels_due(sensors: Sensors, name: str, epochs: Integers, step_s: float) -> Mask:
    """Return at which epochs (K, m) each channel of a relative sensor is due, whatever there is to be seen.

    A measurement that would have been taken before the start is none. A channel that needs a direction is due with its
    host's star tracker, and from its first fix on.

    Args:
        sensors: All sensors of the campaign.
        name: The sensor's name.
        epochs: Numbers of the epochs (K,).
        step_s: Time between epochs, s.
    """
    options = relative_sensors(sensors)[name]
    times_s = epochs * step_s
    read = due(epochs, options.period_s, options.offset_s, step_s)
    read &= times_s >= options.latency_s * (1 - 1e-9)  # as in `simulation.chunks`, where that rounds
    directed = read.copy()
    for role in options.direction_from:
        found = own_sensor(sensors, role, options.host)
        if found is not None and role == "orbit":
            directed &= times_s >= first_reading_s(found[1], step_s)
        elif found is not None:
            directed &= due(epochs, found[1].period_s, found[1].offset_s, step_s)
    return np.stack([directed if needed else read for needed in options.needs_direction()], axis=-1)


def reads_for_certain(options: SensorOptions, epochs: Integers, times_s: Array, step_s: float) -> Mask:
    """Return when (K,) a sensor is due and no fixed outage is on: it then reads but for random outages."""
    read = due(epochs, options.period_s, options.offset_s, step_s)
    for start, end in _windows_s(options):
        read &= (times_s < start) | (times_s >= end)
    return read


def fails_at_random(options: SensorOptions) -> bool:
    """Return whether a sensor has random outages."""
    return any(isinstance(part, OutageNoise) and part.rate_per_hour is not None for part in noise_parts(options.noise))


def _windows_s(options: SensorOptions) -> list[tuple[float, float]]:
    """Return the fixed outages of a sensor, s."""
    return [window for part in noise_parts(options.noise) if isinstance(part, OutageNoise) for window in part.windows_s]


def first_reading_s(options: SensorOptions, step_s: float) -> float:
    """Return when the first measurement of a sensor may come, s: when it is due and no fixed outage is on."""
    period_s, first_s = options.period_s or step_s, options.offset_s
    while ends_s := [end for start, end in _windows_s(options) if start <= first_s < end]:
        first_s = options.offset_s + period_s * np.ceil((max(ends_s) - options.offset_s) / period_s - 1e-9)
    return float(first_s)


def working_probability(options: SensorOptions, times_s: Array) -> Array:
    """Return the probability (K,) that no outage of a sensor is on."""
    probability = np.ones(len(times_s))
    for part in noise_parts(options.noise):
        if not isinstance(part, OutageNoise):
            continue
        for start, end in part.windows_s:
            probability[(times_s >= start) & (times_s < end)] = 0.0
        if part.rate_per_hour is not None and part.mean_duration_s is not None:
            fails, recovers = part.rate_per_hour / 3600, 1 / part.mean_duration_s
            both = fails + recovers
            probability *= (recovers + fails * np.exp(-both * times_s)) / both
    return probability
