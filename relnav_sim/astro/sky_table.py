"""Earth orientation, Sun and Moon as polynomials, a set a day, so that they cost next to nothing in an integration.

pyerfa takes 70 microseconds for one instant. All of it varies over weeks, but the Earth's rotation, which is left out
here because it is linear in time. The days count from the epoch: what a polynomial is does not depend on how long a
run lasts. They are within 1e-15 rad (orientation) and 10 mm (Sun, Moon) of pyerfa.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.sun_moon import moon_position, sun_position
from relnav_sim.kernels.sky import DAY_S, POWERS, ROWS

_J2000 = Epoch.parse("2000-01-01T12:00:00 TT")
_KNOWN_DAYS = 100 * 365.25 + 3
"""How far from J2000 pyerfa's Sun reaches, and the days that tables have beyond what is asked for."""


def sky_table(epoch: Epoch, days: Integers) -> Array:
    """Return polynomials for days (n,) counted from the epoch, (n, ROWS, POWERS), lowest power first.

    The rows are those of `kernels.sky`. The variable goes from -1 at the beginning of the day to 1 at its end;
    `day_and_variable` gives both.

    Raises:
        ValueError: A day is before 1900 or after 2100.
    """
    if not len(days):
        return np.empty((0, ROWS, POWERS))
    for day in (int(days.min()), int(days.max())):
        if abs(epoch.seconds_since(_J2000) / DAY_S + day) > _KNOWN_DAYS:
            raise ValueError(
                f"{DAY_S * day:g} s from {epoch.text()} is not within the years 1900 to 2100, for which Sun, Moon and "
                "Earth orientation are known"
            )
    return np.stack([_day(epoch, int(day)) for day in days])


def day_and_variable(times_s: Array) -> tuple[Integers, Array]:
    """Return the day that each time since the epoch is in, and the variable of its polynomials."""
    day = np.floor(times_s / DAY_S)
    return day.astype(np.int64), (times_s - day * DAY_S) / (DAY_S / 2) - 1


@lru_cache(maxsize=1024)
def _day(epoch: Epoch, day: int) -> Array:
    """Interpolate a day at the Chebyshev nodes."""
    nodes, powers_of_values = _interpolation()
    times = DAY_S * (day + (nodes + 1) / 2)
    values = np.concatenate([_intermediate(times, epoch), sun_position(times, epoch), moon_position(times, epoch)], 1)
    return np.ascontiguousarray(np.einsum("pk,kr->rp", powers_of_values, values))


@cache
def _interpolation() -> tuple[Array, Array]:
    """Return the nodes, and the matrix from values there to coefficients of powers."""
    chebyshev = np.polynomial.chebyshev
    nodes = np.cos(math.pi * (np.arange(POWERS) + 0.5) / POWERS)
    series_of_values = 2 / POWERS * chebyshev.chebvander(nodes, POWERS - 1).T
    series_of_values[0] /= 2
    powers_of_series = np.zeros((POWERS, POWERS))
    for k in range(POWERS):
        powers_of_series[: k + 1, k] = chebyshev.cheb2poly(np.eye(POWERS)[k, : k + 1])
    return nodes, np.einsum("ps,sk->pk", powers_of_series, series_of_values)


def _intermediate(times_s: Array, epoch: Epoch) -> Array:
    """Return X, Y and s - s' with respect to EME2000 (n, 3), IAU 2006/2000A."""
    import erfa

    day, fraction = epoch.tt
    instants = day, fraction + times_s / DAY_S
    unbiased = erfa.tr(erfa.bp00(2451545.0, 0.0)[0])
    of_eme2000 = erfa.rxr(erfa.c2ixys(*erfa.xys06a(*instants)), unbiased)
    x, y = of_eme2000[:, 2, 0], of_eme2000[:, 2, 1]
    rest = erfa.rxr(of_eme2000, erfa.tr(pole_matrix(x, y)))
    return np.stack([x, y, np.arctan2(rest[:, 1, 0], rest[:, 0, 0]) - erfa.sp00(*instants)], axis=1)


def pole_matrix(x: Array, y: Array) -> Array:
    """Return the rotation (..., 3, 3) that takes the pole (x, y) to the z axis by the shortest way.

    IERS Conventions (2010), equation 5.10, without its turn by s, transposed.
    """
    a = 1 / (1 + np.sqrt(1 - x * x - y * y))
    return np.stack(
        [
            np.stack([1 - a * x * x, -a * x * y, -x], axis=-1),
            np.stack([-a * x * y, 1 - a * y * y, -y], axis=-1),
            np.stack([x, y, 1 - a * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )
