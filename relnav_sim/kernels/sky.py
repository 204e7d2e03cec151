"""The sky over lanes: how the Earth is turned, where Sun and Moon are, and what they do to a spacecraft.

Each function sets or adds to what lanes hold, at each lane's own time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number, record, written
from relnav_sim.kernels.elementary import cos, sin
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors

DAY_S = 86400.0
TURNS_A_DAY_BEYOND_ONE = 0.00273781191135448
"""What the Earth turns in a day of UT1 beyond a whole turn (IERS Conventions 2010, equation 5.15)."""
X, Y, S, SUN, MOON, ROWS = 0, 1, 2, 3, 6, 9
"""Rows of a table of the sky: the celestial intermediate pole's X and Y and the origin's s, less s' of the terrestrial
one, rad; from SUN and from MOON on, three components of a position, m. All refer to EME2000."""
POWERS = 8
"""Coefficients of a row's polynomial."""
AU_M = 149597870700.0
"""The astronomical unit (IAU 2012, resolution B2), m."""
SUN_RADIUS_M = 6.957e8
SUN_PRESSURE = 1361.0 / 299792458.0
"""The Sun's radius, and the pressure of its light at the astronomical unit, N/m^2: the irradiance of 1361 W/m^2 by the
speed of light (IAU 2015, resolution B3)."""
SHARE_OF_PENUMBRA = 0.25
"""A step in the penumbra may last this share of the time in which the craft goes as far as the Sun's radius appears at
the Earth's distance. Twice as much costs a digit after a day, half as much gains none."""
SHARE_OF_WAY = 0.875
"""A step towards the penumbra may last this share of the time until there."""


class Sky(NamedTuple):
    """The sky over some days that count from the epoch of the times.

    Attributes:
        first_day: Number of the first day.
        days: Polynomials (days, ROWS, POWERS), lowest power first, of a variable from -1 to 1 over each day.
        angle: The Earth's rotation angle at the epoch, rad.
        pole: Rotation (3, 3) from the axes of the intermediate pole to the Earth-fixed ones: polar motion.
    """

    first_day: float
    days: Array
    angle: float
    pole: Array


SKY = record(Sky, number, written(3), number, written(2))


@inner
def look_up(sky: Sky, times: Array, used: int, found: Array) -> None:
    """Set found (ROWS,) to the table's rows at times, s from the epoch; NaN outside the table's days.

    A day at a time, for the lanes that are in it: mostly all are in the same.
    """
    day, u = np.empty(LANES), np.empty(LANES)
    for b in range(used):
        day[b] = np.floor(times[b] / DAY_S)
        u[b] = (times[b] - day[b] * DAY_S) / (DAY_S / 2) - 1
    for row in range(ROWS):
        for b in range(used):
            found[row, b] = math.nan
    reached = sky.first_day - 1
    while True:
        following = sky.first_day + len(sky.days)
        for b in range(used):
            following = day[b] if reached < day[b] < following else following
        if following == sky.first_day + len(sky.days):
            break
        reached = following
        table = sky.days[int(reached - sky.first_day)]
        for row in range(ROWS):
            c0, c1, c2, c3 = table[row, 0], table[row, 1], table[row, 2], table[row, 3]
            c4, c5, c6, c7 = table[row, 4], table[row, 5], table[row, 6], table[row, 7]
            for b in range(used):
                value = c4 + u[b] * (c5 + u[b] * (c6 + u[b] * c7))
                value = c0 + u[b] * (c1 + u[b] * (c2 + u[b] * (c3 + u[b] * value)))
                found[row, b] = value if day[b] == reached else found[row, b]


@inner
def set_orientation(sky: Sky, times: Array, found: Array, used: int, Q: Array) -> None:
    """Set Q (3, 3) to the rotation from EME2000 to Earth-fixed axes: pole R_3(angle - s) of the intermediate pole.

    IERS Conventions (2010), section 5.4.4; `found` as `look_up` sets it.
    """
    for b in range(used):
        days = times[b] / DAY_S
        # Whole turns are left out before they can cost digits.
        turns = (times[b] - np.floor(days) * DAY_S) / DAY_S + TURNS_A_DAY_BEYOND_ONE * days
        angle = sky.angle + 2 * math.pi * turns - found[S, b]
        c, s = cos(angle), sin(angle)
        x, y = found[X, b], found[Y, b]
        a = 1 / (1 + math.sqrt(1 - x * x - y * y))
        xx, xy, yy = 1 - a * x * x, -a * x * y, 1 - a * y * y
        Q[0, 0, b], Q[0, 1, b], Q[0, 2, b] = c * xx + s * xy, c * xy + s * yy, -c * x - s * y
        Q[1, 0, b], Q[1, 1, b], Q[1, 2, b] = c * xy - s * xx, c * yy - s * xy, s * x - c * y
        Q[2, 0, b], Q[2, 1, b], Q[2, 2, b] = x, y, 1 - a * (x * x + y * y)
    P = sky.pole
    for j in range(3):
        for b in range(used):
            u, v, w = Q[0, j, b], Q[1, j, b], Q[2, j, b]
            for i in range(3):
                Q[i, j, b] = P[i, 0] * u + P[i, 1] * v + P[i, 2] * w


