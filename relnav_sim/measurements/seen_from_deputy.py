"""Where the chief stands in the deputy's own orbit frame, as a function of the relative state.

The chief is taken on a circular orbit of radius R and rate n. In the chief's RTN axes the deputy is at
d = (R + x, y, z) and moves inertially with w = (vx - n y, vy + n (R + x), vz). The deputy's own RTN axes follow from
d and h = d x w, so nothing is approximated but the chief's orbit. Wei, Song and Zhang (2012, eq. 4) leave out the
relative velocity, which tilts their frame by vz / (n R), 4e-5 rad at 0.3 m/s; at rest the formulas agree with theirs
once the misprints there are corrected.
"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import Vector


def chief_from_deputy(states: Array, orbit: ChiefOrbit) -> Array:
    """Return the chief's position relative to the deputy in the deputy's RTN axes, (points, 3) m.

    Args:
        states: (points, n >= 6), in C order, the deputy's RTN position (m) and velocity (m/s) relative to the chief.
        orbit: The chief's nominal orbit, taken as circular.
    """
    return kernels.deputy.chief_seen(states, orbit.semi_major_axis_m, orbit.mean_motion_rad_s)


def chief_from_deputy_with_jacobian(states: Array, orbit: ChiefOrbit) -> tuple[Array, Array]:
    """Return `chief_from_deputy` and its derivatives with respect to the first six states, (points, 3, 6)."""
    return kernels.deputy.chief_seen_with_jacobian(states, orbit.semi_major_axis_m, orbit.mean_motion_rad_s)


def deputy_from_chief(seen: Vector, orbit: ChiefOrbit) -> Vector:
    """Return the deputy's RTN position at which, at rest, it sees the chief at `seen` (its own RTN axes), m.

    The chief stands on the circle, |d e_radial + seen| = R, which gives |d|; the components follow in turn.
    """
    R = orbit.semi_major_axis_m
    radial, along, normal = seen
    radius = np.sqrt(R * R - along * along - normal * normal) - radial
    X = radius * (radius + radial) / R
    in_plane = X / np.sqrt(1 - np.square(along / R))
    return X - R, -along * in_plane / R, -normal * radius * in_plane / (R * X)
