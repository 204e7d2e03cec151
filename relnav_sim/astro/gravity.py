"""Gravity as a filter believes in it: a point mass, with or without zonal harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit


@dataclass(frozen=True)
class Gravity:
    """A point mass with zonal harmonics about the frame's z axis.

    Args:
        mu_m3_s2: Gravitational parameter, m^3/s^2.
        equatorial_radius_m: Radius that the harmonics refer to, m.
        j2: Zonal harmonic, unnormalised; 0, and so the next, for a point mass, in any axes.
        j3: The next.
        j4: The one after.
    """

    mu_m3_s2: float
    equatorial_radius_m: float = 0.0
    j2: float = 0.0
    j3: float = 0.0
    j4: float = 0.0

    @classmethod
    def of(cls, orbit: ChiefOrbit) -> Gravity:
        """Return the gravity of the body that a chief goes round."""
        return cls(orbit.mu_m3_s2, orbit.equatorial_radius_m, orbit.j2, orbit.j3, orbit.j4)

    @cached_property
    def field(self) -> Array:
        """The constants in one array, (5,), as `relnav_sim.kernels.relative_gravity` has them."""
        return np.array([self.mu_m3_s2, self.equatorial_radius_m, self.j2, self.j3, self.j4])

    @property
    def is_central(self) -> bool:
        """Whether there is nothing but a point mass."""
        return not (self.j2 or self.j3 or self.j4)

    def potential(self, position: Array) -> float:
        """Return the potential at a position (3,), m^2/s^2: positive, and falling outwards."""
        r = float(np.linalg.norm(position))
        s, ratio = float(position[2]) / r, self.equatorial_radius_m / r
        legendre = ((3 * s**2 - 1) / 2, (5 * s**3 - 3 * s) / 2, (35 * s**4 - 30 * s**2 + 3) / 8)
        zonal = sum(j * ratio**n * p for n, (j, p) in enumerate(zip(self.field[2:], legendre, strict=True), start=2))
        return self.mu_m3_s2 / r * (1 - float(zonal))

    def acceleration(self, positions: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""
        points = np.ascontiguousarray(positions, dtype=np.float64).reshape(-1, 3)
        pull = kernels.gravity.acceleration(points, self.mu_m3_s2, self.equatorial_radius_m, self.field[2:])
        return pull.reshape(positions.shape)
