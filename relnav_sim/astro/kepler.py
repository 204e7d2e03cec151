"""The chief's nominal orbit in time: where it is, and how far it turns within a step."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, sin, sqrt

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit


@dataclass(frozen=True)
class Arc:
    """A chunk of the orbit from each of K instants on, seen at s times after it.

    Attributes:
        true_anomaly_rad: At the instant, (K,), in (-2 pi, 2 pi).
        start_radius_m: Distance from the centre at the instant, (K,).
        sweep_rad: Angle turned through since, (K, s).
        radius_m: Distance from the centre after it, (K, s).
    """

    true_anomaly_rad: Array
    start_radius_m: Array
    sweep_rad: Array
    radius_m: Array


def arc(orbit: ChiefOrbit, times_s: Array, offsets_s: Array) -> Arc:
    """Return the Kepler orbit after `offsets_s` (s,) from each of `times_s` (K,), s since the orbit's own epoch.

    Kepler's equation is solved once more for the change over the offset (Battin, An Introduction to the Mathematics and
    Methods of Astrodynamics, 1999, chapter 4), so that a small sweep keeps its digits however long the flight.
    """
    a, e, n = orbit.semi_major_axis_m, orbit.eccentricity, orbit.mean_motion_rad_s
    M0 = _initial_mean_anomaly(orbit) + n * times_s
    change = n * offsets_s
    E0, lead = eccentric_anomaly(M0, e)
    s, c = e * np.sin(E0)[:, None], e * np.cos(E0)[:, None]
    dE = change + (eccentric_anomaly(M0[:, None] + change, e)[1] - lead[:, None])
    for _ in range(2):
        # dE - e cos E0 sin dE + e sin E0 (1 - cos dE) = n dt
        sine, versine = np.sin(dE), 2 * np.square(np.sin(dE / 2))
        dE = dE - (dE - c * sine + s * versine - change) / (1 - c * (1 - versine) + s * sine)
    E1 = E0[:, None] + dE
    before, after = _half_lead(E0, e)[:, None], _half_lead(E1, e)
    sweep = dE + 2 * np.arctan2(after - before, 1 + after * before)
    return Arc(E0 + 2 * np.arctan(before[:, 0]), a * (1 - c[:, 0]), sweep, a * (1 - e * np.cos(E1)))


def eccentric_anomaly(mean_anomaly_rad: Array, eccentricity: float) -> tuple[Array, Array]:
    """Return the eccentric anomaly E in [-pi, pi] of any mean anomaly M, and E - M of the same turn, rad.

    Newton's method. E - e sin E bends one way on each half of the orbit, so that a start beyond the root, where
    M / (1 - e) is, never overshoots.
    """
    M = np.remainder(mean_anomaly_rad + np.pi, 2 * np.pi) - np.pi
    E = np.clip(M / (1 - eccentricity), -np.pi, np.pi)
    for _ in range(_NEWTON_STEPS):
        E = E - (E - eccentricity * np.sin(E) - M) / (1 - eccentricity * np.cos(E))
    return E, E - M


_NEWTON_STEPS = 12
"""Enough for rounding error up to e = 0.98; the digits double each time."""


def _half_lead(E: Array, e: float) -> Array:
    """Return tan((true - eccentric anomaly) / 2) = b sin E / (1 - b cos E), b = e / (1 + sqrt(1 - e^2))."""
    b = e / (1 + sqrt(1 - e * e))
    return b * np.sin(E) / (1 - b * np.cos(E))


def _initial_mean_anomaly(orbit: ChiefOrbit) -> float:
    e, angle = orbit.eccentricity, orbit.true_anomaly_rad
    E = atan2(sqrt(1 - e * e) * sin(angle), e + cos(angle))
    return E - e * sin(E)


def initial_state(orbit: ChiefOrbit) -> Array:
    """Return the chief's nominal position and velocity at the orbit's epoch, ECI, (6,), m and m/s."""
    e, angle = orbit.eccentricity, orbit.true_anomaly_rad
    parameter = orbit.semi_major_axis_m * (1 - e * e)
    radius, speed = parameter / (1 + e * cos(angle)), sqrt(orbit.mu_m3_s2 / parameter)
    u = orbit.argument_of_perigee_rad + angle
    node, inclination = orbit.raan_rad, orbit.inclination_rad
    ascending = np.array([cos(node), sin(node), 0.0])
    ahead = np.array([-sin(node) * cos(inclination), cos(node) * cos(inclination), sin(inclination)])
    radial, transverse = cos(u) * ascending + sin(u) * ahead, cos(u) * ahead - sin(u) * ascending
    velocity = speed * (e * sin(angle) * radial + (1 + e * cos(angle)) * transverse)
    return np.concatenate([radius * radial, velocity])
