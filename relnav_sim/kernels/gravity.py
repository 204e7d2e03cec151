"""The pull of a body: a point mass with zonal harmonics about the z axis."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


@inner
def pull(r: Array, mu: float, radius: float, J: Array, room: Array, a: Array) -> None:
    """Set a (3,) to the acceleration at positions r (3,), m/s^2.

    The gradient of the potential mu/r (1 - sum J_n (R/r)^n P_n(s)), s = z/r (Vallado, 4th ed., section 8.6), collected
    along the radius and the axis with (n+1) P_n + s P_n' = P_{n+1}', is
    -(mu/r^3) [r (1 - sum J_n W_{n+1}) + R e_z sum J_n W_n], where W_n = (R/r)^(n-1) P_n'(s), which follows from
    n W_{n+1} = (2n+1) p W_n - (n+1) q W_{n-1} with p = R z / r^2 and q = (R / r)^2.

    Args:
        r: Positions, m, in all lanes, used or not; rows after the third, the velocity, are not looked at.
        mu: Gravitational parameter, m^3/s^2.
        radius: R, the radius that the harmonics refer to, m.
        J: Unnormalised J_2, J_3, ...; any number of them, none for a point mass.
        room: Lanes (6,) to work in.
        a: Where the acceleration goes.
    """
    central, inverse, before, W, radial, axial = room[0], room[1], room[2], room[3], room[4], room[5]
    for b in range(LANES):
        x, y, z = float(r[0, b]), float(r[1, b]), float(r[2, b])
        r2 = x * x + y * y + z * z
        inverse[b] = 1 / r2
        central[b] = -mu * inverse[b] / math.sqrt(r2)
    for b in range(LANES):
        before[b], W[b], radial[b], axial[b] = 1.0, 3 * (radius * r[2, b] * inverse[b]), 0.0, 0.0
    for k in range(len(J)):
        n = k + 2
        ahead, back = (2 * n + 1) / n, (n + 1) / n
        for b in range(LANES):
            p, q = radius * r[2, b] * inverse[b], radius * radius * inverse[b]
            after = ahead * p * W[b] - back * q * before[b]
            radial[b] += J[k] * after
            axial[b] += J[k] * W[b]
            before[b], W[b] = W[b], after
    for i in range(3):
        for b in range(LANES):
            a[i, b] = central[b] * (1 - radial[b]) * r[i, b]
    for b in range(LANES):
        a[2, b] += radius * central[b] * axial[b]


@kernel(given(2), number, number, given(1))
def acceleration(positions: Array, mu: float, radius: float, J: Array) -> Array:
    """Return the acceleration (points, 3) at positions (points, 3), m/s^2; the rest as in `pull`."""
    points = len(positions)
    found = np.empty((points, 3))
    r, a, room = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((6, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        load_vectors(positions, first, used, r)
        pull(r, mu, radius, J, room, a)
        store_vectors(a, first, used, found)
    return found
