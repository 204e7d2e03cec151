"""Mean elements as two-line element sets and OMMs publish them, propagated by SGP4.

They are good to about a kilometre at their epoch and lose as much a day or so (Vallado and Cefola, IAC-12-A6.6.11):
good for a nominal orbit, far too coarse for the relative position of two craft that are near to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch

if TYPE_CHECKING:
    from sgp4.api import Satrec

ACCURACY_M = 1000.0
"""What SGP4's positions are good to, m."""
_LINE = 69
_CHECKED = 68
_FIRST_YEAR = 57
"""Two-digit years from here on are of the 20th century: Sputnik."""
_WHOLE_DAYS_1950 = 2433281.5
"""Julian date from which SGP4 counts days."""
_TT_MINUS_TAI_S = 32.184
_DAY_S = 86400


@dataclass(frozen=True)
class MeanElements:
    """Mean elements for SGP4, TEME of their epoch; angles in rad.

    Attributes:
        epoch: Their instant.
        mean_motion_rad_s: Kozai's mean motion, rad/s.
        eccentricity: Mean eccentricity.
        inclination_rad: Mean inclination.
        raan_rad: Right ascension of the ascending node.
        argument_of_perigee_rad: Argument of perigee.
        mean_anomaly_rad: Mean anomaly.
        bstar: Drag term, 1 / Earth radii.
    """

    epoch: Epoch
    mean_motion_rad_s: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    mean_anomaly_rad: float
    bstar: float = 0.0

    @classmethod
    def from_lines(cls, first: str, second: str) -> MeanElements:
        """Return the elements of a two-line element set.

        Raises:
            ValueError: A line is malformed, or they don't belong together.
        """
        from sgp4.api import Satrec

        for number, line in enumerate((first, second), start=1):
            _check_line(number, line)
        if first[2:7] != second[2:7]:
            raise ValueError(f"line 1 is about object {first[2:7].strip()} and line 2 about {second[2:7].strip()}")
        try:
            read = Satrec.twoline2rv(first, second)
            epoch = _epoch_of(first[18:32])
        except ValueError as error:
            raise ValueError(f"the two lines can't be read: {error}") from None
        return cls(
            epoch=epoch,
            mean_motion_rad_s=read.no_kozai / 60,
            eccentricity=read.ecco,
            inclination_rad=read.inclo,
            raan_rad=read.nodeo,
            argument_of_perigee_rad=read.argpo,
            mean_anomaly_rad=read.mo,
            bstar=read.bstar,
        )

    def state(self, epoch: Epoch) -> Array:
        """Return position and velocity (6,) at an instant, ECI (EME2000), m and m/s.

        Raises:
            ValueError: SGP4 can't propagate the elements there.
        """
        from sgp4.api import SGP4_ERRORS

        error, position_km, velocity_km_s = self._satellite().sgp4_tsince(epoch.seconds_since(self.epoch) / 60)
        if error:
            raise ValueError(
                f"SGP4 does not reach {epoch.text()} from elements of {self.epoch.text()}: {SGP4_ERRORS[error]}"
            )
        return eme2000_from_teme(np.array([*position_km, *velocity_km_s]) * 1e3, epoch)

    def _satellite(self) -> Satrec:
        from sgp4.api import WGS72, Satrec

        satellite = Satrec()
        day, fraction = self.epoch.tt
        days_utc = day - _WHOLE_DAYS_1950 + fraction - (_TT_MINUS_TAI_S + self.epoch.tai_minus_utc_s) / _DAY_S
        satellite.sgp4init(
            WGS72,
            "i",
            0,
            days_utc,
            self.bstar,
            0.0,
            0.0,
            self.eccentricity,
            self.argument_of_perigee_rad,
            self.inclination_rad,
            self.mean_anomaly_rad,
            self.mean_motion_rad_s * 60,
            self.raan_rad,
        )
        return satellite


def eme2000_from_teme(state: Array, epoch: Epoch) -> Array:
    """Return a state (6,) in m and m/s, given in TEME axes of an epoch, in those of EME2000.

    TEME has the true equator of date and a mean equinox (Vallado, Fundamentals of Astrodynamics and Applications, 4th
    ed., section 3.7): the equation of the equinoxes leads to the true equinox, and nutation and precession of IAU
    1976/1980, which the elements are made with, from there to J2000.
    """
    import erfa

    day, fraction = epoch.tt
    true_equinox = erfa.rz(-erfa.eqeq94(day, fraction), np.eye(3))
    rotation = erfa.pnm80(day, fraction).T @ true_equinox
    return np.concatenate([rotation @ state[:3], rotation @ state[3:]])


def _check_line(number: int, line: str) -> None:
    if len(line) != _LINE or not line.startswith(f"{number} ") or not line.isascii():
        raise ValueError(f"line {number} of a two-line element set has {_LINE} characters and begins with {number!r}")
    total = sum(int(c) if c.isdigit() else c == "-" for c in line[:_CHECKED]) % 10
    if line[_CHECKED] != str(total):
        raise ValueError(
            f"line {number} of a two-line element set ends with {line[_CHECKED]}, but its digits add to {total}"
        )


def _epoch_of(text: str) -> Epoch:
    """Return the instant of a year of two digits and a day of the year with its fraction, UTC."""
    year, day = int(text[:2]), Fraction(text[2:].strip())
    whole, century = int(day), 1900 if year >= _FIRST_YEAR else 2000
    microseconds = round((day - whole) * _DAY_S * 1_000_000)  # the last digit of the day is 864 of them
    minutes, rest = divmod(microseconds, 60_000_000)
    clock = f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1_000_000:02d}.{rest % 1_000_000:06d}"
    return Epoch.parse(f"{century + year:04d}-{whole:03d}T{clock} UTC")
