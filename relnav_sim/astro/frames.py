"""The chief's orbit frame: relative states in RTN from inertial ones and back.

RTN (Hill): x radial out, y along-track, z along the orbit normal r x v. Relative velocity is the time derivative of
the RTN components, so the frame's own rotation counts. Its rate is (|r| a_N / h, 0, h / |r|^2): besides the motion
along the orbit, the acceleration a_N along the normal tilts the orbit plane about the radius.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array

# Below this sine of the angle between position and velocity, rounding (about 1e-16) decides where the normal points.
PARALLEL = 1e-12


def rtn_from_eci(chief: ArrayLike, deputy: ArrayLike, normal_acceleration_m_s2: ArrayLike = 0.0) -> Array:
    """Return the deputy's state relative to the chief, (..., 6) in m and m/s, RTN.

    Casotto, Celestial Mechanics and Dynamical Astronomy 124, 2016: the frame's rate includes the tilt of the orbit
    plane.

    Args:
        chief: The chief's position and velocity (..., 6) in m and m/s, ECI.
        deputy: The deputy's, (..., 6); the leading axes broadcast.
        normal_acceleration_m_s2: The chief's acceleration along its orbit normal, broadcast against the leading
            axes; `ForceModel.normal_acceleration` gives it, 0 is right for a point mass.

    Raises:
        ValueError: The chief's position and velocity are parallel, so that they span no orbit plane.

    Examples:
        >>> from relnav_sim import rtn_from_eci
        >>> chief, deputy = [7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0], [7e6, -2000.0, 0.0, 0.0, 7.5e3, 0.0]
        >>> rtn_from_eci(chief, deputy).round(3).tolist()  # the same inertial velocity is not rest in the turning frame
        [0.0, -2000.0, 0.0, -2.143, 0.0, 0.0]
    """
    c, d, a_n = _components(chief, deputy, normal_acceleration_m_s2)
    axes, rate_r, rate_n = _frame(c, a_n)
    difference = d - c
    x, y, z = (_dot(axis, difference[:3]) for axis in axes)
    vx, vy, vz = (_dot(axis, difference[3:]) for axis in axes)
    relative = [x, y, z, vx + rate_n * y, vy - rate_n * x + rate_r * z, vz - rate_r * y]
    return np.stack(relative, axis=-1)


def eci_from_rtn(chief: ArrayLike, relative: ArrayLike, normal_acceleration_m_s2: ArrayLike = 0.0) -> Array:
    """Return the deputy's state (..., 6) in m and m/s, ECI: the inverse of `rtn_from_eci`.

    Args:
        chief: The chief's position and velocity (..., 6) in m and m/s, ECI.
        relative: The deputy's state relative to it (..., 6), RTN; the leading axes broadcast.
        normal_acceleration_m_s2: The chief's acceleration along its orbit normal, as in `rtn_from_eci`.

    Raises:
        ValueError: The chief's position and velocity are parallel, so that they span no orbit plane.

    Examples:
        >>> from relnav_sim import eci_from_rtn
        >>> chief = [7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0]
        >>> eci_from_rtn(chief, [0.0, -2000.0, 0.0, 0.0, 0.0, 0.0])[:3].tolist()  # 2 km behind
        [7000000.0, -2000.0, 0.0]
    """
    c, relative_components, a_n = _components(chief, relative, normal_acceleration_m_s2)
    axes, rate_r, rate_n = _frame(c, a_n)
    x, y, z, vx, vy, vz = relative_components
    velocity = (vx - rate_n * y, vy + rate_n * x - rate_r * z, vz + rate_r * y)
    deputy = np.empty(c.shape)
    for i in range(3):
        deputy[i] = c[i] + (axes[0][i] * x + axes[1][i] * y + axes[2][i] * z)
        deputy[i + 3] = c[i + 3] + (axes[0][i] * velocity[0] + axes[1][i] * velocity[1] + axes[2][i] * velocity[2])
    return np.ascontiguousarray(np.moveaxis(deputy, 0, -1))


def inertial_from_own(states: Array, vectors: Array) -> Array:
    """Return vectors (3, n), given in the RTN axes of the states' own orbits (6, n), in ECI; components first."""
    position, velocity = states[:3], states[3:]
    normal = _cross(position, velocity)
    along = _cross(normal, position)
    radial, along, normal = (axis / np.sqrt(_dot(axis, axis)) for axis in (position, along, normal))
    return vectors[0] * radial + vectors[1] * along + vectors[2] * normal


def own_from_inertial(states: Array, vectors: Array) -> Array:
    """Return ECI vectors (..., 3) in the RTN axes of the states' own orbits (..., 6)."""
    c = np.moveaxis(states, -1, 0)
    axes, _, _ = _frame(c, np.zeros(c.shape[1:]))
    return np.stack([_dot(axis, np.moveaxis(vectors, -1, 0)) for axis in axes], axis=-1)


def shi2025_from_rtn(states: ArrayLike) -> Array:
    """Return states (..., 6) in the axes of Shi et al. (2025): x along-track, y minus the orbit normal, z nadir."""
    x, y, z, vx, vy, vz = np.moveaxis(np.asarray(states, dtype=float), -1, 0)
    return np.stack([y, -z, -x, vy, -vz, -vx], axis=-1)


def rtn_from_shi2025(states: ArrayLike) -> Array:
    """Return states (..., 6) in RTN from the axes of Shi et al. (2025), the inverse of `shi2025_from_rtn`."""
    x, y, z, vx, vy, vz = np.moveaxis(np.asarray(states, dtype=float), -1, 0)
    return np.stack([-z, x, -y, -vz, vx, -vy], axis=-1)


def _components(chief: ArrayLike, other: ArrayLike, a_n: ArrayLike) -> tuple[Array, Array, Array]:
    """Return both states components first (6, ...) and the normal acceleration (...), broadcast together."""
    chief, other = np.asarray(chief, dtype=float), np.asarray(other, dtype=float)
    for name, states in (("the chief", chief), ("the other", other)):
        if states.ndim == 0 or states.shape[-1] != 6:
            raise ValueError(f"{name} state has shape {states.shape}; it must be (..., 6)")
    a_n = np.asarray(a_n, dtype=float)
    shape = np.broadcast_shapes(chief.shape[:-1], other.shape[:-1], a_n.shape)
    first, second = (
        np.ascontiguousarray(np.moveaxis(np.broadcast_to(states, (*shape, 6)), -1, 0)) for states in (chief, other)
    )
    return first, second, np.broadcast_to(a_n, shape)


def _frame(chief: Array, a_n: Array) -> tuple[tuple[Array, Array, Array], Array, Array]:
    """Return the unit vectors (R, T, N), each (3, ...), and the frame's rate about R and N in rad/s."""
    position, velocity = chief[:3], chief[3:]
    momentum = _cross(position, velocity)
    r = np.sqrt(_dot(position, position))
    h = np.sqrt(_dot(momentum, momentum))
    if np.any(h <= PARALLEL * r * np.sqrt(_dot(velocity, velocity))):
        raise ValueError("the chief's position and velocity are parallel: they span no orbit plane")
    radial, normal = position / r, momentum / h
    return (radial, _cross(normal, radial), normal), r * a_n / h, h / (r * r)


def _dot(a: Array, b: Array) -> Array:
    product: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
