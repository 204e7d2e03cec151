"""The lines of a CCSDS Tracking Data Message (503.0-B, versions 1 and 2) in keyword = value notation: its segments."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from relnav_sim.near_names import nearest
from relnav_sim.recorded.number import number
from relnav_sim.recorded.readings import ReadingsError, quoted
from relnav_sim.recorded.recording import LINE_ENDS

VERSION = "CCSDS_TDM_VERS"
"""The first keyword of such a file."""
_NUMBERED = re.compile(r"(.*_)[1-9]")
_HEADER = ("CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
_OF_METADATA = """
    TRACK_ID DATA_TYPES TIME_SYSTEM START_TIME STOP_TIME PARTICIPANT_ MODE PATH PATH_ EPHEMERIS_NAME_ TRANSMIT_BAND
    RECEIVE_BAND TURNAROUND_NUMERATOR TURNAROUND_DENOMINATOR TIMETAG_REF INTEGRATION_INTERVAL INTEGRATION_REF
    FREQ_OFFSET RANGE_MODE RANGE_MODULUS RANGE_UNITS ANGLE_TYPE REFERENCE_FRAME INTERPOLATION INTERPOLATION_DEGREE
    DOPPLER_COUNT_BIAS DOPPLER_COUNT_SCALE DOPPLER_COUNT_ROLLOVER TRANSMIT_DELAY_ RECEIVE_DELAY_ DATA_QUALITY
    CORRECTION_ANGLE_ CORRECTION_DOPPLER CORRECTION_MAG CORRECTION_MAGNITUDE CORRECTION_RANGE CORRECTION_RCS
    CORRECTION_RECEIVE CORRECTION_TRANSMIT CORRECTION_ABERRATION_YEARLY CORRECTION_ABERRATION_DIURNAL
    CORRECTIONS_APPLIED
"""
_OF_DATA = """
    RANGE ANGLE_ DOPPLER_INSTANTANEOUS DOPPLER_INTEGRATED DOPPLER_COUNT CARRIER_POWER PC_N0 PR_N0 PHASE_COUNT
    RECEIVE_FREQ RECEIVE_FREQ_ TRANSMIT_FREQ_ TRANSMIT_FREQ_RATE_ RECEIVE_PHASE_CT_ TRANSMIT_PHASE_CT_ DOR VLBI_DELAY
    CLOCK_BIAS CLOCK_DRIFT STEC TROPO_DRY TROPO_WET PRESSURE RHUMIDITY TEMPERATURE MAG RCS
