"""CCSDS Tracking Data Messages (503.0-B, versions 1 and 2) in keyword = value notation, as measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import pi

import numpy as np

from relnav_sim.astro.epoch import SCALES, Epoch
from relnav_sim.recorded.number import number
from relnav_sim.recorded.readings import Column, Layout, ReadingsError, quoted
from relnav_sim.recorded.recording import Recording
from relnav_sim.recorded.tdm_segments import Record, Segment, read_segments
from relnav_sim.wording import listed

_DEG = pi / 180
_LIGHT_M_S = 299792458.0
KINDS = {
    "RANGE": ("range", "m"),
    "ANGLE_1": ("azimuth", "rad"),
    "ANGLE_2": ("elevation", "rad"),
    "DOPPLER_INSTANTANEOUS": ("range_rate", "m/s"),
}
"""The keywords that are read, with name and SI unit of the channel that each fills."""

_CORRECTIONS = {
    "RANGE": "CORRECTION_RANGE",
    "ANGLE_1": "CORRECTION_ANGLE_1",
    "ANGLE_2": "CORRECTION_ANGLE_2",
    "DOPPLER_INSTANTANEOUS": "CORRECTION_DOPPLER",
}
_ABERRATIONS = ("CORRECTION_ABERRATION_YEARLY", "CORRECTION_ABERRATION_DIURNAL")


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
        layout: The numbers of the measurements of the campaign's sensors.
        epoch: The instant of the campaign's 0 s.
        sort: Whether lines of a keyword may be out of order, or stand there twice.
        participants: Which sensor a participant is, by the participant's name, where that is not the sensor's own.

    Raises:
        ReadingsError: The file can't be used.
    """
    segments, run = read_segments(path, text)
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


def _columns(
    segment: Segment,
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


def _value(path: str, record: Record) -> float:
    try:
        return number(record.value)
    except ValueError as error:
        raise ReadingsError(f"{path}:{record.line}: {record.keyword} {quoted(record.value)} {error}") from None


def _instants(segment: Segment, scale: str, sort: bool) -> list[Epoch]:
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
    last: dict[str, tuple[Epoch, Record]] = {}
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
    segment: Segment, keywords: list[str], layout: Layout, participants: Mapping[str, str]
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
    who = f"participants {listed([quoted(name) for name in names])}"
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


def _conversion(segment: Segment, keyword: str, notes: dict[str, None]) -> Callable[[float], float]:
    """Return what makes a measurement in SI of the numbers of a keyword."""
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


def _correction(segment: Segment, keyword: str) -> float:
    """Return what has to be added to a keyword's numbers, in their unit."""
    name = _CORRECTIONS[keyword]
    amount = segment.number(name)
    if not amount:
        return 0.0
    applied = segment.says("CORRECTIONS_APPLIED")
    if applied not in ("YES", "NO"):
        raise segment.refusal(name, "may be applied or not; say so with CORRECTIONS_APPLIED = YES or NO")
    return amount if applied == "NO" else 0.0


def _legs(segment: Segment, keyword: str) -> int:
    """Return whether a signal goes one way between two participants or there and back: 1 or 2."""
    if "PATH" not in segment.meta:
        raise segment.refusal(
            "PATH", f"is missing: it says whether {keyword} is one way (1,2) or there and back (1,2,1)"
        )
    path = segment.says("PATH").replace(" ", "").split(",")
    if len(set(path)) != 2 or len(path) > 3 or any(a == b for a, b in pairwise(path)):
        raise segment.refusal("PATH", f"makes {keyword} no {KINDS[keyword][0].replace('_', ' ')} between two craft")
    return len(path) - 1
