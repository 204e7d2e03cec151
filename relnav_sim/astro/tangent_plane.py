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
from relnav_sim.astro.line_of_sight import Vector, cross, dot

Axes = tuple[Vector, Vector]
_TINY = 1e-280
_BESIDE = 1e-12
"""What stands straight behind the centre is moved this far, in units of its distance, to have a bearing."""


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


def deflection(centre: Vector, sight: Vector) -> tuple[Array, Array]:
    """Return how far (a, b), rad, a line of sight of any length lies from a direction (a unit vector)."""
    a, b, ahead = _seen_from(centre, across(centre), sight)
    angle = _angle_over_sine(np.hypot(a, b), ahead)
    return angle * a, angle * b


def deflection_gradients(centre: Vector, sight: Vector) -> tuple[Vector, Vector]:
    """Return the gradients of `deflection` by the line of sight.

    With s = hypot(a, b), c = ahead and the bearing p = (a, b) / s, d(theta p) = p (c p . da - s dc) / r^2
    + (theta / s) (da - p p . da).
    """
    axes = across(centre)
    a, b, ahead = _seen_from(centre, axes, sight)
    aside = np.hypot(a, b)
    squared = aside * aside + ahead * ahead
    aside_or_one = np.where(aside > 0, aside, 1.0)
    bearing = a / aside_or_one, b / aside_or_one
    stretch = _angle_over_sine(aside, ahead)
    excess, back = ahead / squared - stretch, aside / squared

    def gradient(own: int) -> Vector:
        other = 1 - own
        by_own = stretch + excess * bearing[own] * bearing[own]
        by_other = excess * bearing[own] * bearing[other]
        by_ahead = back * bearing[own]
        x, y, z = (by_own * axes[own][i] + by_other * axes[other][i] - by_ahead * centre[i] for i in range(3))
        return x, y, z

    return gradient(0), gradient(1)


def deflection_by_turn(centre: Vector) -> tuple[Vector, Vector]:
    """Return what a small turn dtheta of the sensor, which takes u to u + u x dtheta, does to readings at a direction.

    (e_a x u) . dtheta and (e_b x u) . dtheta.
    """
    first, second = across(centre)
    return cross(first, centre), cross(second, centre)


def _seen_from(centre: Vector, axes: Axes, sight: Vector) -> Vector:
    """Return the components of a line of sight along both axes and ahead; one straight behind gets a bearing."""
    a, b, ahead = dot(axes[0], sight), dot(axes[1], sight), dot(centre, sight)
    behind = (a == 0) & (b == 0) & (ahead < 0)
    if np.any(behind):
        a = np.where(behind, -_BESIDE * ahead, a)
    return a, b, ahead


def _angle_over_sine(aside: Array, ahead: Array) -> Array:
    """Return atan2(aside, ahead) / aside, which is 1 / ahead where aside is 0."""
    straight = aside == 0
    return np.where(
        straight, 1 / np.where(straight, ahead, 1.0), np.arctan2(aside, ahead) / np.where(straight, 1.0, aside)
    )
