"""What learned dynamics learn from: the same two craft before the campaign starts, on other random numbers."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.context import DynamicsContext, TrainingTrack
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import create_filter
from relnav_sim.filters.run import advance
from relnav_sim.filters.smoother import smooth
from relnav_sim.sensors import relative_sensors, sensor_measurement
from relnav_sim.simulation.chunks import chunks
from relnav_sim.simulation.host_orbits import believed_orbit, believed_orbit_at
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, begun_earlier, nominal_chief

TRAINING_RUN = 2**40
"""Number of the training flight: beyond every run, so that it shares no random numbers with any."""


def training_track(
    config: CaseConfig, options: DynamicsOptions, noise: ProcessNoiseOptions, seed: int
) -> TrainingTrack:
    """Return the states that learned dynamics are trained on, one step apart.

    The nominal flight of the same two craft before the campaign's start, which it reaches. From `smoothed_radar` the
    states are those of an extended Kalman filter on the first sensor that gives a position by itself, with the base
    dynamics and a process noise, smoothed; from `truth` they are error-free.

    Args:
        config: The case.
        options: Those of the dynamics, which say what track they need.
        noise: The process noise of the filter that smooths.
        seed: The campaign's seed.

    Raises:
        ValueError: No sensor gives a position by itself, or it sees nothing during all that time.
    """
    config = config.told  # no stress is trained on
    step_s = config.clock.step_s
    request = options.training_request(nominal_chief(config.truth))
    duration_s = step_s * math.ceil(request.duration_s / step_s)
    assert isinstance(config.truth, TruthOptions)  # a campaign with recorded orbits has no learned dynamics
    clock = config.clock.model_copy(update={"duration_s": duration_s})
    flown = config.model_copy(update={"clock": clock, "truth": begun_earlier(config.truth, duration_s)})
    orbit = nominal_chief(flown.truth)
    flight = list(chunks(flown, RandomSource(seed, (TRAINING_RUN,))))
    time_s = np.concatenate([part.truth.times_s for part in flight]) - duration_s
    if request.source == "truth":
        return TrainingTrack(np.concatenate([part.truth.relative[0] for part in flight]), time_s, orbit)
    name = fix_sensor(config)
    z = np.concatenate([part.inputs[name][relative_sensors(config.sensors)[name].forms[0]] for part in flight], axis=1)
    dynamics = request.base.build(DynamicsContext(orbit, noise, step_s))
    states, first = _smoothed(flown, name, dynamics, z)
    return TrainingTrack(states, time_s[first:], orbit, first)


def _smoothed(config: CaseConfig, name: str, dynamics: Dynamics, z: Array) -> tuple[Array, int]:
    """Return the smoothed states (K, 6) after the first of a sensor's measurements z (1, epochs, m), and its epoch."""
    step_s = config.clock.step_s
    sensors, orbit = config.sensors, believed_orbit(config)
    told = sensor_measurement(name, sensors, orbit, step_s)
    seen = np.flatnonzero(~np.isnan(z[0]).any(axis=1))
    if not len(seen):
        raise ValueError(f"the {name} sees nothing before the campaign's start, so that there is nothing to learn from")
    first = int(seen[0]) + 1
    at_fix = believed_orbit_at(config, name, (first - 1) * step_s)
    at_once = sensor_measurement(name, sensors, at_fix, step_s, assumed_latency="none")
    fix = relative_sensors(sensors)[name].first_fix(at_once, z[:, first - 1])
    assert fix is not None  # the sensor is one that gives fixes
    position, position_covariance = fix
    # A closed relative orbit of that size moves no faster, so that a latency does not matter to the fix; how it moves,
    # a few measurements tell.
    speed = 2 * orbit.mean_motion_rad_s * np.linalg.norm(position)
    covariance = np.zeros((1, 6, 6))
    covariance[:, :3, :3] = position_covariance
    covariance[:, 3:, 3:] = speed**2 * np.eye(3)
    start = Gaussian(np.concatenate([position, np.zeros((1, 3))], axis=1), covariance)
    _, history = advance(create_filter("ekf", dynamics, told), start, z[:, first:], first, step_s)
    return smooth(history, dynamics, step_s, first).mean[0], first
