"""CCSDS Tracking Data Messages (503.0-B, versions 1 and 2) in keyword = value notation, read as a sensor's readings."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import pi

import numpy as np

from relnav_sim.astro.epoch import SCALES, Epoch
from relnav_sim.near_names import nearest
from relnav_sim.printable import printable
from relnav_sim.recorded.number import number
from relnav_sim.recorded.readings import Column, Layout, ReadingsError
from relnav_sim.recorded.recording import LINE_ENDS, Recording
from relnav_sim.wording import listed

VERSION = "CCSDS_TDM_VERS"
"""The first keyword of such a file."""
_DEG = pi / 180
_LIGHT_M_S = 299792458.0
KINDS = {
    "RANGE": ("range", "m"),
    "ANGLE_1": ("azimuth", "rad"),
    "ANGLE_2": ("elevation", "rad"),
    "DOPPLER_INSTANTANEOUS": ("range_rate", "m/s"),
}
"""The keywords that are read, with name and SI unit of the channel that each fills."""

_NUMBERED = re.compile(r"(.*_)[1-9]")
_HEADER = ("CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
_CORRECTIONS = {"RANGE": "CORRECTION_RANGE", "ANGLE_1": "CORRECTION_ANGLE_1", "ANGLE_2": "CORRECTION_ANGLE_2"} | {
    "DOPPLER_INSTANTANEOUS": "CORRECTION_DOPPLER"
}
_ABERRATIONS = ("CORRECTION_ABERRATION_YEARLY", "CORRECTION_ABERRATION_DIURNAL")
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

_LONGEST_SHOWN = 60


@dataclass(frozen=True)
class _Record:
    """A line of data."""

    line: int
    keyword: str
    time: str
    value: str


@dataclass
class _Segment:
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
    data: list[_Record] = field(default_factory=list)

    def says(self, keyword: str, default: str = "") -> str:
        """Return what the metadata say, in capitals."""
        return self.meta[keyword][1].upper() if keyword in self.meta else default

    def at(self, keyword: str) -> str:
        """Return where a keyword stands; where the metadata begin if it is missing."""
        return f"{self.path}:{self.meta[keyword][0] if keyword in self.meta else self.line}"

    def refusal(self, keyword: str, sentence: str) -> ReadingsError:
        """Return the error about a keyword of the metadata: ``file:line: KEYWORD = value sentence``."""
        said = f"{keyword} = {_shown(self.meta[keyword][1])}" if keyword in self.meta else keyword
        return ReadingsError(f"{self.at(keyword)}: {said} {sentence}")

    def number(self, keyword: str) -> float:
        """Return a number of the metadata, 0 where it is missing."""
        if keyword not in self.meta:
            return 0.0
        try:
            return number(self.meta[keyword][1])
        except ValueError as error:
            raise self.refusal(keyword, str(error)) from None


def read_tdm(
    path: str,
    text: str,
    layout: Layout,
    epoch: Epoch | None,
    sort: bool = False,
    participants: Mapping[str, str] | None = None,
) -> Recording:
    """Return what a Tracking Data Message holds for the sensors of a campaign.

    RANGE fills a channel ``range``, ANGLE_1 and ANGLE_2 of type AZEL ``azimuth`` and ``elevation`` in the sensor's own
    axes (x as north, y as east, z down), DOPPLER_INSTANTANEOUS ``range_rate``. A range there and back is halved. What
    no sensor reads is left out, and a note says so.

    Args:
        path: The file's name, for messages.
        text: Its text.
        layout: The numbers of the readings of the campaign's sensors.
        epoch: The instant of the campaign's 0 s.
        sort: Whether lines of a keyword may be out of order, or stand there twice.
        participants: Which sensor a participant is, by the participant's name, where that is not the sensor's own.

    Raises:
        ReadingsError: The file can't be used.
    """
    segments, run = _segments(path, text)
    if epoch is None:
        raise ReadingsError(
            f"{path}:1: a TDM holds calendar dates, and the campaign has none; "
            "give it a truth.epoch, as 2010-07-27T00:00:00 UTC"
        )
    columns: list[Column] = []
    notes: dict[str, None] = {}
    for segment in segments:
        columns += _columns(segment, layout, epoch, sort, participants or {}, notes)
    return Recording(path, tuple(columns), run, None, None, tuple(notes))


def _segments(path: str, text: str) -> tuple[list[_Segment], int | None]:
    """Return the segments of a file, and the run that a comment in the header names."""
    segments: list[_Segment] = []
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
                segments.append(_Segment(path, line))
                seen = {}
            part = part_after
            continue
        keyword, equals, value = (each.strip() for each in said.partition("="))
        if not equals:
            raise ReadingsError(f"{where}: {_shown(said)} is no line of the form KEYWORD = value")
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
                raise ReadingsError(f"{where}: {keyword} has {_shown(value)}; it must be a time and a number")
            segments[-1].data.append(_Record(line, keyword, *words))
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
            raise ReadingsError(f"{where}: version {_shown(value)} of the TDM is unknown; 1.0 and 2.0 are read")
        return
    _check_keyword(where, keyword, frozenset(_HEADER), "the header")


def _check_keyword(where: str, keyword: str, known: frozenset[str], part: str) -> None:
    numbered = _NUMBERED.fullmatch(keyword)
    if (numbered[1] if numbered else keyword) in known:
        return
    meant = nearest(keyword, [f"{each}1" if each.endswith("_") else each for each in sorted(known)])
    hint = f"; did you mean {meant}?" if meant else ""
    raise ReadingsError(f"{where}: {_shown(keyword)} is no keyword of {part}{hint}")


def _columns(
    segment: _Segment,
    layout: Layout,
    epoch: Epoch,
    sort: bool,
    participants: Mapping[str, str],
    notes: dict[str, None],
) -> list[Column]:
    """Return what one segment holds for a sensor."""
    scale = segment.says("TIME_SYSTEM")
    if scale not in SCALES:
        raise segment.refusal("TIME_SYSTEM", f"is none of the time scales that are read, {listed(SCALES)}")
    instants = _instants(segment, scale, sort)
    by_keyword: dict[str, list[int]] = {}
    for place, record in enumerate(segment.data):
        by_keyword.setdefault(record.keyword, []).append(place)
    sensor, channels = _sensor(segment, [each for each in KINDS if each in by_keyword], layout, participants)
    for keyword, places in by_keyword.items():
        if keyword not in channels:
            whose = f"{sensor} does not read it" if keyword in KINDS else "no sensor of relnav reads it"
            notes[f"{segment.path}:{segment.data[places[0]].line}: {keyword} is left out: {whose}"] = None
    if segment.says("DATA_QUALITY") == "DEGRADED":
        notes[f"{segment.at('DATA_QUALITY')}: the data are degraded, as the file says"] = None
    columns = []
    for keyword, channel in channels.items():
        to_si = _conversion(segment, keyword, notes)
        records = [segment.data[place] for place in by_keyword[keyword]]
        columns.append(
            Column(
                sensor,
                channel,
                np.array([instants[place].seconds_since(epoch) for place in by_keyword[keyword]]),
                np.array([to_si(_value(segment.path, record)) for record in records]),
                segment.path,
                np.array([record.line for record in records]),
            )
        )
    return columns


def _value(path: str, record: _Record) -> float:
    try:
        return number(record.value)
    except ValueError as error:
        raise ReadingsError(f"{path}:{record.line}: {record.keyword} {_shown(record.value)} {error}") from None


def _instants(segment: _Segment, scale: str, sort: bool) -> list[Epoch]:
    """Return when each record is of; those of one keyword must rise."""

    def instant(where: str, text: str) -> Epoch:
        try:
            return Epoch.parse(text, scale)
        except ValueError as error:
            raise ReadingsError(f"{where}: {error}") from None

    limits = [
        instant(segment.at(key), segment.meta[key][1]) for key in ("START_TIME", "STOP_TIME") if key in segment.meta
    ]
    instants: list[Epoch] = []
    last: dict[str, tuple[Epoch, _Record]] = {}
    for record in segment.data:
        where = f"{segment.path}:{record.line}"
        now = instant(where, record.time)
        if len(limits) == 2 and not limits[0] <= now <= limits[1]:
            raise ReadingsError(f"{where}: {record.time} is not within START_TIME and STOP_TIME of the segment")
        before = last.get(record.keyword)
        if not sort and before is not None and now <= before[0]:
            what = "is given twice at" if now == before[0] else "goes back in time to"
            raise ReadingsError(
                f"{where}: {record.keyword} {what} {record.time}, after line {before[1].line}; "
                "put the lines in order, or give --sort"
            )
        last[record.keyword] = now, record
        instants.append(now)
    return instants


def _sensor(
    segment: _Segment, keywords: list[str], layout: Layout, participants: Mapping[str, str]
) -> tuple[str, dict[str, int]]:
    """Return the sensor that a segment is of, and the channels that the keywords fill."""
    filled = {
        name: {
            keyword: place
            for keyword in keywords
            for place, quantity in enumerate(quantities)
            if (quantity.name, quantity.unit) == KINDS[keyword]
        }
        for name, quantities in layout.items()
    }
    names = [value for keyword, (_, value) in segment.meta.items() if keyword.startswith("PARTICIPANT_")]
    if not names:
        raise segment.refusal("PARTICIPANT_1", "is missing")
    told = [participants[name] for name in names if name in participants]
    told = told or [name for name in names if name in layout]
    having = [name for name, channels in filled.items() if channels]
    able = [name for name in having if len(filled[name]) == len(keywords)]
    chosen = told or (having if len(having) == 1 else able)
    who = f"participants {listed([_shown(name) for name in names])}"
    if len(chosen) != 1 or chosen[0] not in layout:
        several = f"it may be of {listed(chosen)}" if len(chosen) > 1 else f"the sensors are {listed(list(layout))}"
        raise ReadingsError(
            f"{segment.path}:{segment.line}: which sensor the segment with {who} is of is not clear: {several}; "
            "give --participant NAME=SENSOR"
        )
    if not filled[chosen[0]]:
        measured = listed(list(dict.fromkeys(record.keyword for record in segment.data))) or "nothing"
        raise ReadingsError(
            f"{segment.path}:{segment.line}: the segment holds {measured}, of which the sensor {chosen[0]} reads none; "
            f"{listed(list(KINDS))} are read"
        )
    return chosen[0], filled[chosen[0]]


def _conversion(segment: _Segment, keyword: str, notes: dict[str, None]) -> Callable[[float], float]:
    """Return what makes a reading in SI of the numbers of a keyword."""
    mode = segment.says("MODE", "SEQUENTIAL")
    if mode != "SEQUENTIAL":
        raise segment.refusal("MODE", "is a difference of signals, which no sensor of relnav reads")
    correction = _correction(segment, keyword)
    if keyword.startswith("ANGLE"):
        if segment.says("ANGLE_TYPE") != "AZEL":
            raise segment.refusal(
                "ANGLE_TYPE",
                "is not read: only AZEL, azimuth and elevation in the sensor's own axes, is; convert the angles"
                if "ANGLE_TYPE" in segment.meta
                else "is missing",
            )
        if "PATH" in segment.meta:
            _legs(segment, keyword)
        for aberration in _ABERRATIONS:
            if segment.number(aberration) and segment.says("CORRECTIONS_APPLIED") != "YES":
                raise segment.refusal(aberration, "is not applied, and relnav can't; apply it")
        return lambda value: (value + correction) * _DEG
    legs = _legs(segment, keyword)
    if keyword == "DOPPLER_INSTANTANEOUS":
        if legs == 2:
            raise segment.refusal("PATH", "leaves open whether the rate is one way or there and back; give PATH = 1,2")
        return lambda value: (value + correction) * 1e3
    if segment.number("RANGE_MODULUS"):
        raise segment.refusal("RANGE_MODULUS", "leaves the range ambiguous; resolve it, and write 0")
    for delay in segment.meta:
        if delay.startswith(("TRANSMIT_DELAY_", "RECEIVE_DELAY_")) and segment.number(delay):
            raise segment.refusal(
                delay, "is not applied, and relnav does not; correct the range by it, and leave it out"
            )
    units = segment.says("RANGE_UNITS", "KM")
    if units not in ("KM", "S"):
        raise segment.refusal("RANGE_UNITS", "can't be turned to metres; km and s can")
    to_metres = 1e3 if units == "KM" else _LIGHT_M_S
    if legs == 2:
        notes[f"{segment.at('PATH')}: the range is there and back, and counts by half"] = None
    return lambda value: (value + correction) * to_metres / legs


def _correction(segment: _Segment, keyword: str) -> float:
    """Return what has to be added to a keyword's numbers, in their unit."""
    name = _CORRECTIONS[keyword]
    amount = segment.number(name)
    if not amount:
        return 0.0
    applied = segment.says("CORRECTIONS_APPLIED")
    if applied not in ("YES", "NO"):
        raise segment.refusal(name, "may be applied or not; say so with CORRECTIONS_APPLIED = YES or NO")
    return amount if applied == "NO" else 0.0


def _legs(segment: _Segment, keyword: str) -> int:
    """Return whether a signal goes one way between two participants or there and back: 1 or 2."""
    if "PATH" not in segment.meta:
        raise segment.refusal(
            "PATH", f"is missing: it says whether {keyword} is one way (1,2) or there and back (1,2,1)"
        )
    path = segment.says("PATH").replace(" ", "").split(",")
    if len(set(path)) != 2 or len(path) > 3 or any(a == b for a, b in pairwise(path)):
        raise segment.refusal("PATH", f"makes {keyword} no {KINDS[keyword][0].replace('_', ' ')} between two craft")
    return len(path) - 1


def _shown(text: str) -> str:
    return repr(printable(text, _LONGEST_SHOWN))
