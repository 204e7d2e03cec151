"""Orbit Ephemeris Messages in keyword = value notation: CCSDS 502.0-B, versions 1, 2 and 3."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from relnav_sim.astro.epoch import Epoch
from relnav_sim.near_names import nearest
from relnav_sim.recorded.interpolation import Interpolation
from relnav_sim.recorded.segment import Place, Segment
from relnav_sim.wording import counted

VERSION_KEY = "CCSDS_OEM_VERS"
VERSIONS = ("1.0", "2.0", "3.0")
_HEADER = ("CREATION_DATE", "ORIGINATOR", "CLASSIFICATION", "MESSAGE_ID")
_NEEDED_HEADER = _HEADER[:2]
NEEDED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
"""What every segment's metadata must say."""
METADATA = (
    *NEEDED,
    "REF_FRAME_EPOCH",
    "USEABLE_START_TIME",
    "USEABLE_STOP_TIME",
    "INTERPOLATION",
    "INTERPOLATION_DEGREE",
)
_COVARIANCE_KEYS = ("EPOCH", "COV_REF_FRAME")
_COVARIANCE_ROWS = 6

Entry = tuple[str, Place]
"""A value, and the line it stands on."""


def read_oem(text: str, path: str) -> list[Segment]:
    """Return the segments of an OEM in keyword = value notation; covariance is checked for its form and left out.

    Args:
        text: The file's text.
        path: Its path, for errors.

    Raises:
        EphemerisError: The file is no OEM by the standard, or about what relnav does not read.
    """
    lines = _Lines(text, path)
    _read_header(lines)
    segments = []
    while lines.more:
        segments.append(_read_segment(lines))
    if not segments:
        raise lines.place.error("the file ends without a segment; a segment begins with META_START")
    return segments


class _Lines:
    """The lines of a file that say something, one ahead."""

    def __init__(self, text: str, path: str) -> None:
        self._path = path
        self._all: Iterator[tuple[int, str]] = (
            (number, line.strip())
            for number, line in enumerate(text.splitlines(), 1)
            if line.strip() and line.split(None, 1)[0] != "COMMENT"
        )
        self.place = Place(path, 1)
        self._next = next(self._all, None)

    @property
    def more(self) -> bool:
        return self._next is not None

    @property
    def ahead(self) -> str:
        """The next line; empty at the end."""
        return self._next[1] if self._next is not None else ""

    def take(self, wanted: str) -> str:
        """Return the next line, and make it the place of errors.

        Raises:
            EphemerisError: The file has ended.
        """
        if self._next is None:
            raise self.place.error(f"the file ends here; {wanted} should follow")
        self.place = Place(self._path, self._next[0])
        line = self._next[1]
        self._next = next(self._all, None)
        return line

    def take_entry(self, wanted: str, known: tuple[str, ...]) -> tuple[str, str]:
        """Return keyword and value of the next line.

        Raises:
            EphemerisError: It is no such line, or the keyword is not one of the known.
        """
        line = self.take(wanted)
        key, equals, value = (part.strip() for part in line.partition("="))
        if not equals:
            raise self.place.error(f"{line!r} stands where {wanted} should")
        if key not in known:
            near = nearest(key, known)
            raise self.place.error(f"{key!r} is no keyword of this part" + (f"; did you mean {near}?" if near else ""))
        if not value:
            raise self.place.error(f"{key} has no value")
        return key, value


def _read_header(lines: _Lines) -> None:
    _, version = lines.take_entry(f"{VERSION_KEY} = 2.0", (VERSION_KEY,))
    check_version(version, lines.place)
    found: set[str] = set()
    while lines.more and lines.ahead != "META_START":
        key, _ = lines.take_entry("META_START or a keyword of the header", _HEADER)
        if key in found:
            raise lines.place.error(f"{key} stands here a second time")
        found.add(key)
    for key in _NEEDED_HEADER:
        if key not in found:
            raise lines.place.error(f"the header ends here without {key}")


