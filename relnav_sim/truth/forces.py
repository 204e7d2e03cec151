"""What pulls a spacecraft: a point mass, zonal harmonics, and drag in a co-rotating exponential atmosphere."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.constants import J2, J3, J4, ROTATION_RAD_S
from relnav_sim.astro.frames import PARALLEL


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
        components = np.ascontiguousarray(np.broadcast_to(states, (*leading, 6)).reshape(-1, 6).T)
        acceleration = np.empty((3, components.shape[1]))
        self.accelerate(components, np.broadcast_to(ballistic, leading).ravel(), acceleration)
        return np.ascontiguousarray(acceleration.T).reshape(*leading, 3)

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

    def accelerate(self, components: Array, ballistic_m2_kg: Array, out: Array) -> None:
        """Write the acceleration of the states `components` (6, n) into `out` (3, n); ballistic (n,).

        Components come first and every operation is elementwise, so that a state's bits do not depend on the
        other states in the array.
        """
        x, y, z, vx, vy, vz = components
        r2 = x * x + y * y + z * z
        r = np.sqrt(r2)
        inverse_r2 = 1 / r2
        pull = (-self.mu_m3_s2 * inverse_r2) / r
        if self.zonals:
            radial, axial = self._zonal_sums(z, inverse_r2)
            central = pull * (1 - radial)
            np.multiply(central, x, out=out[0])
            np.multiply(central, y, out=out[1])
            np.add(central * z, (self.radius_m * pull) * axial, out=out[2])
        else:
            np.multiply(components[:3], pull, out=out)
        if self.atmosphere is not None:
            ux, uy = vx + self.rotation_rad_s * y, vy - self.rotation_rad_s * x
            speed = np.sqrt(ux * ux + uy * uy + vz * vz)
            density = self.atmosphere.density(r - self.radius_m)
            drag = (-0.5 * ballistic_m2_kg) * density * speed
            out[0] += drag * ux
            out[1] += drag * uy
            out[2] += drag * vz

    def _zonal_sums(self, z: Array, inverse_r2: Array) -> tuple[Array, Array]:
        """Return sum J_n W_{n+1} and sum J_n W_n, where W_n = (R/r)^(n-1) P_n'(z/r).

        The gradient of the potential mu/r (1 - sum J_n (R/r)^n P_n(s)), s = z/r (Vallado, 4th ed., section 8.6),
        collected along the radius and the axis with (n+1) P_n + s P_n' = P_{n+1}', is
        -(mu/r^3) [r (1 - sum J_n W_{n+1}) + R e_z sum J_n W_n].
        W follows from n P_{n+1}' = (2n+1) s P_n' - (n+1) P_{n-1}'.
        """
        p = (self.radius_m * z) * inverse_r2
        q2 = (self.radius_m * self.radius_m) * inverse_r2
        before, current = np.ones(()), 3 * p
        for n, j in enumerate(self.zonals, start=2):
            after = ((2 * n + 1) / n * p) * current - ((n + 1) / n * q2) * before
            if n == 2:
                radial, axial = j * after, j * current
            else:
                radial, axial = radial + j * after, axial + j * current
            before, current = current, after
        return radial, axial


def _require_positive(model: object, *names: str) -> None:
    for name in names:
        value = getattr(model, name)
        if not (isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; it must be a positive number")
