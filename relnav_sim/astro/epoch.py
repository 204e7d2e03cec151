"""Instants of the calendar, exact in any of the time scales that orbits are told in.

TAI counts SI seconds. TT and GPS time differ from it by constants, UTC by whole seconds that leap seconds change;
pyerfa knows those. After its last leap second UTC is taken to go on as it is.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass
from datetime import UTC, date, datetime
from fractions import Fraction
from functools import cache

_PER_SECOND = 10**12
_DAY_S = 86400
_ZERO = date(2000, 1, 1).toordinal()
_JULIAN_DATE_OF_ZERO = 2451544.5
_YEARS = range(1901, 2100)
"""What pyerfa's Sun covers."""
_LONGEST_S = 10**11

_AFTER_TAI = {"TAI": 0, "GPS": -19 * _PER_SECOND, "TT": 32_184 * _PER_SECOND // 1000}
"""Picoseconds by which a clock is ahead of TAI."""
SCALES = ("UTC", "TAI", "GPS", "TT")

_FORM = re.compile(
    r"(?P<year>\d{4})-(?:(?P<month>\d\d)-(?P<day>\d\d)|(?P<day_of_year>\d{3}))"
    r"(?:[T ](?P<hour>\d\d):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:\.(?P<fraction>\d{0,40}))?)?)?"
    r"(?P<zulu>Z)?(?:\s+(?P<scale>[A-Za-z]\w*))?",
    re.ASCII,
)


@dataclass(frozen=True, order=True)
class Epoch:
    """An instant, compared and subtracted without rounding.

    Attributes:
        tai_ps: Picoseconds of TAI since 2000-01-01T00:00:00 TAI.

    Examples:
        >>> from relnav_sim import Epoch
        >>> epoch = Epoch.parse("2010-07-27T00:00:00 GPS")
        >>> epoch.text("UTC")
        '2010-07-26T23:59:45 UTC'
        >>> epoch.later(60.5).seconds_since(epoch)
        60.5
    """

    tai_ps: int

    @classmethod
    def parse(cls, text: str, scale: str | None = None) -> Epoch:
        """Return the instant that a text names.

        Args:
            text: A calendar date or a day of the year, a time of day, and a time scale: `2010-07-27T00:00:00 GPS`,
                `2010-208T00:00:00.25 TAI`, `2016-12-31T23:59:60 UTC`. Seconds, or the whole time of day, may be left
                out, and count as zero. A `Z` after the time stands for UTC. What is finer than a picosecond is rounded.
            scale: The time scale, where it stands elsewhere, as in a file's header; a `Z` then says nothing more.

        Raises:
            ValueError: The text has another form, no time scale or an unknown one, or there is no such day or time.
        """
        found = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
        if found is None:
            raise ValueError(f"{text!r} is no epoch; write it as 2010-07-27T00:00:00 UTC, or with another time scale")
        scale = _scale_of(text, found["scale"], bool(found["zulu"]), scale)
        day = _day(text, found)
        hour, minute = int(found["hour"] or 0), int(found["minute"] or 0)
        second = int(found["second"] or 0)
        leap = scale == "UTC" and (hour, minute, second) == (23, 59, 60)
        if hour > 23 or minute > 59 or (second >= 60 and not leap):
            raise ValueError(f"epoch {text!r}: there is no such time of day; it is at most 23:59:59")
        if leap and day + 1 not in _leap_seconds()[0]:
            raise ValueError(f"epoch {text!r}: no leap second was added on this day, so that 23:59:59 is its last")
        clock = (day * _DAY_S + hour * 3600 + minute * 60 + second) * _PER_SECOND + _picoseconds(found["fraction"])
        return cls(clock + _tai_minus_utc_on(day, text) * _PER_SECOND if scale == "UTC" else clock - _AFTER_TAI[scale])

    def text(self, scale: str | None = None) -> str:
        """Return it as `parse` reads it, to the picosecond, in a time scale: UTC, TAI, GPS or TT.

        Args:
            scale: The time scale; default: UTC, or TAI before 1972, when UTC did not yet go in whole seconds.

        Raises:
            ValueError: The time scale is unknown; the instant is before 1972, and the scale UTC; its year is none from
                1 to 9999.
        """
        if scale is None:
            scale = "UTC" if self.tai_ps >= _leap_seconds()[2][0] else "TAI"
        scale = _known(scale, f"text of {self}")
        # Within a leap second UTC's clock stands at 23:59:59 and counts on.
        leap = scale == "UTC" and self._in_leap_second()
        clock = self.tai_ps - _PER_SECOND * (self.tai_minus_utc_s + leap) if scale == "UTC" else self._clock(scale)
        day, rest = divmod(clock, _DAY_S * _PER_SECOND)
        whole, fraction = divmod(rest, _PER_SECOND)
        digits = f".{fraction:012d}".rstrip("0").rstrip(".")
        minutes, second = divmod(whole, 60)
        time = f"{minutes // 60:02d}:{minutes % 60:02d}:{second + leap:02d}"
        if not 1 <= _ZERO + day <= date.max.toordinal():
            raise ValueError(f"{self} has no year from 1 to 9999")
        return f"{date.fromordinal(_ZERO + day).isoformat()}T{time}{digits} {scale}"

    def seconds_since(self, other: Epoch) -> float:
        """Return the SI seconds from another instant to this one, rounded once."""
        return (self.tai_ps - other.tai_ps) / _PER_SECOND

    def later(self, seconds: float) -> Epoch:
        """Return the instant that many SI seconds later, or earlier where they are negative, to the picosecond.

        Raises:
            ValueError: The seconds are not finite, or more than 3000 years.
        """
        if not abs(seconds) < _LONGEST_S:
            raise ValueError(f"an epoch can't be moved by {seconds} s; it must be a time below {_LONGEST_S} s")
        return Epoch(self.tai_ps + round(Fraction(float(seconds)) * _PER_SECOND))

    @property
    def tt(self) -> tuple[float, float]:
        """Terrestrial Time as a Julian date in two parts: midnight, and the fraction of the day (1e-11 s)."""
        day, rest = divmod(self._clock("TT"), _DAY_S * _PER_SECOND)
        return _JULIAN_DATE_OF_ZERO + day, rest / (_DAY_S * _PER_SECOND)

    @property
    def tai_minus_utc_s(self) -> int:
        """TAI - UTC, whole seconds; within a leap second what it was before.

        Raises:
            ValueError: The instant is before 1972, when UTC did not yet go in whole seconds.
        """
        _, offsets, starts = _leap_seconds()
        index = bisect_right(starts, self.tai_ps) - 1
        if index < 0:
            raise ValueError(
                f"an epoch before 1972 ({self.text('TAI')}) has no UTC in whole seconds; take TAI or a later epoch"
            )
        return offsets[index]

    def _clock(self, scale: str) -> int:
        return self.tai_ps + _AFTER_TAI[scale]

    def _in_leap_second(self) -> bool:
        starts = _leap_seconds()[2]
        index = bisect_right(starts, self.tai_ps)
        return 0 < index < len(starts) and self.tai_ps >= starts[index] - _PER_SECOND


def now() -> Epoch:
    """Return the present instant by this machine's clock, to the second."""
    return Epoch.parse(f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S} UTC")


def _picoseconds(digits: str | None) -> int:
    """Return the picoseconds of a decimal fraction of a second."""
    if not digits:
        return 0
    return round(Fraction(int(digits) * _PER_SECOND, 10 ** len(digits))) if len(digits) > 12 else int(f"{digits:0<12}")


def _scale_of(text: str, named: str | None, zulu: bool, given: str | None) -> str:
    if given is None:
        if named is None and not zulu:
            raise ValueError(f"epoch {text!r} names no time scale; write {text.strip()} UTC, or TAI, GPS or TT")
        scale = _known(named or "UTC", f"epoch {text!r}")
        if zulu and scale != "UTC":
            raise ValueError(f"epoch {text!r}: Z stands for UTC, and {scale} is named too; leave one of them out")
        return scale
    scale = _known(given, f"epoch {text!r}")
    if named is not None and _known(named, f"epoch {text!r}") != scale:
        raise ValueError(f"epoch {text!r}: its time scale is {scale} elsewhere; leave one of them out")
    return scale


def _known(scale: str, what: str) -> str:
    if scale.upper() not in SCALES:
        raise ValueError(f"{what}: the time scale {scale!r} is unknown; it must be one of {', '.join(SCALES)}")
    return scale.upper()


def _day(text: str, found: re.Match[str]) -> int:
    """Return days since 2000-01-01."""
    year = int(found["year"])
    if year not in _YEARS:
        raise ValueError(f"epoch {text!r}: years go from {_YEARS[0]} to {_YEARS[-1]}")
    try:
        if found["day_of_year"] is None:
            return date(year, int(found["month"]), int(found["day"])).toordinal() - _ZERO
        first = date(year, 1, 1).toordinal()
        if not 1 <= int(found["day_of_year"]) <= date(year + 1, 1, 1).toordinal() - first:
            raise ValueError
    except ValueError:
        raise ValueError(f"epoch {text!r}: the calendar has no such day") from None
    return first + int(found["day_of_year"]) - 1 - _ZERO


@cache
def _leap_seconds() -> tuple[list[int], list[int], list[int]]:
    """Return for each whole TAI - UTC the first day of UTC, in days since 2000, the seconds, and `tai_ps` there."""
    import erfa

    table = [(int(year), int(month), round(float(offset))) for year, month, offset in erfa.leap_seconds.get()]
    days = [date(year, month, 1).toordinal() - _ZERO for year, month, _ in table if year >= 1972]
    offsets = [offset for year, _, offset in table if year >= 1972]
    starts = [(day * _DAY_S + offset) * _PER_SECOND for day, offset in zip(days, offsets, strict=True)]
    return days, offsets, starts


def _tai_minus_utc_on(day: int, text: str) -> int:
    days, offsets, _ = _leap_seconds()
    if day < days[0]:
        raise ValueError(f"epoch {text!r}: before 1972 UTC did not go in whole seconds; give the epoch in TAI")
    return offsets[bisect_right(days, day) - 1]
