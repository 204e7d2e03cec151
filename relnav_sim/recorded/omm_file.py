"""Orbit Mean-elements Messages (CCSDS 502.0-B) of SGP4's elements, keyword = value or XML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from relnav_sim.recorded.number import number
from relnav_sim.recorded.readings import quoted

_FIXED = {
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP", "SGP/SGP4"),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "CENTER_NAME": ("EARTH",),
}
"""Keywords whose values relnav reads no others of."""
_NUMBERS = {
    "mean_motion_rev_day": ("MEAN_MOTION", "rev/day"),
    "e": ("ECCENTRICITY", ""),
    "i_deg": ("INCLINATION", "deg"),
    "raan_deg": ("RA_OF_ASC_NODE", "deg"),
    "argp_deg": ("ARG_OF_PERICENTER", "deg"),
    "mean_anomaly_deg": ("MEAN_ANOMALY", "deg"),
    "bstar": ("BSTAR", ""),
}
"""Keyword and unit of each number by the key that campaigns have for it; the unit may be said again behind it."""


def elements_in(text: str, path: str) -> dict[str, str | float]:
    """Return the mean elements of an OMM by the keys that campaigns have for them.

    Args:
        text: The file's text.
        path: Its path, for errors.

    Raises:
        ValueError: It is no such message; says the line where one is to blame.
    """
    entries = _xml_entries(text, path) if text.lstrip().startswith("<") else _kvn_entries(text, path)
    for key, known in _FIXED.items():
        found = _entry(entries, key, path)
        if found.value.upper() not in known:
            raise ValueError(
                f"{found.place}: {key} is {found.value}; relnav reads mean elements with {' or '.join(known)}"
            )
    read: dict[str, str | float] = {"epoch": f"{_entry(entries, 'EPOCH', path).value.rstrip('Z')} UTC"}
    for name, (key, unit) in _NUMBERS.items():
        found = _entry(entries, key, path)
        if unit and found.unit.casefold() not in ("", unit):
            raise ValueError(f"{found.place}: {key} is in {quoted(found.unit)}; it must be in {unit}")
        try:
            read[name] = number(found.value)
        except ValueError:
            raise ValueError(f"{found.place}: {key} is {quoted(found.value)}; it must be a number") from None
    return read


class _Entry(NamedTuple):
    """What a keyword says, its unit if there is one, and where."""

    value: str
    unit: str
    place: str


def _entry(entries: Mapping[str, _Entry], key: str, path: str) -> _Entry:
    if key not in entries or not entries[key].value:
        raise ValueError(f"{entries[key].place if key in entries else path}: the OMM gives no {key}")
    return entries[key]


def _kvn_entries(text: str, path: str) -> Mapping[str, _Entry]:
    entries: dict[str, _Entry] = {}
    for at, line in enumerate(text.splitlines(), start=1):
        key, equals, value = (part.strip() for part in line.partition("="))
        if not line.strip() or line.split()[0] == "COMMENT":
            continue
        if not equals:
            raise ValueError(f"{path}:{at}: {quoted(line.strip())} stands where 'KEYWORD = value' should")
        if not entries and key != "CCSDS_OMM_VERS":
            raise ValueError(f"{path}:{at}: an OMM begins with CCSDS_OMM_VERS = 2.0")
        if key in entries and key != "USER_DEFINED":
            raise ValueError(f"{path}:{at}: {key} stands here a second time")
        value, _, unit = value.partition("[")
        entries[key] = _Entry(value.strip(), unit.rstrip("] "), f"{path}:{at}")
    if not entries:
        raise ValueError(f"{path}:1: the file is empty")
    return entries


def _xml_entries(text: str, path: str) -> Mapping[str, _Entry]:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path}: document types and entities are not read")
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}:{error.position[0]}: this is not valid XML: {error}") from None
    messages = [each for each in root.iter() if each.tag.rpartition("}")[2] == "omm"]
    if len(messages) != 1:
        raise ValueError(f"{path} holds {len(messages)} OMMs; relnav reads files of one")
    return {
        each.tag.rpartition("}")[2]: _Entry((each.text or "").strip(), each.get("units", ""), path)
        for each in messages[0].iter()
    }