@inner
def turn(Q: Array, r: Array, used: int, out: Array) -> None:
    """Set out (3,) to Q r, Earth-fixed components of vectors; rows of r after the third are not looked at."""
    for i in range(3):
        for b in range(used):
            out[i, b] = Q[i, 0, b] * r[0, b] + Q[i, 1, b] * r[1, b] + Q[i, 2, b] * r[2, b]


@inner
def add_turned_back(Q: Array, fixed: Array, used: int, a: Array) -> None:
    """Add to a (3,) the vectors whose Earth-fixed components are given: the transpose of Q times them."""
    for i in range(3):
        for b in range(used):
            a[i, b] += Q[0, i, b] * fixed[0, b] + Q[1, i, b] * fixed[1, b] + Q[2, i, b] * fixed[2, b]


@inner
def add_third_body(y: Array, body: Array, mu: float, used: int, a: Array) -> None:
    """Add a body's pull on a craft less its pull on the Earth, both point masses.

    -(mu / d^3) (r + f(q) s), d = |r - s|, q = r (r - 2 s) / s^2, f(q) = q (3 + 3q + q^2) / (1 + (1 + q)^(3/2)), which
    loses no digits where r is small beside s (Battin 1999, section 8.6).

    Args:
        y: Positions r of craft, m; rows after the third are not looked at.
        body: Positions s (3,) of the body, m.
        mu: Its gravitational parameter, m^3/s^2.
        used: How many lanes count.
        a: Accelerations (3,), m/s^2.
    """
    for b in range(used):
        x, y_, z, sx, sy, sz = y[0, b], y[1, b], y[2, b], body[0, b], body[1, b], body[2, b]
        q = (x * (x - 2 * sx) + y_ * (y_ - 2 * sy) + z * (z - 2 * sz)) / (sx * sx + sy * sy + sz * sz)
        f = q * (3 + q * (3 + q)) / (1 + (1 + q) * math.sqrt(1 + q))
        dx, dy, dz = x - sx, y_ - sy, z - sz
        d2 = dx * dx + dy * dy + dz * dz
        k = -mu / (d2 * math.sqrt(d2))
        a[0, b] += k * (x + f * sx)
        a[1, b] += k * (y_ + f * sy)
        a[2, b] += k * (z + f * sz)


@inner
def add_radiation(y: Array, sun: Array, radius: float, reflectivity: Array, used: int, a: Array) -> None:
    """Add the pressure of sunlight on a sphere, away from the Sun, as far as the Earth leaves it in sight.

    Args:
        y: Positions of craft, m; rows after the third are not looked at.
        sun: Positions (3,) of the Sun, m.
        radius: Of the Earth, m.
        reflectivity: Cr A / m, m^2/kg.
        used: How many lanes count.
        a: Accelerations (3,), m/s^2.
    """
    for b in range(used):
        x, y_, z = y[0, b], y[1, b], y[2, b]
        dx, dy, dz = sun[0, b] - x, sun[1, b] - y_, sun[2, b] - z
        d2 = dx * dx + dy * dy + dz * dz
        r, d = math.sqrt(x * x + y_ * y_ + z * z), math.sqrt(d2)
        seen = sun_in_sight(r, d, -(x * dx + y_ * dy + z * dz), radius)
        k = -seen * SUN_PRESSURE * reflectivity[b] * (AU_M * AU_M / d2) / d
        a[0, b] += k * dx
        a[1, b] += k * dy
        a[2, b] += k * dz


@inner
def sun_in_sight(r: float, d: float, product: float, radius: float) -> float:
    """Return the share of the Sun's disc that the Earth's leaves in sight (Montenbruck and Gill 2000, section 3.4.2).

    Args:
        r: Distance of the Earth's centre, m; a craft inside the Earth sees half the sky, at most.
        d: Distance of the Sun, m.
        product: The scalar product of the vectors to both, m^2.
        radius: Of the Earth, m.
    """
    sun = math.asin(min(1.0, SUN_RADIUS_M / d))
    earth = math.asin(min(1.0, radius / r))
    apart = math.acos(max(-1.0, min(1.0, product / (r * d))))
    if apart >= sun + earth:
        return 1.0
    if apart <= earth - sun:
        return 0.0
    if apart <= sun - earth:  # a ring of the Sun is left
        return 1 - (earth / sun) * (earth / sun)
    x = (apart * apart + sun * sun - earth * earth) / (2 * apart)
    y = math.sqrt(max(0.0, sun * sun - x * x))
    covered = (
        sun * sun * math.acos(max(-1.0, min(1.0, x / sun)))
        + earth * earth * math.acos(max(-1.0, min(1.0, (apart - x) / earth)))
        - apart * y
    )
    return 1 - covered / (math.pi * sun * sun)


