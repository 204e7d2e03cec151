"""How the Earth is turned: from the axes of EME2000 to those fixed to the Earth, and back.

ECI is EME2000, the mean equator and equinox of J2000; the ITRF is fixed to the crust. Between them lie the frame bias,
precession and nutation (IAU 2006/2000A), the Earth's rotation angle, and polar motion: IERS Conventions (2010),
chapter 5, based on the intermediate origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array, Indices
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.sky_table import day_and_variable, pole_matrix, sky_table
from relnav_sim.given_arrays import finite, numbers
from relnav_sim.kernels.sky import DAY_S, TURNS_A_DAY_BEYOND_ONE, S, X, Y

ROTATION_RAD_S = 2 * math.pi * (1 + TURNS_A_DAY_BEYOND_ONE) / DAY_S
"""Rate of the Earth's rotation angle (IERS Conventions 2010, equation 5.15), rad/s."""


@dataclass(frozen=True)
class EarthOrientation:
    """What only observation tells about the Earth's rotation, constant over a run.

    Attributes:
        ut1_utc_s: UT1 - UTC at the epoch, s; within 0.9 s. UT1 goes on from there without leap seconds.
        polar_motion_rad: Coordinates x and y of the pole in the ITRF, rad; about 1e-6.

    Raises:
        ValueError: UT1 - UTC above 1 s, or polar motion above 1e-5 rad, so that its unit can't be right.
    """

    ut1_utc_s: float = 0.0
    polar_motion_rad: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not abs(self.ut1_utc_s) <= 1:
            raise ValueError(f"ut1_utc_s is {self.ut1_utc_s}; UT1 - UTC stays within 0.9 s")
        if np.shape(self.polar_motion_rad) != (2,) or not np.abs(self.polar_motion_rad).max() <= 1e-5:
            raise ValueError(f"polar_motion_rad is {self.polar_motion_rad}; it must be x and y in rad, about 1e-6")

    def rotation_angle(self, epoch: Epoch) -> float:
        """Return the Earth's rotation angle at an epoch, rad.

        Raises:
            ValueError: The epoch is before 1972, when UTC did not yet go in whole seconds.
        """
        import erfa

        day, fraction = epoch.tt
        ut1_tt_s = self.ut1_utc_s - epoch.tai_minus_utc_s - 32.184
        return float(erfa.era00(day, fraction + ut1_tt_s / DAY_S))

    def pole(self) -> Array:
        """Return the rotation (3, 3) from the axes of the intermediate pole to the ITRF, without s', by its place."""
        import erfa

        return erfa.pom00(*self.polar_motion_rad, 0.0)

    def matrices(self, times_s: Array, epoch: Epoch) -> tuple[Array, Array]:
        """Return the rotations from EME2000 to the ITRF, and their rates, both (T, 3, 3), 1 and 1/s.

        They agree with ERFA's `c2t06a` to 1e-13 rad.

        Args:
            times_s: SI seconds from the epoch, (T,).
            epoch: When they count from.

        Raises:
            ValueError: A time is before 1900 or after 2100, or the epoch before 1972.
        """
        days, variable = day_and_variable(times_s)
        known, which = np.unique(days, return_inverse=True)
        polynomials = sky_table(epoch, known)[:, [X, Y, S]]
        slopes = polynomials[..., 1:] * np.arange(1, polynomials.shape[-1]) / (DAY_S / 2)
        x, y, s = (_at(polynomials[:, i], which, variable) for i in range(3))
        dx, dy, ds = (_at(slopes[:, i], which, variable) for i in range(3))
        # Whole turns are left out before they can cost digits.
        turns = (times_s - days * DAY_S) / DAY_S + TURNS_A_DAY_BEYOND_ONE * (times_s / DAY_S)
        angle = self.rotation_angle(epoch) + 2 * math.pi * turns - s
        cos, sin, rate = np.cos(angle), np.sin(angle), ROTATION_RAD_S - ds
        turned, turning = np.zeros((2, len(times_s), 3, 3))
        turned[:, 0, 0], turned[:, 0, 1], turned[:, 1, 0], turned[:, 1, 1], turned[:, 2, 2] = cos, sin, -sin, cos, 1.0
        turning[:, 0, 0], turning[:, 0, 1] = -rate * sin, rate * cos
        turning[:, 1, 0], turning[:, 1, 1] = -rate * cos, -rate * sin
        pole, celestial = self.pole(), pole_matrix(x, y)
        rates = turning @ celestial + turned @ _pole_matrix_rate(x, y, dx, dy)
        return pole @ turned @ celestial, pole @ rates


