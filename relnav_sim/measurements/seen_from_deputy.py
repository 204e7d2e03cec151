"""Where the chief stands in the deputy's own orbit frame, as a function of the relative state.

The chief is taken on its nominal orbit, at the radius R, with the radial velocity R' and the angular rate n of the
moment. In the chief's RTN axes the deputy is at d = (R + x, y, z) and moves inertially with
w = (R' + vx - n y, vy + n (R + x), vz). The deputy's own RTN axes follow from d and h = d x w, so nothing is
approximated but the chief's orbit and the slow tilt of its plane. Wei, Song and Zhang (2012, eq. 4) leave out the
relative velocity, which tilts their frame by vz / (n R), 4e-5 rad at 0.3 m/s; at rest about a chief on a circular orbit
the formulas agree with theirs once the misprints there are corrected.
"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import Vector
from relnav_sim.astro.nominal_motion import ChiefMotion


def chief_from_deputy(states: Array, chief: ChiefMotion) -> Array:
    """Return the chief's position relative to the deputy in the deputy's RTN axes, (points, 3) m.

    Args:
        states: (points, n >= 6), in C order, the deputy's RTN position (m) and velocity (m/s) relative to the chief.
        chief: The chief's motion.
    """
    return kernels.deputy.chief_seen(states, *chief)


def chief_from_deputy_with_jacobian(states: Array, chief: ChiefMotion) -> tuple[Array, Array]:
    """Return `chief_from_deputy` and its derivatives with respect to the first six states, (points, 3, 6)."""
    return kernels.deputy.chief_seen_with_jacobian(states, *chief)


def deputy_from_chief(seen: Vector, chief: ChiefMotion) -> Array:
    """Return the deputy's RTN position at which, at rest, it sees the chief at `seen` (its own RTN axes), (..., 3) m.

    The chief stands at its distance from the centre, |d e_radial + seen| = R, which gives |d|; the components follow in
    turn where R' = 0. A climb tilts the deputy's orbit plane by R' z / (n R^2) or so, which Newton's method adds.
    """
    R = chief.R
    radial, along, normal = seen
    radius = np.sqrt(R * R - along * along - normal * normal) - radial
    X = radius * (radius + radial) / R
    in_plane = X / np.sqrt(1 - np.square(along / R))
    position = np.stack([X - R, -along * in_plane / R, -normal * radius * in_plane / (R * X)], axis=-1)
    if chief.climb == 0:
        return position
    states = np.zeros((position[..., 0].size, 6))
    states[:, :3] = position.reshape(-1, 3)
    wanted = np.stack(seen, axis=-1).reshape(-1, 3)
    for _ in range(_NEWTON_STEPS):
        found, by_state = chief_from_deputy_with_jacobian(states, chief)
        states[:, :3] += np.linalg.solve(by_state[:, :, :3], (wanted - found)[:, :, None])[:, :, 0]
    return states[:, :3].reshape(position.shape)


_NEWTON_STEPS = 2
"""From a tilt of 1e-3 rad or less, the first leaves a millionth of that, the second rounding errors."""