def check_version(version: str, place: Place) -> None:
    """Refuse a version that relnav does not read.

    Raises:
        EphemerisError: It is another one.
    """
    if version not in VERSIONS:
        raise place.error(f"the version {version} is not read; it must be one of {', '.join(VERSIONS)}")


def _read_segment(lines: _Lines) -> Segment:
    if lines.take("META_START") != "META_START":
        raise lines.place.error("META_START, or the end of the file, should stand here")
    start = lines.place
    entries: dict[str, Entry] = {}
    while lines.ahead != "META_STOP":
        key, value = lines.take_entry("META_STOP or a keyword of the metadata", METADATA)
        if key in entries:
            raise lines.place.error(f"{key} stands here a second time")
        entries[key] = value, lines.place
    lines.take("META_STOP")
    metadata = read_metadata(entries, lines.place)
    rows = Rows(metadata)
    while lines.more and lines.ahead not in ("META_START", "COVARIANCE_START"):
        words = lines.take("a state").split()
        if len(words) not in (7, 10):
            raise lines.place.error(
                f"{len(words)} words stand where an epoch and 6 numbers (with accelerations 9) should"
            )
        rows.add(lines.place, words[0], words[1:7], words[7:])
    if lines.ahead == "COVARIANCE_START":
        _skip_covariance(lines, metadata.scale)
    return rows.segment(start)


def _skip_covariance(lines: _Lines, scale: str) -> None:
    """Read covariance matrices for their form alone: keywords, then six rows of a lower triangle."""
    lines.take("COVARIANCE_START")
    while lines.ahead != "COVARIANCE_STOP":
        found: set[str] = set()
        while "=" in lines.ahead or not found:
            key, value = lines.take_entry("EPOCH = of a covariance", _COVARIANCE_KEYS)
            if key in found:
                raise lines.place.error(f"{key} stands here a second time")
            if key == "EPOCH":
                lines.place.epoch(value, scale)
            found.add(key)
        if "EPOCH" not in found:
            raise lines.place.error("a covariance needs its EPOCH")
        for row in range(1, _COVARIANCE_ROWS + 1):
            words = lines.take(f"row {row} of a covariance").split()
            if len(words) != row:
                here = f"{counted(len(words), 'word')} {'stands' if len(words) == 1 else 'stand'}"
                raise lines.place.error(f"{here} where row {row} of a covariance should, with {counted(row, 'number')}")
            for word in words:
                lines.place.number(word, "an element of a covariance")
    lines.take("COVARIANCE_STOP")


@dataclass(frozen=True)
class Metadata:
    """What a segment says of itself, in either notation.

    Attributes:
        entries: Keyword to value and place.
        scale: The time scale.
        frame: The frame.
    """

    entries: Mapping[str, Entry]
    scale: str
    frame: str

    def epoch(self, key: str) -> Epoch | None:
        """Return the epoch of a keyword; None where it is not given."""
        if key not in self.entries:
            return None
        text, place = self.entries[key]
        return place.epoch(text, self.scale)


def read_metadata(entries: Mapping[str, Entry], end: Place) -> Metadata:
    """Return the metadata of a segment.

    Args:
        entries: Keyword to value and place.
        end: Where the metadata end, the place of what is missing.

    Raises:
        EphemerisError: Something needed is missing, or not what relnav reads.
    """
    for key in NEEDED:
        if key not in entries:
            raise end.error(f"the metadata end here without {key}")
    centre, place = entries["CENTER_NAME"]
    if centre.upper() != "EARTH":
        raise place.error(f"CENTER_NAME is {centre}; relnav reads orbits about the EARTH only")
    frame, place = entries["REF_FRAME"]
    frame = place.frame(frame)
    scale, place = entries["TIME_SYSTEM"]
    return Metadata(entries, place.scale(scale), frame)


