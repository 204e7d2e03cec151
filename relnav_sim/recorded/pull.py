"""Do recorded states move as the Earth pulls them? Wrong frames, units and single rows show where they do not.

From row to row, position and velocity change by the integrals of velocity and acceleration, here by the trapezoidal
rule with end correction: h/2 (f0 + f1) + h^2/12 (f0' - f1'), whose error is h^5/720 f'''' (Davis and Rabinowitz,
Methods of Numerical Integration, section 2.9). Nothing is differenced, so that noise in the rows counts little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.constants import MU_M3_S2, ROTATION_RAD_S

_LEAST_M, _MOST_M = 6.3e6, 1.5e9
"""Distances from the Earth's centre between which orbits about it are: its surface at the poles is at 6.357e6 m, and
the Sun takes over at 0.9e9 to 1.5e9 m."""
_ALONE_M = 2e8
"""Within this distance the Moon and the Sun change the Earth's pull by less than 0.5 %."""
_ARC_RAD = 0.2
"""Arc over which the change of velocity is compared, less where there is less: long, so that noise counts little."""
_SHARE = 0.01
"""Share by which it may differ: the Earth's flattening makes 0.003, a wrong frame in low orbit 0.1."""
_SHORT_RAD = 0.1
"""Shorter arcs may differ by more, in proportion, as noise of 1 m/s then counts."""
_MEDIANS = 30.0
_SMALLEST_M = 1.0
_CANCELLED = 0.3


@dataclass(frozen=True)
class Fault:
    """A row that can't be.

    Attributes:
        row: Its number.
        sentence: What is wrong.
    """

    row: int
    sentence: str


def misplaced(states: Array) -> Fault | None:
    """Return the first row (T, 6), m, that is inside the Earth or not near it; None: all are plausible."""
    radii = np.linalg.norm(states[:, :3], axis=1)
    wrong = np.flatnonzero(~((radii > _LEAST_M) & (radii < _MOST_M)))
    if not len(wrong):
        return None
    row = int(wrong[0])
    where = "inside the Earth" if radii[row] <= _LEAST_M else "beyond orbits about the Earth"
    return Fault(row, f"the position is {radii[row] / 1e3:.6g} km from the Earth's centre, {where}; check the units")


def unlike_the_earths(times_s: Array, states: Array, turning: bool) -> Fault | None:
    """Return that velocities do not change as the Earth's pull says; None: they do, or the Moon is too near to tell.

    Args:
        times_s: Times of the rows (T,), s.
        states: Positions and velocities (T, 6), m and m/s; velocities are the derivatives of the coordinates.
        turning: Whether their frame turns with the Earth.
    """
    radius = np.linalg.norm(states[:, :3], axis=1)
    if len(times_s) < 2 or radius.max() > _ALONE_M:
        return None
    pull = MU_M3_S2 / radius**2
    steps = np.diff(times_s)
    arc = np.append(0.0, np.cumsum(steps * np.sqrt(pull[1:] / radius[1:])))
    angle = min(_ARC_RAD, arc[-1])
    starts = np.flatnonzero(arc + angle <= arc[-1] * (1 + 1e-12))
    ends = np.minimum(np.searchsorted(arc, arc[starts] + angle * (1 - 1e-12)), len(arc) - 1)
    missed = np.concatenate([np.zeros((1, 3)), np.cumsum(_velocity_misses(steps, states, turning), axis=0)])
    pulled = np.append(0.0, np.cumsum(steps * (pull[1:] + pull[:-1]) / 2))
    share = np.median(np.linalg.norm(missed[ends] - missed[starts], axis=1) / (pulled[ends] - pulled[starts]))
    if not share > _SHARE * max(1.0, _SHORT_RAD / angle):
        return None
    return Fault(
        0,
        "the velocities do not change as the Earth's pull makes them, from which they differ by "
        f"{100 * share:.3g} % here and after; check the frame, the velocity frame and the units",
    )


