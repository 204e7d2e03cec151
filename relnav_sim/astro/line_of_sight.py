"""Frames and angles of a radar measurement, with three-vectors as a tuple of component arrays.

Frames: the orbit frame RTN (x radial out, y along-track, z orbit normal); the LVLH frame (x along-track, y minus
orbit normal, z nadir), in which a body that points at the Earth stands still; the radar frame, mounted in that body.
One component per array lets a mounting by right angles cost nothing and keeps a run's bits free of the block's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

import numpy as np

from relnav_sim.arrays import Array

Vector = tuple[Array, Array, Array]
ARCSEC = np.pi / (180 * 3600)
"""One second of arc, rad."""
Rows = tuple[tuple[tuple[int, float], ...], ...]
"""A constant matrix as the (column, weight) pairs of each row."""

NADIR_FROM_RTN: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""Rotation from RTN to the LVLH frame."""


def components(vectors: Array) -> Vector:
    """Return the first three components of (..., 3 or more) as views."""
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def dot(a: Sequence[Array], b: Sequence[Array]) -> Array:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def rows(matrix: Array) -> Rows:
    """Return a matrix in the form that `times` takes: the non-zero entries of each row."""
    return tuple(tuple((column, float(weight)) for column, weight in enumerate(row) if weight != 0) for row in matrix)


def times(matrix: Rows, terms: Sequence[Array]) -> list[Array]:
    """Return a matrix times the component arrays, free of multiplications by zero and one."""
    return [_weighted_sum(row, terms) for row in matrix]


def rotate(rotation: Rows, vector: Vector) -> Vector:
    """Return a rotation times a vector."""
    x, y, z = times(rotation, vector)
    return x, y, z


def _weighted_sum(row: tuple[tuple[int, float], ...], terms: Sequence[Array]) -> Array:
    total: Array | None = None
    for column, weight in row:
        term = terms[column]
        if weight == -1.0:
            total = -term if total is None else total - term
            continue
        product = term if weight == 1.0 else weight * term
        total = product if total is None else total + product
    return np.zeros_like(terms[0]) if total is None else total


def mounting_matrix(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Array:
    """Return the rotation (3, 3) from the body's LVLH frame to the radar frame.

    The radar frame is the body frame turned about its z axis by the yaw, about the new y axis by the pitch and
    about the new x axis by the roll, each right-handed. Multiples of 90 deg give exact zeros and ones.
    """
    (cy, sy), (cp, sp), (cr, sr) = (_cosine_sine(angle) for angle in (yaw_deg, pitch_deg, roll_deg))
    about_z = np.array([[cy, sy, 0.0], [-sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, sr], [0.0, -sr, cr]])
    return about_x @ about_y @ about_z


def _cosine_sine(angle_deg: float) -> tuple[float, float]:
    quarters, rest = divmod(angle_deg, 90)
    if rest == 0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return cos(radians(angle_deg)), sin(radians(angle_deg))


def spherical_of(sight: Vector) -> Vector:
    """Return range, azimuth and elevation of a line of sight in the radar frame (Shi et al. 2025, fig. 1).

    Azimuth is positive from x towards y, in [-pi, pi]; elevation is positive towards minus z, in [-pi/2, pi/2].
    """
    x, y, z = sight
    level = np.asarray(x * x)
    level += y * y
    distance = np.asarray(z * z)
    distance += level
    # Square roots and the elevation in place: a pass over fresh memory costs as much as the arithmetic.
    np.sqrt(distance, out=distance)
    np.sqrt(level, out=level)
    return distance, np.arctan2(y, x), np.arctan2(-z, level, out=level)


def sight_vector(distance: Array, azimuth: Array, elevation: Array) -> Vector:
    """Return the line of sight in the radar frame; the inverse of `spherical_of` (Shi et al. 2025, eq. 33)."""
    level = distance * np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), -distance * np.sin(elevation)


def half_open(angle: Array) -> Array:
    """Return an angle in (-pi, pi], rad; values already inside keep every bit."""
    return angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi))


def cross_matrix(vector: Array) -> Array:
    """Return [v x] (3, 3) of a vector (3,)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
