"""Orbit frames and attitude quaternions, with three-vectors as a tuple of component arrays.

A quaternion (x, y, z, w) stands for the rotation from ECI to body components, v_body = C(q) v_eci with
C(q) = (w^2 - |e|^2) I + 2 e e^T - 2 w [e x], e = (x, y, z) (Markley and Crassidis, Fundamentals of Spacecraft
Attitude Determination and Control, 2014, eq. 2.125).
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import Vector, components, cross, dot

Axes = tuple[Vector, Vector, Vector]
Quaternion = tuple[Array, Array, Array, Array]


def nadir_axes(states: Array) -> Axes:
    """Return the LVLH frame's axes in ECI from position and velocity (..., 6): along-track, minus normal, nadir."""
    position, velocity = components(states), components(states[..., 3:])
    momentum = cross(position, velocity)
    nadir = _scaled(position, -1 / np.sqrt(dot(position, position)))
    minus_normal = _scaled(momentum, -1 / np.sqrt(dot(momentum, momentum)))
    return cross(minus_normal, nadir), minus_normal, nadir


def _scaled(vector: Vector, factor: Array) -> Vector:
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


def in_axes(axes: Axes, vector: Vector) -> Vector:
    """Return the components along the axes of a vector given in the axes' own frame of reference."""
    return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector)


def from_axes(axes: Axes, vector: Vector) -> Vector:
    """Return the vector whose components along the axes are given; the inverse of `in_axes`."""
    (a, b, c), (x, y, z) = axes, vector
    return x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2]


def quaternion_from_axes(axes: Axes) -> Quaternion:
    """Return the attitude of a body with these axes (rows of C), w >= 0.

    Shepperd, J. Guidance and Control 1(3), 1978: 4 q q^T is linear in C; the column of the largest component
    loses no digits.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = axes
    products = np.array(
        [
            [1 + xx - yy - zz, xy + yx, xz + zx, yz - zy],
            [xy + yx, 1 - xx + yy - zz, yz + zy, zx - xz],
            [xz + zx, yz + zy, 1 - xx - yy + zz, xy - yx],
            [yz - zy, zx - xz, xy - yx, 1 + xx + yy + zz],
        ]
    )
    largest = np.argmax(np.stack([products[i, i] for i in range(4)]), axis=0)
    x, y, z, w = np.take_along_axis(products, largest[None, None], axis=0)[0]
    scale = np.copysign(1 / np.sqrt(x * x + y * y + z * z + w * w), w)
    return x * scale, y * scale, z * scale, w * scale
