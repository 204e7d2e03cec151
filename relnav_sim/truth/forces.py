"""What pulls a spacecraft: a point mass, zonal harmonics, and drag in a co-rotating exponential atmosphere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.constants import J2, J3, J4, ROTATION_RAD_S
from relnav_sim.astro.frames import PARALLEL

if TYPE_CHECKING:
    from relnav_sim.kernels.forces import Forces


@dataclass(frozen=True)
class ExponentialAtmosphere:
    """Density rho = density exp(-(altitude - base altitude) / scale height); altitude is |r| minus the radius.

    Args:
        base_altitude_m: Altitude at which the density is given, m.
        density_kg_m3: Density there, kg/m^3.
        scale_height_m: Altitude over which the density falls by the factor e, m.

    Raises:
        ValueError: A density or scale height that is not positive, or a value that is not finite.
    """

    base_altitude_m: float
    density_kg_m3: float
    scale_height_m: float

    def __post_init__(self) -> None:
        if not isfinite(self.base_altitude_m):
            raise ValueError(f"base_altitude_m is {self.base_altitude_m}; it must be a finite number")
        _require_positive(self, "density_kg_m3", "scale_height_m")

    def density(self, altitude_m: Array) -> Array:
        """Return the density in kg/m^3 at altitudes in m, any shape."""
        density: Array = self.density_kg_m3 * np.exp((self.base_altitude_m - altitude_m) / self.scale_height_m)
        return density


@dataclass(frozen=True)
class ForceModel:
    """The acceleration of a spacecraft in ECI.

    Args:
        mu_m3_s2: Gravitational parameter, m^3/s^2.
        radius_m: Equatorial radius, m; the zonal harmonics and the altitude refer to it.
        zonals: Unnormalised J2, J3, J4, ...; any number of them from J2 on, () for a point mass.
        atmosphere: None for no drag.
        rotation_rad_s: The body's rotation rate about ECI z, rad/s; the atmosphere turns with it.

    Raises:
        ValueError: A gravitational parameter or radius that is not positive, or a value that is not finite.
    """

    mu_m3_s2: float
    radius_m: float
    zonals: tuple[float, ...] = (J2, J3, J4)
    atmosphere: ExponentialAtmosphere | None = None
    rotation_rad_s: float = ROTATION_RAD_S

    def __post_init__(self) -> None:
        object.__setattr__(self, "zonals", tuple(float(j) for j in self.zonals))
        _require_positive(self, "mu_m3_s2", "radius_m")
        if not all(map(isfinite, (*self.zonals, self.rotation_rad_s))):
            raise ValueError("zonals and rotation_rad_s must be finite numbers")

    def acceleration(self, states: ArrayLike, ballistic_m2_kg: ArrayLike = 0.0) -> Array:
        """Return the acceleration (..., 3) in m/s^2, ECI.

        Args:
            states: Position and velocity (..., 6) in m and m/s, ECI.
            ballistic_m2_kg: Cd A / m in m^2/kg, broadcast against the leading axes of `states`.
        """
        states, ballistic = np.asarray(states, dtype=float), np.asarray(ballistic_m2_kg, dtype=float)
        leading = np.broadcast_shapes(states.shape[:-1], ballistic.shape)
        flat = np.ascontiguousarray(np.broadcast_to(states, (*leading, 6))).reshape(-1, 6)
        of_each = np.ascontiguousarray(np.broadcast_to(ballistic, leading)).ravel()
        return kernels.forces.acceleration(self.compiled, flat, of_each).reshape(*leading, 3)

    def normal_acceleration(self, states: ArrayLike, ballistic_m2_kg: ArrayLike = 0.0) -> Array:
        """Return the acceleration along the orbit normal r x v, (...) in m/s^2: what turns the orbit plane.

        Args:
            states: Position and velocity (..., 6) in m and m/s, ECI.
            ballistic_m2_kg: Cd A / m in m^2/kg, broadcast against the leading axes of `states`.

        Raises:
            ValueError: A position and velocity are parallel, so that they span no orbit plane.
        """
        states = np.asarray(states, dtype=float)
        x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
        nx, ny, nz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
        h = np.sqrt(nx * nx + ny * ny + nz * nz)
        if np.any(h <= PARALLEL * np.sqrt((x * x + y * y + z * z) * (vx * vx + vy * vy + vz * vz))):
            raise ValueError("position and velocity are parallel: they span no orbit plane")
        ax, ay, az = np.moveaxis(self.acceleration(states, ballistic_m2_kg), -1, 0)
        normal: Array = (ax * nx + ay * ny + az * nz) / h
        return normal

    @cached_property
    def compiled(self) -> Forces:
        """The same as the kernels take it."""
        air = self.atmosphere or ExponentialAtmosphere(0.0, 1.0, 1.0)
        return kernels.forces.Forces(
            float(self.mu_m3_s2),
            float(self.radius_m),
            np.array(self.zonals, dtype=float),
            float(air.density_kg_m3) if self.atmosphere else 0.0,
            float(air.base_altitude_m),
            float(air.scale_height_m),
            float(self.rotation_rad_s),
        )


def _require_positive(model: object, *names: str) -> None:
    for name in names:
        value = getattr(model, name)
        if not (isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; it must be a positive number")
