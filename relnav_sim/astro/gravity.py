"""Gravity as a filter believes in it: a point mass, with or without zonal harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit


@dataclass(frozen=True)
class Gravity:
    """A point mass with zonal harmonics about the frame's z axis.

    Arrays hold components second: (s, 3, ...), s nodes of a step.

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
        return not (self.j2 or self._has_higher)

    @property
    def _has_higher(self) -> bool:
        return bool(self.j3 or self.j4)

    def acceleration(self, position: Array) -> Array:
        """Return the acceleration at `position` (s, 3, ...), m/s^2."""
        r2 = squared(position)
        central = -self.mu_m3_s2 / (r2 * np.sqrt(r2))
        pull = central[:, None] * position
        return pull if self.is_central else pull + self._oblate(position, r2)

    def _oblate(self, position: Array, r2: Array) -> Array:
        """Return the harmonics' acceleration, J2's being -K / r^5 [(1 - 5 s^2) r + 2 z p] (Vallado, ch. 8)."""
        z = position[:, 2]
        inverse = 1 / r2
        factor = -1.5 * self.j2 * self.mu_m3_s2 * self.equatorial_radius_m**2 * inverse * inverse / np.sqrt(r2)
        along, axial = factor * (1 - 5 * z * z * inverse), 2 * factor * z
        if self._has_higher:
            central, s, third, fourth = self._higher(z, inverse)
            slope = 2.5 * s * (7 * s * s - 3)
            along = along + central * (third * slope + fourth * _fifth_slope(s))
            axial = axial - central / np.sqrt(inverse) * (third * (7.5 * s * s - 1.5) + fourth * slope)
        bulge = along[:, None] * position
        bulge[:, 2] += axial
        return bulge

    def _higher(self, z: Array, inverse: Array) -> tuple[Array, Array, Array, Array]:
        """Return mu / r^3, s = z / r, J3 (R/r)^3 and J4 (R/r)^4, from z and 1 / r^2.

        With the Legendre polynomials P_n(s), the harmonic J_n adds, from (n + 1) P_n + s P_n' = P_(n+1)',
        mu / r^3 J_n (R/r)^n [P_(n+1)' r - r P_n' p] to the acceleration.
        """
        nearness = np.sqrt(inverse)
        q = self.equatorial_radius_m * nearness
        third = q * q * q
        return self.mu_m3_s2 * inverse * nearness, z * nearness, self.j3 * third, self.j4 * q * third


def _fifth_slope(s: Array) -> Array:
    """Return P_5'(s)."""
    t = s * s
    slope: Array = 1.875 * ((21 * t - 14) * t + 1)
    return slope


def squared(vectors: Array) -> Array:
    """Return the squared lengths (s, ...) of vectors (s, 3, ...)."""
    return _dot(vectors, vectors)


def _dot(a: Array, b: Array) -> Array:
    products = a * b
    total: Array = products[:, 0] + products[:, 1] + products[:, 2]
    return total
