"""Relative motion that returns to where it began, from shapes that flight plans name.

Two orbits keep company if they take equally long for a revolution. About a point mass that is to have the same energy.
In a zonal field it is so to first order in J2 too where the energy counts the zonal potential: the mean semi-major
axis, and so the mean motion, follows from it (Schaub and Alfriend, Celestial Mechanics 79, 2001). So each shape is
first laid out on Kepler ellipses of equal semi-major axis, and the deputy's speed then set to the chief's energy.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, cos, hypot, sin, sqrt

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import eci_from_rtn
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.orbits import elements_from_state, state_from_elements
from relnav_sim.astro.relative_elements import mean_anomaly, true_anomaly


def trailing(chief: Array, along_track_m: float, gravity: Gravity) -> Array:
    """Return the state of a deputy on the chief's own orbit, (6,), ECI, m and m/s.

    Args:
        chief: The chief's state (6,), ECI, m and m/s.
        along_track_m: The straight distance between them, m: positive ahead, negative behind.
        gravity: Of the body that they go round.

    Raises:
        ValueError: The distance is more than a(1 - e), the nearest that the orbit comes to the centre.
    """
    orbit = elements_from_state(chief, gravity.mu_m3_s2)
    a, e, nu = float(orbit.semi_major_axis_m), float(orbit.eccentricity), float(orbit.true_anomaly_rad)
    if not abs(along_track_m) <= a * (1 - e):
        raise ValueError(f"along_track_m is more than the perigee's distance from the centre, {a * (1 - e):.6g} m")
    # The chord between eccentric anomalies E and E + 2 h is 2 a sin h sqrt(1 - e^2 cos^2 (E + h)).
    E, h = nu - 2 * atan2(e * sin(nu), 1 + sqrt(1 - e * e) + e * cos(nu)), 0.0
    for _ in range(_FIXED_POINT_STEPS):
        h = asin(along_track_m / (2 * a * sqrt(1 - (e * cos(E + h)) ** 2)))
    E += 2 * h
    ahead = E + 2 * atan2(e * sin(E), 1 + sqrt(1 - e * e) - e * cos(E))
    return energy_matched(state_from_elements(replace(orbit, true_anomaly_rad=ahead), gravity.mu_m3_s2), chief, gravity)


_FIXED_POINT_STEPS = 60
"""Each gains at least a digit for distances that are small beside the orbit."""


def nearest_to_rest(chief: Array, position_m: Array, gravity: Gravity) -> Array:
    """Return the state of a deputy at a position, as near to rest as it may be without drifting away, (6,), ECI.

    Of all velocities with the chief's energy the nearest to rest in the chief's turning frame has the direction that
    rest has in ECI. On V-bar of a circular orbit that is rest itself but for terms of second order; below or above, it
    starts a 2:1 ellipse.

    Args:
        chief: The chief's state (6,), ECI, m and m/s.
        position_m: Relative position (3,), RTN, m.
        gravity: Of the body that they go round.

    Raises:
        ValueError: No velocity at this position has the chief's energy.
    """
    at_rest = eci_from_rtn(chief, np.concatenate([position_m, np.zeros(3)]))
    return energy_matched(at_rest, chief, gravity)


def ellipse(
    chief: Array, radial_m: float, normal_m: float, centre_m: float, phase_rad: float, gravity: Gravity
) -> Array:
    """Return the state of a deputy on a safety ellipse, (6,), ECI, m and m/s.

    The relative eccentricity and inclination vectors are parallel (D'Amico and Montenbruck, J. Guidance 29(3), 2006):
    where the deputy crosses V-bar's height it is farthest out of plane, so that it never crosses V-bar itself. Radially
    it moves by `radial_m`, along-track by twice that. Amplitudes are those of a near-circular chief's orbit.

    Args:
        chief: The chief's state (6,), ECI, m and m/s.
        radial_m: Largest radial distance from the centre, m.
        normal_m: Largest distance out of plane, m.
        centre_m: The centre's place on V-bar, m.
        phase_rad: Where the deputy starts: 0 at the lowest point, a quarter turn on ahead, then above, then behind.
        gravity: Of the body that they go round.

    Raises:
        ValueError: The ellipse is too large for the chief's orbit.
    """
    orbit = elements_from_state(chief, gravity.mu_m3_s2)
    a, e, nu = float(orbit.semi_major_axis_m), float(orbit.eccentricity), float(orbit.true_anomaly_rad)
    # Angles count from the chief's position, so that neither circular nor equatorial orbits are special.
    ex, ey = e * cos(nu) + radial_m / a * cos(phase_rad), -e * sin(nu) - radial_m / a * sin(phase_rad)
    eccentricity = hypot(ex, ey)
    if not eccentricity < 1:
        raise ValueError("the ellipse is too large for the chief's orbit: the deputy's would be open")
    perigee = atan2(ey, ex)
    longitude = mean_anomaly(nu, e) - nu + centre_m / a
    anomaly = true_anomaly(longitude - perigee, eccentricity)
    p = a * (1 - eccentricity) * (1 + eccentricity)
    u, r, speed = perigee + anomaly, p / (1 + eccentricity * cos(anomaly)), sqrt(gravity.mu_m3_s2 / p)
    position = r * np.array([cos(u), sin(u), 0.0])
    velocity = speed * np.array([-eccentricity * sin(perigee) - sin(u), eccentricity * cos(perigee) + cos(u), 0.0])
    axis = np.array([cos(phase_rad), -sin(phase_rad), 0.0])
    tilted = [_turned(vector, axis, normal_m / a) for vector in (position, velocity)]
    radial, along, normal = _own_axes(chief)
    axes = np.stack([radial, along, normal])
    return energy_matched(np.concatenate([vector @ axes for vector in tilted]), chief, gravity)


def energy_matched(deputy: Array, chief: Array, gravity: Gravity) -> Array:
    """Return the deputy's state with its speed changed so that its energy is the chief's, zonal potential included.

    Raises:
        ValueError: No speed at this position has that energy.
    """
    energy = chief[3:] @ chief[3:] / 2 - gravity.potential(chief[:3])
    square = 2 * (energy + gravity.potential(deputy[:3]))
    if not square > 0:
        raise ValueError("no velocity at this position is free of drift: it is too far above the chief's orbit")
    return np.concatenate([deputy[:3], deputy[3:] * np.sqrt(square / (deputy[3:] @ deputy[3:]))])


def _own_axes(state: Array) -> tuple[Array, Array, Array]:
    normal = np.cross(state[:3], state[3:])
    radial, normal = state[:3] / np.linalg.norm(state[:3]), normal / np.linalg.norm(normal)
    return radial, np.cross(normal, radial), normal


def _turned(vector: Array, axis: Array, angle: float) -> Array:
    """Return a vector turned about a unit axis (Rodrigues)."""
    turned: Array = (
        vector * cos(angle) + np.cross(axis, vector) * sin(angle) + axis * (axis @ vector) * (1 - cos(angle))
    )
    return turned
