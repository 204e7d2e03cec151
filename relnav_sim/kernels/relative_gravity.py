"""Gravity of a point mass with zonal harmonics about the z axis: acceleration, difference and gradient, lanes last.

A field is an array (5,): mu, the radius that the harmonics refer to, J2, J3 and J4, unnormalised. With the Legendre
polynomials P_n(s), s = z / r, the harmonic J_n adds, from (n + 1) P_n + s P_n' = P_(n+1)',

    mu / r^3 J_n (R/r)^n [P_(n+1)' r - r P_n' p]

to the acceleration, p being the polar axis, and with the same rule once more

    mu / r^3 J_n (R/r)^n [P_(n+1)' I - P_(n+2)'' r r^T / r^2 + P_(n+1)'' (r p^T + p r^T) / r - P_n'' p p^T]

to its gradient (Vallado, Fundamentals of Astrodynamics and Applications, section 8.7, for the potential).

Numbers are read as `float`: that is nothing to a compiler, but Python, which interprets this now and then, is several
times as fast with its own numbers as with NumPy's.
"""

from __future__ import annotations

import math

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import inlined


@inlined
def has_harmonics(field: Array) -> bool:
    """Return whether there is more than a point mass, whose field is the same in any axes."""
    return field[2] != 0.0 or field[3] != 0.0 or field[4] != 0.0


@inlined
def during(field: Array, step: int, part: int) -> Array:
    """Return the field as it is in a part of a step: the same at any time."""
    return field


@inlined
def harmonics(field: Array, r: Array, used: int, a: Array) -> None:
    """Set a (3,) to the harmonics' acceleration at r (3,)."""
    mu, R, J2, J3, J4 = float(field[0]), float(field[1]), float(field[2]), float(field[3]), float(field[4])
    for b in range(used):
        x, y, z = float(r[0, b]), float(r[1, b]), float(r[2, b])
        inverse = 1 / (x * x + y * y + z * z)
        near = math.sqrt(inverse)
        s, q = z * near, R * near
        t = s * s
        c2, c3, c4 = J2 * q * q, J3 * q * q * q, J4 * q * q * q * q
        slope2, slope3, slope4 = 3 * s, 7.5 * t - 1.5, 2.5 * s * (7 * t - 3)  # P_2', P_3', P_4'
        slope5 = 1.875 * ((21 * t - 14) * t + 1)
        pull = mu * inverse
        along = pull * near * (c2 * slope3 + c3 * slope4 + c4 * slope5)
        a[0, b] = along * x
        a[1, b] = along * y
        a[2, b] = along * z - pull * (c2 * slope2 + c3 * slope3 + c4 * slope4)


@inlined
def acceleration(field: Array, r: Array, used: int, a: Array) -> None:
    """Set a (3,) to the acceleration at r (3,)."""
    if has_harmonics(field):
        harmonics(field, r, used, a)
    else:
        a[:] = 0.0
    mu = float(field[0])
    for b in range(used):
        x, y, z = float(r[0, b]), float(r[1, b]), float(r[2, b])
        r2 = x * x + y * y + z * z
        central = -mu / (r2 * math.sqrt(r2))
        a[0, b] += central * x
        a[1, b] += central * y
        a[2, b] += central * z


@inlined
def difference(field: Array, chief: Array, bulge: Array, x: Array, used: int, moved: Array, a: Array) -> None:
    """Set a (3,) to the acceleration at chief + x less that at the chief, without loss of digits at small offsets x.

    Battin, An Introduction to the Mathematics and Methods of Astrodynamics, 1999, on Encke's method: with
    1 + q = |chief + x|^2 / |chief|^2 and g = 1 - (1 + q)^(-3/2) it is mu / |chief|^3 (g chief - (1 - g) x), and both
    q and g can be written without a difference of near numbers. The harmonics' parts, a thousand times smaller, are
    simply subtracted.

    Args:
        field: (5,).
        chief: Its position (3,).
        bulge: The harmonics' acceleration there, (3,).
        x: Position relative to it, (3,).
        used: Lanes in use.
        moved: Room for chief + x, (3,).
        a: The result (3,).
    """
    if has_harmonics(field):
        for i in range(3):
            for b in range(used):
                moved[i, b] = chief[i, b] + x[i, b]
        harmonics(field, moved, used, a)
        for i in range(3):
            for b in range(used):
                a[i, b] -= bulge[i, b]
    else:
        a[:] = 0.0
    mu = float(field[0])
    for b in range(used):
        X, Y, Z = float(chief[0, b]), float(chief[1, b]), float(chief[2, b])
        dx, dy, dz = float(x[0, b]), float(x[1, b]), float(x[2, b])
        r2 = X * X + Y * Y + Z * Z
        q = ((2 * X + dx) * dx + (2 * Y + dy) * dy + (2 * Z + dz) * dz) / r2
        cubed = (1 + q) * math.sqrt(1 + q)
        g = q * (3 + q * (3 + q)) / (cubed * (1 + cubed))
        pull = mu / (r2 * math.sqrt(r2))
        a[0, b] += pull * (g * X - (1 - g) * dx)
        a[1, b] += pull * (g * Y - (1 - g) * dy)
        a[2, b] += pull * (g * Z - (1 - g) * dz)


@inlined
def gradient(field: Array, r: Array, used: int, G: Array) -> None:
    """Set G (3, 3) to the derivatives of the acceleration at r (3,), d I + o r r^T + c (r p^T + p r^T) - a p p^T."""
    mu, R, J2, J3, J4 = float(field[0]), float(field[1]), float(field[2]), float(field[3]), float(field[4])
    for b in range(used):
        x, y, z = float(r[0, b]), float(r[1, b]), float(r[2, b])
        inverse = 1 / (x * x + y * y + z * z)
        near = math.sqrt(inverse)
        s, q = z * near, R * near
        t = s * s
        c2, c3, c4 = J2 * q * q, J3 * q * q * q, J4 * q * q * q * q
        bend3, bend4, bend5 = 15 * s, 52.5 * t - 7.5, 52.5 * s * (3 * t - 1)  # P_3'', P_4'', P_5''
        bend6 = 13.125 * ((33 * t - 18) * t + 1)
        central = mu * inverse * near
        slopes = c2 * (7.5 * t - 1.5) + c3 * 2.5 * s * (7 * t - 3) + c4 * 1.875 * ((21 * t - 14) * t + 1)
        d = central * (slopes - 1)
        o = central * inverse * (3 - c2 * bend4 - c3 * bend5 - c4 * bend6)
        c = central * near * (c2 * bend3 + c3 * bend4 + c4 * bend5)
        G[0, 0, b] = o * x * x + d
        G[1, 1, b] = o * y * y + d
        G[2, 2, b] = o * z * z + d + 2 * c * z - central * (3 * c2 + c3 * bend3 + c4 * bend4)
        G[0, 1, b] = G[1, 0, b] = o * x * y
        G[0, 2, b] = G[2, 0, b] = o * x * z + c * x
        G[1, 2, b] = G[2, 1, b] = o * y * z + c * y
