"""Where the Sun and the Moon are, seen from the Earth's centre, by pyerfa."""

from __future__ import annotations

from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.given_arrays import numbers
from relnav_sim.kernels.sky import AU_M

SUN_MU = 1.32712440041e20
MOON_MU = 4.902800066e12
"""Gravitational parameters of DE430 (Folkner et al., IPN Progress Report 42-196, 2014), m^3/s^2."""


def sun_position(times_s: ArrayLike, epoch: str | Epoch) -> Array:
    """Return where the Sun is, m, EME2000, (..., 3): the geometric position, without light time or aberration.

    The simplified VSOP2000 of ERFA's `epv00`: within 11 km (7.5e-8 rad) of JPL's DE405 from 1900 to 2100.

    Args:
        times_s: Times (...), SI seconds from the epoch.
        epoch: When they count from, as `Epoch.parse` reads it.

    Raises:
        ValueError: The text is no epoch, or the times are no numbers.

    Examples:
        >>> from relnav_sim.astro.sun_moon import AU_M, sun_position
        >>> x, y, z = sun_position(0.0, "2010-07-06T12:00:00 UTC") / AU_M
        >>> round(float(x * x + y * y + z * z) ** 0.5, 4)  # at the aphelion
        1.0167
    """
    import erfa

    earth, _ = erfa.epv00(*_tt(times_s, epoch))
    return -AU_M * _eme2000(earth["p"])


def moon_position(times_s: ArrayLike, epoch: str | Epoch) -> Array:
    """Return where the Moon is, m, EME2000, (..., 3): the geometric position.

    The series of Meeus (1998) in ERFA's `moon98`: within 32 km of ELP/MPP02 from 1950 to 2100, which is 3e-4 of the
    Moon's pull on a spacecraft; 6 km in root mean square.

    Args:
        times_s: Times (...), SI seconds from the epoch.
        epoch: When they count from, as `Epoch.parse` reads it.

    Raises:
        ValueError: As `sun_position`.
    """
    import erfa

    return AU_M * _eme2000(erfa.moon98(*_tt(times_s, epoch))["p"])


def _tt(times_s: ArrayLike, epoch: str | Epoch) -> tuple[float, Array]:
    day, fraction = (Epoch.parse(epoch) if isinstance(epoch, str) else epoch).tt
    return day, fraction + numbers(times_s, "times_s") / 86400


def _eme2000(gcrs: Array) -> Array:
    """Turn positions from the axes of the GCRS by the frame bias."""
    import erfa

    return erfa.rxp(erfa.bp00(2451545.0, 0.0)[0], gcrs)