@inner
def longest_by_shadow(states: Array, i: int, sun: Array, b: int, mu: float, radius: float) -> float:
    """Return how long a step from state i may be that should not run into the edge of the Earth's shadow unawares, s.

    Penumbra and umbra are cones about the axis away from the Sun (Montenbruck and Gill 2000, section 3.4): with s along
    it, f = r^2 - s^2 - (R +- k s)^2 is zero on them. When it will be zero follows from its first two derivatives on a
    Kepler orbit, as a step is a small part of a radian.

    Args:
        states: (n, 6), m and m/s.
        i: Which of them.
        sun: Positions (3,) of the Sun, m.
        b: The lane of it that is looked at.
        mu: Gravitational parameter of the Earth, m^3/s^2.
        radius: Of the Earth, m.
    """
    x, y, z, vx, vy, vz = states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5]
    sx, sy, sz = sun[0, b], sun[1, b], sun[2, b]
    d = math.sqrt(sx * sx + sy * sy + sz * sz)
    s, s1 = -(x * sx + y * sy + z * sz) / d, -(vx * sx + vy * sy + vz * sz) / d
    r2, v2, rv = x * x + y * y + z * z, vx * vx + vy * vy + vz * vz, x * vx + y * vy + z * vz
    pull = mu / (r2 * math.sqrt(r2))
    least, until, partly = SHARE_OF_PENUMBRA * SUN_RADIUS_M / d * math.sqrt(r2 / v2), math.inf, s > 0
    for side in (-1, 1):  # umbra, penumbra
        k = (side * SUN_RADIUS_M + radius) / d
        w, w1 = radius + k * s, k * s1
        f = r2 - s * s - w * w
        f1 = 2 * (rv - s * s1 - w * w1)
        f2 = v2 - s1 * s1 - w1 * w1 - pull * (r2 - s * s - k * s * w)  # half the second derivative
        partly = partly and side * f < 0
        root2 = f1 * f1 - 4 * f2 * f
        if root2 >= 0:
            q = -(f1 + math.copysign(math.sqrt(root2), f1)) / 2
            for t in (q / f2, f / q):
                if t > 0 and s + s1 * t > 0:  # on the Sun's side of the Earth the cones are no shadow
                    until = min(until, t)
    return least if partly else max(least, SHARE_OF_WAY * until)


@kernel(SKY, given(1))
def orientations(sky: Sky, times: Array) -> Array:
    """Return the rotations (n, 3, 3) from EME2000 to Earth-fixed axes at times (n,), s from the epoch."""
    n = len(times)
    out, lanes, found, Q = np.empty((n, 3, 3)), np.empty(LANES), np.empty((ROWS, LANES)), np.empty((3, 3, LANES))
    for first in range(0, n, LANES):
        used = min(LANES, n - first)
        for b in range(used):
            lanes[b] = times[first + b]
        look_up(sky, lanes, used, found)
        set_orientation(sky, lanes, found, used, Q)
        for i in range(3):
            for j in range(3):
                for b in range(used):
                    out[first + b, i, j] = Q[i, j, b]
    return out


@kernel(SKY, given(1), given(2), given(1), number, number, number)
def acceleration(
    sky: Sky, times: Array, positions: Array, reflectivity: Array, sun_mu: float, moon_mu: float, radius: float
) -> Array:
    """Return what Sun, Moon and sunlight add to the acceleration of craft (n, 3), m/s^2.

    Args:
        sky: The sky.
        times: (n,), s from the epoch.
        positions: (n, 3), m, EME2000.
        reflectivity: Cr A / m (n,), m^2/kg.
        sun_mu: Gravitational parameter of the Sun, m^3/s^2; 0 without its pull.
        moon_mu: That of the Moon.
        radius: Of the Earth, which casts the shadow, m.
    """
    n = len(times)
    out = np.empty((n, 3))
    found, r, a = np.empty((ROWS, LANES)), np.empty((3, LANES)), np.empty((3, LANES))
    lanes, of_lanes = np.empty(LANES), np.empty(LANES)
    for first in range(0, n, LANES):
        used = min(LANES, n - first)
        load_vectors(positions, first, used, r)
        for b in range(used):
            lanes[b], of_lanes[b] = times[first + b], reflectivity[first + b]
            for i in range(3):
                a[i, b] = 0.0
        look_up(sky, lanes, used, found)
        add_third_body(r, found[SUN:], sun_mu, used, a)
        add_third_body(r, found[MOON:], moon_mu, used, a)
        add_radiation(r, found[SUN:], radius, of_lanes, used, a)
        store_vectors(a, first, used, out)
    return out
