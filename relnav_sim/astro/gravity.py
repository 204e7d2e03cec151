"""Gravity as a filter believes in it: a point mass, with or without zonal harmonics, and its difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit


@dataclass(frozen=True)
class Anchor:
    """What a difference of gravity takes of the chief's positions, (..., s, 3, b).

    Attributes:
        position: The positions, m.
        r2: Their squared lengths, (..., s, b), m^2.
        pull: mu / r^3, (..., s, b), 1/s^2.
        bulge: The zonal harmonics' acceleration, m/s^2, shaped as the positions; None for a point mass.
    """

    position: Array
    r2: Array
    pull: Array
    bulge: Array | None

    def __getitem__(self, place: int) -> Anchor:
        """Return the positions at a place of the leading axis."""
        bulge = None if self.bulge is None else self.bulge[place]
        return Anchor(self.position[place], self.r2[place], self.pull[place], bulge)

    def for_columns(self) -> Anchor:
        """Return the same with an axis before the last, for several offsets from each position."""
        bulge = None if self.bulge is None else self.bulge[..., None, :]
        return Anchor(self.position[..., None, :], self.r2[..., None, :], self.pull[..., None, :], bulge)


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

    def anchor(self, chief: Array) -> Anchor:
        """Return what `difference` takes of the chief's positions, (..., s, 3, b), m."""
        positions = chief.reshape(-1, *chief.shape[-2:])
        r2 = squared(positions)
        pull = self.mu_m3_s2 / (r2 * np.sqrt(r2))
        bulge = None if self.is_central else self._oblate(positions, r2).reshape(chief.shape)
        shape = (*chief.shape[:-2], chief.shape[-1])
        return Anchor(chief, r2.reshape(shape), pull.reshape(shape), bulge)

    def difference(self, chief: Anchor, offset: Array) -> Array:
        """Return the acceleration at chief + offset less that at the chief, without loss of digits at small offsets.

        Battin, An Introduction to the Mathematics and Methods of Astrodynamics, 1999, on Encke's method: with
        1 + q = |chief + offset|^2 / |chief|^2 and g = 1 - (1 + q)^(-3/2) it is mu / |chief|^3 (g chief - (1 - g)
        offset), and both q and g can be written without a difference of near numbers. The harmonics' parts, a thousand
        times smaller, are simply subtracted.

        Args:
            chief: The chief, from `anchor`.
            offset: Position relative to it, (s, 3, ...), m; the axes broadcast.
        """
        r2, k = chief.r2, chief.pull
        q = _dot(2 * chief.position + offset, offset) / r2
        u = 1 + q
        cubed = u * np.sqrt(u)
        g = q * (3 + q * (3 + q)) / (cubed * (1 + cubed))
        pull = (k * g)[:, None] * chief.position - (k * (1 - g))[:, None] * offset
        if chief.bulge is None:
            return pull
        return pull + (self._oblate(chief.position + offset, r2 * u) - chief.bulge)

    def gradient(self, position: Array) -> Array:
        """Return the derivatives of the acceleration, (3, 3, s, ...), 1/s^2, at `position` (s, 3, ...).

        It is d I + o r r^T + c (r p^T + p r^T) - a p p^T with the polar axis p and scalars d, o, c and a of the
        position: `diagonal`, `outer`, `polar` and `axial` below.
        """
        components = position.swapaxes(0, 1)
        r2 = squared(position)
        inverse = 1 / r2
        central = self.mu_m3_s2 * inverse / np.sqrt(r2)
        diagonal, outer = -central, 3 * central * inverse
        if not self.is_central:
            factor = 1.5 * self.j2 * self.equatorial_radius_m**2 * central * inverse
            s2 = np.square(components[2]) * inverse
            # -factor [(1 - 5 s^2) I + 2 p p^T - 10 z / r^2 (r p^T + p r^T) + (35 s^2 - 5) r r^T / r^2], s = z / r
            diagonal = diagonal - factor * (1 - 5 * s2)
            outer = outer - factor * inverse * (35 * s2 - 5)
            polar = 10 * factor * inverse * components[2]
            axial = 2 * factor
            if self._has_higher:
                central, s, third, fourth = self._higher(components[2], inverse)
                t = s * s
                curved, bent = 7.5 * (7 * t - 1), 52.5 * s * (3 * t - 1)  # P_4'' and P_5''
                sixth = 13.125 * ((33 * t - 18) * t + 1)
                diagonal = diagonal + central * (third * 2.5 * s * (7 * t - 3) + fourth * _fifth_slope(s))
                outer = outer - central * inverse * (third * bent + fourth * sixth)
                polar = polar + central * np.sqrt(inverse) * (third * curved + fourth * bent)
                axial = axial + central * (third * 15 * s + fourth * curved)
        G: Array = (outer * components)[:, None] * components
        for i in range(3):
            G[i, i] += diagonal
        if not self.is_central:
            G[:2, 2] += polar * components[:2]
            G[2, 2] += 2 * polar * components[2] - axial
        G[1, 0], G[2, 0], G[2, 1] = G[0, 1], G[0, 2], G[1, 2]
        return G

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
        mu / r^3 J_n (R/r)^n [P_(n+1)' r - r P_n' p] to the acceleration, and with the same rule once more
        mu / r^3 J_n (R/r)^n [P_(n+1)' I - P_(n+2)'' r r^T / r^2 + P_(n+1)'' (r p^T + p r^T) / r - P_n'' p p^T] to its
        gradient, r being the position in products with p and r^T.
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
