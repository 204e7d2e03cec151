"""Small turns of a line of sight across itself: two angles that are the same in every direction, with no pole.

A direction u, as a unit vector of component arrays, carries two axes across it: those that azimuth and elevation have
on the boresight (x), brought to u along the great circle. A direction that is off by the angles (a, b) lies
hypot(a, b) away from u on the great circle that leaves u along a e_a + b e_b. So a chart about u is drawn as azimuthal
equidistant maps are (Snyder 1987, chapter 25): distance and bearing from the centre are true everywhere, and what is
left of a difference across the line of sight points the right way up to 180 deg. On a sphere the axes can't be smooth
everywhere (the hairy ball); they turn quickly straight behind the boresight, which matters only to errors that tell
the two angles apart.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import Vector, dot

Axes = tuple[Vector, Vector]
_TINY = 1e-280


def unit(vector: Vector) -> Vector:
    """Return the direction of a vector; NaN where it has none."""
    length = np.sqrt(dot(vector, vector))
    return vector[0] / length, vector[1] / length, vector[2] / length


def across(direction: Vector) -> Axes:
    """Return the two axes across a direction (a unit vector): of azimuth and of elevation where it is the boresight.

    The turn from x to the direction takes y and -z there: e_a = y - y_u (x + u) / (1 + x_u), e_b alike.
    """
    x, y, z = direction
    behind = (x < 0) & (y * y + z * z < _TINY)
    if np.any(behind):  # every way round is as good; this one is about z
        y, z = np.where(behind, np.sqrt(_TINY), y), np.where(behind, 0.0, z)
    # 1 / (1 + x), without loss of digits where x is near -1.
    inverse = np.where(x < 0, (1 - x) / np.maximum(y * y + z * z, _TINY), 1 / (1 + np.abs(x)))
    yz = y * z * inverse
    return (-y, 1 - y * y * inverse, -yz), (z, yz, z * z * inverse - 1)


def deflected(direction: Vector, a: Array, b: Array) -> Vector:
    """Return the direction that lies (a, b), rad, from a direction (a unit vector)."""
    angle = np.hypot(a, b)
    along, ahead = np.sinc(angle / np.pi), np.cos(angle)
    first, second = across(direction)
    x, y, z = (ahead * u + along * (a * p + b * q) for u, p, q in zip(direction, first, second, strict=True))
    return x, y, z
