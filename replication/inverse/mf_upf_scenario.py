"""What Wei, Song and Zhang (2012) state of orbits and radar: truth, measurements, and how errors are summed up.

The radar is on the chief, and its elevation is the angle across the orbit plane; seen from the deputy the errors are
the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim import ExponentialAtmosphere, ForceModel, eci_from_rtn, propagate, rtn_from_eci
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.orbits import Elements, state_from_elements
from replication.inverse.each_run import RadarOfEachRun
from replication.inverse.prior import Unknown, choice, log_uniform, or_else

DURATION_S, STEADY_S, LATE_S = 6000.0, 1000.0, 4000.0
SIGMAS = np.array([0.1, *[np.radians(0.05)] * 2]) / 3
STEPS_S = (2.0, 5.0, 10.0, 20.0)
START = (300.0, -371.055, -400.0, -0.2, -0.646805, 0.1)
ORBIT = Elements(7e6, 0.0, np.pi / 6, np.pi / 4, 0.0, np.pi / 6)
MEAN_MOTION = float(np.sqrt(MU_M3_S2 / 7e6**3))
FORCE = ForceModel(MU_M3_S2, RADIUS_M, atmosphere=ExponentialAtmosphere(600e3, 1.454e-13, 71_835.0))

UNKNOWNS = (
    Unknown(
        "step", "", "the time between measurements", choice((1, 1, 1, 1)), choices=tuple(f"{h:g} s" for h in STEPS_S)
    ),
    Unknown(
        "told_sigma", "", "the filter's radar sigma over the true one", or_else(0.4, 1.0, log_uniform(1, 300)), True
    ),
    Unknown("start_position_m", "m", "the start error of each position", log_uniform(0.01, 100), True),
    Unknown("start_velocity_m_s", "m/s", "the start error of each velocity", log_uniform(1e-4, 0.5), True),
    Unknown("ballistic_m2_kg", "m^2/kg", "Cd A / m of the chief, half the deputy's", log_uniform(2e-3, 0.1), True),
)


@dataclass(frozen=True)
class Flight:
    """What the filters of some settings with the same time between measurements are given.

    Attributes:
        times_s: Epochs, (K,).
        truth: States at the start and at the epochs, (n, K + 1, 6), RTN, m and m/s.
        z: Measurements, (n, K, 3).
        radar: What the filters are told of them.
        m0: First means, (n, 6).
        P0: First covariances, (n, 6, 6).
    """

    times_s: Array
    truth: Array
    z: Array
    radar: RadarOfEachRun
    m0: Array
    P0: Array


def flight(setting: Mapping[str, Array], rows: Indices, seeds: Sequence[Sequence[int]]) -> Flight:
    """Return the flight of the settings in these rows; their seeds and values are those of all settings."""
    own = {unknown.name: setting[unknown.name][rows] for unknown in UNKNOWNS}
    h = STEPS_S[int(own["step"][0])]
    times = np.arange(h, DURATION_S + h / 2, h)
    states = truth(own["ballistic_m2_kg"], np.append(0.0, times))
    normals = np.stack([np.random.default_rng(list(seeds[row])).standard_normal((len(times) + 2, 3)) for row in rows])
    radar = RadarOfEachRun(own["told_sigma"][:, None] * SIGMAS, (0.0, 0.0, 90.0))
    z = radar.predict(states[:, 1:], 0) + SIGMAS * normals[:, 2:]
    deviations = np.stack([own["start_position_m"]] * 3 + [own["start_velocity_m_s"]] * 3, axis=1)
    m0 = states[:, 0] + deviations * normals[:, :2].reshape(-1, 6)
    return Flight(times, states, z, radar, m0, deviations[:, :, None] ** 2 * np.eye(6))


def truth(ballistic: Array, times: Array) -> Array:
    """Return relative states (n, T, 6), RTN, for the chief's Cd A / m, (n,); the deputy's is twice that."""
    chief0 = state_from_elements(ORBIT, MU_M3_S2)
    both = np.stack([chief0, eci_from_rtn(chief0, START, FORCE.normal_acceleration(chief0, float(ballistic[0])))])
    count = len(ballistic)
    states = propagate(np.repeat(both, count, axis=0), times, FORCE, np.concatenate([ballistic, 2 * ballistic]))
    chief = states[:count]
    return rtn_from_eci(chief, states[count:], FORCE.normal_acceleration(chief, ballistic[:, None]))


def sizes(flown: Flight, mean: Array) -> tuple[Array, Array]:
    """Return the sizes of the errors of position and velocity, (n, K); runs that failed are 1e6 m off."""
    error = np.nan_to_num(mean - flown.truth[:, 1:], nan=1e6)
    return np.linalg.norm(error[..., :3], axis=-1), np.linalg.norm(error[..., 3:], axis=-1)


def rms(size: Array, within: Mask) -> Array:
    """Return the root mean square over some epochs, (n,)."""
    return np.asarray(np.sqrt((size[:, within] ** 2).mean(axis=1)))