@dataclass
class Rows:
    """The states of a segment as they come in, in either notation."""

    metadata: Metadata
    _lines: list[int] = field(default_factory=list)
    _epochs: list[Epoch] = field(default_factory=list)
    _states: list[list[float]] = field(default_factory=list)

    def add(self, place: Place, epoch: str, state: list[str], acceleration: list[str]) -> None:
        """Read a state, in km and km/s; an acceleration is checked to be numbers.

        Raises:
            EphemerisError: Something is no number, or not of this time.
        """
        at = place.epoch(epoch, self.metadata.scale)
        if self._epochs and at <= self._epochs[-1]:
            how = "is the same as" if at == self._epochs[-1] else "comes before"
            raise place.error(f"the epoch {epoch} {how} the one of line {self._lines[-1]}; epochs must increase")
        values = [place.number(word, "a position or velocity") for word in state]
        for word in acceleration:
            place.number(word, "an acceleration")
        self._lines.append(place.line)
        self._epochs.append(at)
        self._states.append(values)

    def segment(self, start: Place) -> Segment:
        """Return the segment.

        Raises:
            EphemerisError: It has no rows, or its times do not fit together.
        """
        if not self._epochs:
            raise start.error("the segment holds no states")
        metadata = self.metadata
        first, last = self._epochs[0], self._epochs[-1]
        begin, end = metadata.epoch("START_TIME"), metadata.epoch("STOP_TIME")
        assert begin is not None and end is not None  # the metadata were checked for them
        if begin > end:
            raise metadata.entries["STOP_TIME"][1].error("STOP_TIME is before START_TIME")
        for at, line in ((first, self._lines[0]), (last, self._lines[-1])):
            if not begin <= at <= end:
                raise Place(start.path, line).error("this epoch is outside START_TIME to STOP_TIME of its segment")
        usable = metadata.epoch("USEABLE_START_TIME") or first, metadata.epoch("USEABLE_STOP_TIME") or last
        for key, at in zip(("USEABLE_START_TIME", "USEABLE_STOP_TIME"), usable, strict=True):
            if key in metadata.entries and not begin <= at <= end:
                raise metadata.entries[key][1].error(f"{key} is outside START_TIME to STOP_TIME")
        if usable[0] > usable[1]:
            place = (metadata.entries.get("USEABLE_STOP_TIME") or metadata.entries["USEABLE_START_TIME"])[1]
            raise place.error("the useable time ends before it begins")
        return Segment(
            line=start.line,
            lines=tuple(self._lines),
            epochs=tuple(self._epochs),
            states=np.array(self._states) * 1e3,
            frame=metadata.frame,
            scale=metadata.scale,
            useable=(max(usable[0], first), min(usable[1], last)),
            interpolation=self._interpolation(),
            name=metadata.entries["OBJECT_ID"][0],
            notes=tuple(self._missing_rows(start.path, begin, end)),
        )

    def _missing_rows(self, path: str, begin: Epoch, end: Epoch) -> Iterator[str]:
        """Yield where rows end long before the metadata say: such a file may be cut short."""
        epochs = self._epochs
        step_s = float(np.median([late.seconds_since(early) for early, late in pairwise(epochs)] or [0.0]))
        for key, line, short_s in (
            ("START_TIME", self._lines[0], epochs[0].seconds_since(begin)),
            ("STOP_TIME", self._lines[-1], end.seconds_since(epochs[-1])),
        ):
            if short_s > max(step_s, 1.0):
                where = "first row stands after" if key == "START_TIME" else "last row stands before"
                yield f"{path}:{line}: the {where} {key} by {short_s:.6g} s: rows may be missing."

    def _interpolation(self) -> Interpolation | None:
        entries = self.metadata.entries
        if "INTERPOLATION" not in entries:
            if "INTERPOLATION_DEGREE" in entries:
                raise entries["INTERPOLATION_DEGREE"][1].error("a degree is given without INTERPOLATION")
            return None
        kind, place = entries["INTERPOLATION"]
        return place.interpolation(kind, *entries.get("INTERPOLATION_DEGREE", (None, None)))
