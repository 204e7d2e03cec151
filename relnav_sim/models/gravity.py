"""Gravity as a filter believes in it: a point mass, with or without J2, and its difference over a small offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gravity:
    """A point mass with J2 about the frame's z axis. Arrays hold components second: (s, 3, ...), s nodes of a step.

    Args:
        mu_m3_s2: Gravitational parameter, m^3/s^2.
        equatorial_radius_m: Radius that J2 refers to, m.
        j2: Zonal harmonic, unnormalised; 0 for a point mass, in any axes.
    """

    mu_m3_s2: float
    equatorial_radius_m: float = 0.0
    j2: float = 0.0

    def acceleration(self, position: Array) -> Array:
        """Return the acceleration at `position` (s, 3, ...), m/s^2."""
        r2 = squared(position)
        central = -self.mu_m3_s2 / (r2 * np.sqrt(r2))
        pull = central[:, None] * position
        return pull + self._oblate(position, r2) if self.j2 else pull

    def difference(self, chief: Array, offset: Array) -> Array:
        """Return the acceleration at chief + offset less that at the chief, without loss of digits at small offsets.

        Battin, An Introduction to the Mathematics and Methods of Astrodynamics, 1999, on Encke's method: with
        1 + q = |chief + offset|^2 / |chief|^2 and g = 1 - (1 + q)^(-3/2) it is mu / |chief|^3 (g chief - (1 - g)
        offset), and both q and g can be written without a difference of near numbers. The J2 parts, a thousand times
        smaller, are simply subtracted.

        Args:
            chief: The chief's position, (s, 3, ...), m.
            offset: Position relative to it, (s, 3, ...), m; the axes broadcast.
        """
        r2 = squared(chief)
        q = _dot(2 * chief + offset, offset) / r2
        u = 1 + q
        cubed = u * np.sqrt(u)
        g = q * (3 + q * (3 + q)) / (cubed * (1 + cubed))
        k = self.mu_m3_s2 / (r2 * np.sqrt(r2))
        pull = (k * g)[:, None] * chief - (k * (1 - g))[:, None] * offset
        if not self.j2:
            return pull
        return pull + (self._oblate(chief + offset, r2 * u) - self._oblate(chief, r2))

    def gradient(self, position: Array) -> Array:
        """Return the derivatives of the acceleration, (3, 3, s, ...), 1/s^2, at `position` (s, 3, ...)."""
        components = position.swapaxes(0, 1)
        r2 = squared(position)
        inverse = 1 / r2
        central = self.mu_m3_s2 * inverse / np.sqrt(r2)
        diagonal, outer, polar = -central, 3 * central * inverse, None
        if self.j2:
            factor = 1.5 * self.j2 * self.equatorial_radius_m**2 * central * inverse
            s2 = np.square(components[2]) * inverse
            # -factor [(1 - 5 s^2) I + 2 p p^T - 10 z / r^2 (r p^T + p r^T) + (35 s^2 - 5) r r^T / r^2], s = z / r
            diagonal = diagonal - factor * (1 - 5 * s2)
            outer = outer - factor * inverse * (35 * s2 - 5)
            polar = 10 * factor * inverse * components[2]
        G = np.empty((3, 3, *r2.shape))
        for i in range(3):
            scaled = outer * components[i]
            for j in range(i, 3):
                entry = scaled * components[j]
                if i == j:
                    entry = entry + diagonal
                if polar is not None and j == 2:
                    entry = entry + (polar * components[i] if i < 2 else 2 * polar * components[2] - 2 * factor)
                G[i, j] = entry
                if i != j:
                    G[j, i] = entry
        return G

    def _oblate(self, position: Array, r2: Array) -> Array:
        """Return J2's acceleration, -K / r^5 [(1 - 5 s^2) r + 2 z p], s = z / r, p the polar axis (Vallado, ch. 8)."""
        z = position[:, 2]
        inverse = 1 / r2
        factor = -1.5 * self.j2 * self.mu_m3_s2 * self.equatorial_radius_m**2 * inverse * inverse / np.sqrt(r2)
        bulge = (factor * (1 - 5 * z * z * inverse))[:, None] * position
        bulge[:, 2] += 2 * factor * z
        return bulge


def squared(vectors: Array) -> Array:
    """Return the squared lengths (s, ...) of vectors (s, 3, ...)."""
    return _dot(vectors, vectors)


def _dot(a: Array, b: Array) -> Array:
    products = a * b
    total: Array = products[:, 0] + products[:, 1] + products[:, 2]
    return total
