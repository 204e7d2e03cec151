"""Orbital elements and inertial states."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import PARALLEL

# Below this, perigee and node are rounding noise: they get fixed values, at a cost below 1e-7 m in position.
DEGENERATE = 1e-14


@dataclass(frozen=True)
class Elements:
    """Osculating elements, lengths in m, angles in rad; numbers or arrays that broadcast.

    The semi-major axis of a hyperbola is negative. A circular orbit has argument of perigee 0 and the true anomaly
    counts from the node; an equatorial one (i = 0 or pi) has node 0 and perigee counts from ECI x.
    """

    semi_major_axis_m: float | Array
    eccentricity: float | Array
    inclination_rad: float | Array
    raan_rad: float | Array
    argument_of_perigee_rad: float | Array
    true_anomaly_rad: float | Array


def state_from_elements(elements: Elements, mu_m3_s2: float) -> Array:
    """Return position and velocity (..., 6) in m and m/s, ECI (Vallado, 4th ed., algorithm 10).

    Raises:
        ValueError: The elements are of no orbit: e < 0, e = 1, a of the wrong sign, or an anomaly past the asymptote.
    """
    a, e, i, raan, argp, nu = (
        np.asarray(value, dtype=float)
        for value in (
            elements.semi_major_axis_m,
            elements.eccentricity,
            elements.inclination_rad,
            elements.raan_rad,
            elements.argument_of_perigee_rad,
            elements.true_anomaly_rad,
        )
    )
    if not np.all(e >= 0):
        raise ValueError("the eccentricity must be a number of at least 0")
    p = a * (1 - e) * (1 + e)
    if not np.all(p > 0):
        raise ValueError("the semi-major axis must be positive for e < 1 and negative for e > 1; e = 1 has none")
    if not np.all(1 + e * np.cos(nu) > 0):
        raise ValueError("the true anomaly lies past the asymptote of the hyperbola")
    r = p / (1 + e * np.cos(nu))
    speed = np.sqrt(mu_m3_s2 / p)
    along_perigee, along_side = r * np.cos(nu), r * np.sin(nu)
    rate_perigee, rate_side = -speed * np.sin(nu), speed * (e + np.cos(nu))
    toward_perigee, sideways = _plane_axes(raan, i, argp)
    position = [u * along_perigee + w * along_side for u, w in zip(toward_perigee, sideways, strict=True)]
    velocity = [u * rate_perigee + w * rate_side for u, w in zip(toward_perigee, sideways, strict=True)]
    return np.stack(np.broadcast_arrays(*position, *velocity), axis=-1)


def elements_from_state(states: ArrayLike, mu_m3_s2: float) -> Elements:
    """Return the osculating elements of position and velocity (..., 6) in m and m/s, ECI.

    Angles other than the inclination are in [0, 2 pi). All come from arctangents in the orbit plane, which keep their
    digits at every inclination and eccentricity.

    Raises:
        ValueError: Position and velocity are parallel, so that there is no orbit plane.
    """
    states = np.asarray(states, dtype=float)
    r, v = states[..., :3], states[..., 3:]
    h = np.cross(r, v)
    distance, momentum = np.linalg.norm(r, axis=-1), np.linalg.norm(h, axis=-1)
    if not np.all(momentum > PARALLEL * distance * np.linalg.norm(v, axis=-1)):
        raise ValueError("position and velocity are parallel: they span no orbit plane")
    speed2, radial_motion = np.sum(v * v, axis=-1), np.sum(r * v, axis=-1)
    with np.errstate(divide="ignore"):
        a = 1 / (2 / distance - speed2 / mu_m3_s2)
    toward_perigee = ((speed2 / mu_m3_s2 - 1 / distance)[..., None] * r) - (radial_motion / mu_m3_s2)[..., None] * v
    e = np.linalg.norm(toward_perigee, axis=-1)

    tilt = np.hypot(h[..., 0], h[..., 1])
    equatorial = tilt < DEGENERATE * momentum
    raan = np.where(equatorial, 0.0, np.arctan2(h[..., 0], -h[..., 1]))
    node = np.stack([np.cos(raan), np.sin(raan), np.zeros_like(raan)], axis=-1)
    across = np.cross(h / momentum[..., None], node)
    latitude_argument = _angle(r, node, across)
    argp = np.where(e < DEGENERATE, 0.0, _angle(toward_perigee, node, across))
    return Elements(
        semi_major_axis_m=a,
        eccentricity=e,
        inclination_rad=np.arctan2(tilt, h[..., 2]),
        raan_rad=_positive(raan),
        argument_of_perigee_rad=_positive(argp),
        true_anomaly_rad=_positive(latitude_argument - argp),
    )


def _plane_axes(raan: Array, i: Array, argp: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return the ECI components of the unit vectors to perigee and 90 degrees ahead of it."""
    cos_raan, sin_raan, cos_i, sin_i = np.cos(raan), np.sin(raan), np.cos(i), np.sin(i)
    cos_argp, sin_argp = np.cos(argp), np.sin(argp)
    toward_perigee = (
        cos_raan * cos_argp - sin_raan * sin_argp * cos_i,
        sin_raan * cos_argp + cos_raan * sin_argp * cos_i,
        sin_argp * sin_i,
    )
    sideways = (
        -cos_raan * sin_argp - sin_raan * cos_argp * cos_i,
        -sin_raan * sin_argp + cos_raan * cos_argp * cos_i,
        cos_argp * sin_i,
    )
    return toward_perigee, sideways


def _angle(vector: Array, first: Array, second: Array) -> Array:
    """Return the angle of `vector` in the plane of two perpendicular unit vectors, from the first."""
    angle: Array = np.arctan2(np.sum(vector * second, axis=-1), np.sum(vector * first, axis=-1))
    return angle


def _positive(angle: Array) -> Array:
    """Return the angle in [0, 2 pi); a tiny negative one would round up to 2 pi itself."""
    wrapped = np.mod(angle, tau)
    positive: Array = np.where(wrapped == tau, 0.0, wrapped)
    return positive