"""
_META, _DATA = frozenset(_OF_METADATA.split()), frozenset(_OF_DATA.split())
"""The keywords of the standard, those that end in a number without it."""


@dataclass(frozen=True)
class Record:
    """A line of data."""

    line: int
    keyword: str
    time: str
    value: str


@dataclass
class Segment:
    """Metadata, by keyword with their lines, and the data that they hold for.

    Attributes:
        path: The file's name.
        line: Where the metadata begin.
        meta: Lines and values.
        data: The records.
    """

    path: str
    line: int
    meta: dict[str, tuple[int, str]] = field(default_factory=dict)
    data: list[Record] = field(default_factory=list)

    def says(self, keyword: str, default: str = "") -> str:
        """Return what the metadata say, in capitals."""
        return self.meta[keyword][1].upper() if keyword in self.meta else default

    def at(self, keyword: str) -> str:
        """Return where a keyword stands; where the metadata begin if it is missing."""
        return f"{self.path}:{self.meta[keyword][0] if keyword in self.meta else self.line}"

    def refusal(self, keyword: str, sentence: str) -> ReadingsError:
        """Return the error about a keyword of the metadata: ``file:line: KEYWORD = value sentence``."""
        said = f"{keyword} = {quoted(self.meta[keyword][1])}" if keyword in self.meta else keyword
        return ReadingsError(f"{self.at(keyword)}: {said} {sentence}")

    def number(self, keyword: str) -> float:
        """Return a number of the metadata, 0 where it is missing."""
        if keyword not in self.meta:
            return 0.0
        try:
            return number(self.meta[keyword][1])
        except ValueError as error:
            raise self.refusal(keyword, str(error)) from None


def read_segments(path: str, text: str) -> tuple[list[Segment], int | None]:
    """Return the segments of a file, and the run that a comment in the header names.

    Args:
        path: The file's name, for messages.
        text: Its text.

    Raises:
        ReadingsError: The file does not keep to the form.
    """
    segments: list[Segment] = []
    run = None
    part = "header"
    last = 1
    seen: dict[str, int] = {}
    for line, content in enumerate(LINE_ENDS.split(text), start=1):
        said = content.strip()
        if not said:
            continue
        last = line
        if said == "COMMENT" or said.startswith(("COMMENT ", "COMMENT\t")):
            if part == "header" and (found := re.fullmatch(r"COMMENT\s+run:\s*(\d{1,9})", said, re.ASCII)):
                run = int(found[1])
            continue
        where = f"{path}:{line}"
        if said in _TURNS:
            before, part_after = _TURNS[said]
            if part not in before:
                raise ReadingsError(f"{where}: {said} stands in the {part}; a segment is META_START to DATA_STOP")
            if said == "META_START":
                segments.append(Segment(path, line))
                seen = {}
            part = part_after
            continue
        keyword, equals, value = (each.strip() for each in said.partition("="))
        if not equals:
            raise ReadingsError(f"{where}: {quoted(said)} is no line of the form KEYWORD = value")
        if part == "header":
            _check_header(where, keyword, value, line, seen)
        elif part == "metadata":
            _check_keyword(where, keyword, _META, "the metadata")
            if keyword in segments[-1].meta:
                first = segments[-1].meta[keyword][0]
                raise ReadingsError(f"{where}: {keyword} is given twice, first in line {first}")
            segments[-1].meta[keyword] = line, value
        elif part == "data":
            _check_keyword(where, keyword, _DATA, "the data")
            words = value.split()
            if len(words) != 2:
                raise ReadingsError(f"{where}: {keyword} has {quoted(value)}; it must be a time and a number")
            segments[-1].data.append(Record(line, keyword, *words))
        else:
            raise ReadingsError(f"{where}: {keyword} stands {part}; a segment is META_START to DATA_STOP")
    if not segments or part != "after the data":
        raise ReadingsError(f"{path}:{last}: the file ends in the {part}; a segment is META_START to DATA_STOP")
    return segments, run


_TURNS = {
    "META_START": (("header", "after the data"), "metadata"),
    "META_STOP": (("metadata",), "between metadata and data"),
    "DATA_START": (("between metadata and data",), "data"),
    "DATA_STOP": (("data",), "after the data"),
}
"""What begins and ends the parts of a segment: where it may stand, and where one is after it."""


def _check_header(where: str, keyword: str, value: str, line: int, seen: dict[str, int]) -> None:
    if not seen and keyword != VERSION:
        raise ReadingsError(f"{where}: a TDM begins with {VERSION} = 2.0")
    if keyword in seen:
        raise ReadingsError(f"{where}: {keyword} is given twice, first in line {seen[keyword]}")
    seen[keyword] = line
    if keyword == VERSION:
        if value not in ("1.0", "2.0"):
            raise ReadingsError(f"{where}: version {quoted(value)} of the TDM is unknown; 1.0 and 2.0 are read")
        return
    _check_keyword(where, keyword, frozenset(_HEADER), "the header")


def _check_keyword(where: str, keyword: str, known: frozenset[str], part: str) -> None:
    numbered = _NUMBERED.fullmatch(keyword)
    if (numbered[1] if numbered else keyword) in known:
        return
    meant = nearest(keyword, [f"{each}1" if each.endswith("_") else each for each in sorted(known)])
    hint = f"; did you mean {meant}?" if meant else ""
    raise ReadingsError(f"{where}: {quoted(keyword)} is no keyword of {part}{hint}")