def itrf_from_eci(
    states: ArrayLike,
    times_s: ArrayLike,
    epoch: str | Epoch,
    *,
    ut1_utc_s: float = 0.0,
    polar_motion_rad: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Return states (..., T, 6) in the ITRF, m and m/s; velocities are rates of the Earth-fixed coordinates.

    Args:
        states: Positions and velocities (..., T, 6), m and m/s, ECI (EME2000).
        times_s: SI seconds from the epoch, (T,).
        epoch: When they count from, as `Epoch.parse` reads it: `2010-07-27T00:00:00 GPS`.
        ut1_utc_s: UT1 - UTC at the epoch, s. A second is 465 m at the equator.
        polar_motion_rad: x and y of the pole, rad. 1e-6 rad are 6 m.

    Raises:
        ValueError: The shapes do not fit, a time is not finite or not within 1900 to 2100, the text is no epoch or one
            before 1972, or orientation is out of range.

    Examples:
        >>> from relnav_sim import itrf_from_eci
        >>> pole = itrf_from_eci([[0.0, 0.0, 7e6, 0.0, 0.0, 0.0]], [0.0], "2025-07-01T00:00:00 UTC")
        >>> [round(float(x)) for x in pole[0, :3]]  # 25 years of precession, 0.14 deg
        [-2473, -17207, 6999978]
    """
    r, v, turned, turning = _parts(states, times_s, epoch, EarthOrientation(ut1_utc_s, polar_motion_rad))
    return np.concatenate([_product(turned, r), _product(turned, v) + _product(turning, r)], axis=-1)


def eci_from_itrf(
    states: ArrayLike,
    times_s: ArrayLike,
    epoch: str | Epoch,
    *,
    ut1_utc_s: float = 0.0,
    polar_motion_rad: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Return states (..., T, 6) in ECI (EME2000), m and m/s: the inverse of `itrf_from_eci`.

    Args:
        states: Positions and velocities (..., T, 6), m and m/s, ITRF.
        times_s: As `itrf_from_eci`; so are the others.
        epoch: When they count from.
        ut1_utc_s: UT1 - UTC at the epoch, s.
        polar_motion_rad: x and y of the pole, rad.

    Raises:
        ValueError: As `itrf_from_eci`.

    Examples:
        >>> from relnav_sim import eci_from_itrf
        >>> ground = eci_from_itrf([[6378137.0, 0.0, 0.0, 0.0, 0.0, 0.0]], [0.0], "2025-07-01T00:00:00 UTC")
        >>> round(float(ground[0, 3] ** 2 + ground[0, 4] ** 2 + ground[0, 5] ** 2) ** 0.5, 2)  # it moves with the Earth
        465.1
    """
    r, v, turned, turning = _parts(states, times_s, epoch, EarthOrientation(ut1_utc_s, polar_motion_rad))
    back = np.swapaxes(turned, -1, -2)
    position = _product(back, r)
    return np.concatenate([position, _product(back, v - _product(turning, position))], axis=-1)


def eme2000_from_gcrf(states: ArrayLike) -> Array:
    """Return states (..., 6) along the axes of EME2000 from those of the GCRF or ICRF, m and m/s.

    The frame bias between the two is constant, 1.1e-7 rad in all, 0.8 m at 7000 km.

    Raises:
        ValueError: The last axis is not six long.
    """
    return _biased(states, transposed=False)


def gcrf_from_eme2000(states: ArrayLike) -> Array:
    """Return states (..., 6) along the axes of the GCRF: the inverse of `eme2000_from_gcrf`.

    Raises:
        ValueError: The last axis is not six long.
    """
    return _biased(states, transposed=True)


def _biased(states: ArrayLike, transposed: bool) -> Array:
    import erfa

    given = _states(states)
    bias = erfa.bp00(2451545.0, 0.0)[0]
    matrix = erfa.tr(bias) if transposed else bias
    return np.concatenate([erfa.rxp(matrix, given[..., :3]), erfa.rxp(matrix, given[..., 3:])], axis=-1)


def _states(states: ArrayLike) -> Array:
    given = numbers(states, "states")
    if given.ndim == 0 or given.shape[-1] != 6:
        raise ValueError(f"states has shape {given.shape}; it must be (..., 6)")
    return given


def _parts(
    states: ArrayLike, times_s: ArrayLike, epoch: str | Epoch, orientation: EarthOrientation
) -> tuple[Array, Array, Array, Array]:
    """Return positions and velocities (..., T, 3), rotations and their rates (T, 3, 3)."""
    given, times = _states(states), numbers(times_s, "times_s")
    if times.ndim != 1 or given.ndim < 2 or given.shape[-2] != len(times):
        raise ValueError(
            f"states has shape {given.shape}, times_s {times.shape}; they must be (..., T, 6) and (T,), the same T"
        )
    finite(times, "times_s", ("epoch",))
    turned, turning = orientation.matrices(times, Epoch.parse(epoch) if isinstance(epoch, str) else epoch)
    return given[..., :3], given[..., 3:], turned, turning


def _at(polynomials: Array, which: Indices, variable: Array) -> Array:
    """Return polynomials (n, powers) number `which` (T,) at the variable (T,)."""
    value = np.zeros(len(variable))
    for coefficients in polynomials[which].T[::-1]:
        value = value * variable + coefficients
    return value


def _product(matrices: Array, vectors: Array) -> Array:
    return np.einsum("tij,...tj->...ti", matrices, vectors)


def _pole_matrix_rate(x: Array, y: Array, dx: Array, dy: Array) -> Array:
    """Return the rate (T, 3, 3) of `pole_matrix`."""
    z = np.sqrt(1 - x * x - y * y)
    a = 1 / (1 + z)
    da = a * a * (x * dx + y * dy) / z
    xx, xy, yy = da * x * x + 2 * a * x * dx, da * x * y + a * (x * dy + y * dx), da * y * y + 2 * a * y * dy
    rows = [[-xx, -xy, -dx], [-xy, -yy, -dy], [dx, dy, -xx - yy]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