def outlier(times_s: Array, states: Array, turning: bool) -> Fault | None:
    """Return the row that is farthest off where its neighbours lead, if by far more than rows are; None: none is.

    What one row is off makes two steps wrong, by as much to and fro. A jump, after which the orbit goes on, makes one.

    Args:
        times_s: As of `unlike_the_earths`.
        states: The same.
        turning: The same.
    """
    if len(times_s) < 5:
        return None
    steps = np.diff(times_s)
    acceleration = _accelerations(states, turning)
    position, velocity = states[:, :3], states[:, 3:]
    h = steps[:, None]
    step = h / 2 * (velocity[1:] + velocity[:-1]) + h**2 / 12 * (acceleration[:-1] - acceleration[1:])
    radius, speed = np.linalg.norm(position, axis=1), np.linalg.norm(velocity, axis=1)
    turn = np.maximum(*((speed / radius)[each] for each in (slice(1, None), slice(None, -1)))) * steps
    # What the rule leaves out, and the flattening of the Earth, of eccentric orbits with few rows: several times
    # angle^5 / 720 and 0.003 angle^3 / 12.
    left_out = (0.02 * turn**5 + 0.001 * turn**3) * radius[1:]
    found = [
        ("position", "m", np.diff(position, axis=0) - step, left_out, _SMALLEST_M),
        (
            "velocity",
            "m/s",
            _velocity_misses(steps, states, turning),
            left_out * turn / steps + 0.003 * turn * speed[1:],
            _SMALLEST_M / float(np.median(steps)),
        ),
    ]
    for what, unit, miss, allowed, least in found:
        size = np.linalg.norm(miss, axis=1)
        large = size - allowed > max(_MEDIANS * float(np.median(size)), least)
        before, after = miss[:-1], miss[1:]
        cancelled = np.linalg.norm(before + after, axis=1) < _CANCELLED * np.minimum(size[:-1], size[1:])
        rows = np.flatnonzero(large[:-1] & large[1:] & cancelled)
        if len(rows):
            worst = int(rows[np.argmax(size[rows])])
            return Fault(
                worst + 1,
                f"the {what} is {size[worst]:.3g} {unit} off where the rows before and after lead, which agree to "
                f"{float(np.median(size)):.1g} {unit}; leave the row out, or mend it",
            )
    return None


def _accelerations(states: Array, turning: bool) -> Array:
    """Return the second derivatives of the coordinates (T, 3), m/s^2, by the pull of the Earth."""
    position, velocity = states[:, :3], states[:, 3:]
    pull = -MU_M3_S2 * position / np.linalg.norm(position, axis=1, keepdims=True) ** 3
    rate = np.array([0.0, 0.0, ROTATION_RAD_S if turning else 0.0])
    return np.asarray(pull - 2 * np.cross(rate, velocity) - np.cross(rate, np.cross(rate, position)))


def _velocity_misses(steps_s: Array, states: Array, turning: bool) -> Array:
    """Return by how much each step of velocity (T - 1, 3) differs from that of the Earth's pull, m/s.

    In a frame that turns with the rate w, the derivative of v + 2 w x r is the pull less w x (w x r).
    """
    position, velocity = states[:, :3], states[:, 3:]
    rate = np.array([0.0, 0.0, ROTATION_RAD_S if turning else 0.0])
    r = np.linalg.norm(position, axis=1, keepdims=True)
    radial = (position * velocity).sum(axis=1, keepdims=True)
    drive = -MU_M3_S2 * position / r**3 - np.cross(rate, np.cross(rate, position))
    slope = -MU_M3_S2 * (velocity / r**3 - 3 * radial * position / r**5) - np.cross(rate, np.cross(rate, velocity))
    carried = velocity + 2 * np.cross(rate, position)
    h = steps_s[:, None]
    step = h / 2 * (drive[1:] + drive[:-1]) + h**2 / 12 * (slope[:-1] - slope[1:])
    return np.asarray(np.diff(carried, axis=0) - step)
