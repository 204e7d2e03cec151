"""What a reader of a format hands over: segments of an orbit as the file has them, with the lines they stand on."""

from __future__ import annotations

import re
from dataclasses import dataclass

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import SCALES, Epoch
from relnav_sim.recorded.errors import EphemerisError, at_line
from relnav_sim.recorded.interpolation import Interpolation, Kind
from relnav_sim.recorded.number import number

_ITRF = re.compile(r"ITRF([ -]?\d{2,4})?")
_KINDS: dict[str, Kind] = {"LAGRANGE": "LAGRANGE", "HERMITE": "HERMITE", "LINEAR": "LINEAR"}
_MOST_DEGREE = 30
_LARGEST = 1e15
"""In any unit of position, velocity, acceleration or time far beyond what orbits about the Earth have."""


@dataclass(frozen=True)
class Segment:
    """A segment of an orbit that may be interpolated.

    Attributes:
        line: The line it begins on.
        lines: The line of each of its T rows.
        epochs: Their epochs.
        states: Their states (T, 6), m and m/s, as in the file.
        frame: The frame, by the file's name.
        scale: The time scale of the file.
        useable: First and last epoch for which the segment is meant.
        interpolation: How it is meant to be interpolated; None: the file does not say.
        name: What the file calls the object; empty: nothing.
        inertial_velocity: Whether the velocities are those seen from inertial space, although the frame turns.
        notes: What a reader of results should know of it.
    """

    line: int
    lines: tuple[int, ...]
    epochs: tuple[Epoch, ...]
    states: Array
    frame: str
    scale: str
    useable: tuple[Epoch, Epoch]
    interpolation: Interpolation | None = None
    name: str = ""
    inertial_velocity: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Place:
    """A line of a file, for what is wrong with it."""

    path: str
    line: int

    def error(self, sentence: str) -> EphemerisError:
        """Return the error."""
        return at_line(self.path, self.line, sentence)

    def epoch(self, text: str, scale: str) -> Epoch:
        """Return the epoch of a text.

        Raises:
            EphemerisError: It is none.
        """
        try:
            return Epoch.parse(text, scale)
        except ValueError as error:
            raise self.error(str(error)) from None

    def number(self, text: str, what: str) -> float:
        """Return the number of a text.

        Raises:
            EphemerisError: It is none, or not finite.
        """
        try:
            value = number(text)
        except ValueError:
            raise self.error(f"{what} is {text!r}; it must be a finite number") from None
        if abs(value) > _LARGEST:
            raise self.error(f"{what} is {text!r}; no orbit about the Earth has that")
        return value

    def frame(self, name: str) -> str:
        """Return the name of a frame that relnav reads, in capitals.

        Raises:
            EphemerisError: It is another frame.
        """
        known = name.strip().upper()
        if is_inertial(known) or _ITRF.fullmatch(known):
            return known
        raise self.error(f"the frame {name!r} is not read; it must be EME2000, ICRF, GCRF or ITRF")

    def scale(self, name: str) -> str:
        """Return a time scale.

        Raises:
            EphemerisError: It is another one.
        """
        if name.strip().upper() not in SCALES:
            raise self.error(f"the time system {name!r} is not read; it must be one of {', '.join(SCALES)}")
        return name.strip().upper()

    def interpolation(self, name: str, degree: str | None, degree_at: Place | None = None) -> Interpolation:
        """Return the interpolation that a file or a caller names.

        Args:
            name: Its name.
            degree: Its degree; None: not given.
            degree_at: Where the degree stands; None: here.

        Raises:
            EphemerisError: There is no such interpolation, or no degree or an impossible one.
        """
        kind = _KINDS.get(name.strip().upper())
        if kind is None:
            raise self.error(f"the interpolation {name!r} is not known; it must be LAGRANGE, HERMITE or LINEAR")
        if kind == "LINEAR":
            if degree not in (None, "1"):
                raise (degree_at or self).error(f"a LINEAR interpolation has degree 1, not {degree}")
            return Interpolation(kind, 1)
        if degree is None:
            raise self.error(f"the interpolation {kind} needs a degree")
        if not re.fullmatch(r"\d+", degree, re.ASCII) or not 1 <= int(degree[:9]) <= _MOST_DEGREE:
            raise (degree_at or self).error(
                f"the interpolation degree is {degree!r}; it must be a whole number from 1 to {_MOST_DEGREE}"
            )
        if kind == "HERMITE" and int(degree) < 2:
            raise (degree_at or self).error(f"a HERMITE interpolation has at least degree 2, not {degree}")
        return Interpolation(kind, int(degree))


def is_inertial(frame: str) -> bool:
    """Return whether a frame does not turn: EME2000 (J2000), or ICRF and GCRF, which are the same at the Earth."""
    return frame in ("EME2000", "J2000") or is_celestial(frame)


def is_realisation(frame: str) -> bool:
    """Return whether a frame is one realisation of the ITRF, as ITRF2014 or ITRF-93."""
    return frame != "ITRF" and _ITRF.fullmatch(frame) is not None


def is_celestial(frame: str) -> bool:
    """Return whether a frame is the celestial one, from which EME2000 differs by the frame bias."""
    return re.fullmatch(r"ICRF\d?|GCRF", frame) is not None
