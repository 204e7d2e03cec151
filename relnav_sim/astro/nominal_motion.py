"""The chief's nominal orbit over a flight, under the point mass and the zonal harmonics of its body.

A Kepler orbit would not do: J2 moves the chief along an ellipse by a hundredth of a radian or so in a revolution.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.kepler import initial_state
from relnav_sim.astro.orbits import elements_from_state

_CHUNK = 1024
"""Epochs of which the motion is computed in one go."""
_TOLERANCE = 1e-10
"""Relative, of a step of integration: centimetres in a day."""


class ChiefMotion(NamedTuple):
    """How the chief moves at one epoch.

    Attributes:
        R: Distance from the centre, m.
        climb: Radial velocity R', m/s.
        n: Angular rate of its radius, rad/s.
    """

    R: float
    climb: float
    n: float


def chief_motion(orbit: ChiefOrbit, step_s: float, epoch: int) -> ChiefMotion:
    """Return the chief's motion at an epoch from 0 on, which is `epoch` times `step_s` after that of the orbit.

    An orbit that is circular at its epoch is taken to remain so: harmonics make it elliptic by a thousandth or so.
    """
    if orbit.eccentricity == 0:
        return ChiefMotion(orbit.semi_major_axis_m, 0.0, orbit.mean_motion_rad_s)
    chunk, place = divmod(epoch, _CHUNK)
    return _motions(orbit, step_s, chunk)[place]


def moved_on(orbit: ChiefOrbit, time_s: float) -> ChiefOrbit:
    """Return the osculating orbit some time after that of `orbit`, or before; a circular one as it is."""
    if orbit.eccentricity == 0 or time_s == 0:
        return orbit
    found = elements_from_state(_states(orbit, initial_state(orbit), np.array([0.0, time_s]))[-1], orbit.mu_m3_s2)
    return replace(
        orbit,
        semi_major_axis_m=float(found.semi_major_axis_m),
        eccentricity=float(found.eccentricity),
        inclination_rad=float(found.inclination_rad),
        raan_rad=float(found.raan_rad),
        argument_of_perigee_rad=float(found.argument_of_perigee_rad),
        true_anomaly_rad=float(found.true_anomaly_rad),
    )


@lru_cache(maxsize=64)
def _motions(orbit: ChiefOrbit, step_s: float, chunk: int) -> list[ChiefMotion]:
    starts = _chunk_starts(orbit, step_s)
    times_s = step_s * np.arange(_CHUNK + 1, dtype=np.float64)
    for earlier in range(len(starts) - 1, chunk):
        starts.append(_states(orbit, starts[earlier], times_s)[-1])
    states = _states(orbit, starts[chunk], times_s)
    if len(starts) == chunk + 1:
        starts.append(states[-1])
    r, v = states[:-1, :3], states[:-1, 3:]
    R = np.linalg.norm(r, axis=1)
    climb, n = (r * v).sum(axis=1) / R, np.linalg.norm(np.cross(r, v), axis=1) / np.square(R)
    return [ChiefMotion(*each) for each in np.stack([R, climb, n], axis=1).tolist()]


@lru_cache(maxsize=8)
def _chunk_starts(orbit: ChiefOrbit, step_s: float) -> list[Array]:
    """Return the states (6,) at the first epochs of the chunks known so far, in order; it grows by use."""
    return [initial_state(orbit)]


def _states(orbit: ChiefOrbit, start: Array, times_s: Array) -> Array:
    """Return the states (K, 6), ECI, at times from that of a state (6,) on."""
    from scipy.integrate import solve_ivp

    gravity = Gravity.of(orbit)
    scale = np.repeat([orbit.semi_major_axis_m, sqrt(orbit.mu_m3_s2 / orbit.semi_major_axis_m)], 3)

    def derivative(_: float, state: Array) -> Array:
        return np.concatenate([state[3:], gravity.acceleration(state[None, :3])[0]])

    solved = solve_ivp(
        derivative,
        (times_s[0], times_s[-1]),
        start,
        method="DOP853",
        t_eval=times_s,
        rtol=_TOLERANCE,
        atol=_TOLERANCE * scale,
    )
    return np.ascontiguousarray(solved.y.T)
