"""Orbit Mean-elements Messages (CCSDS 502.0-B) of SGP4's elements, keyword = value or XML."""

from __future__ import annotations

from collections.abc import Mapping

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
    "mean_motion_rev_day": "MEAN_MOTION",
    "e": "ECCENTRICITY",
    "i_deg": "INCLINATION",
    "raan_deg": "RA_OF_ASC_NODE",
    "argp_deg": "ARG_OF_PERICENTER",
    "mean_anomaly_deg": "MEAN_ANOMALY",
    "bstar": "BSTAR",
}


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
        value, place = _entry(entries, key, path)
        if value.upper() not in known:
            raise ValueError(f"{place}: {key} is {value}; relnav reads mean elements with {' or '.join(known)}")
    epoch, place = _entry(entries, "EPOCH", path)
    read: dict[str, str | float] = {"epoch": f"{epoch.rstrip('Z')} UTC"}
    for name, key in _NUMBERS.items():
        value, place = _entry(entries, key, path)
        try:
            read[name] = number(value)
        except ValueError:
            raise ValueError(f"{place}: {key} is {quoted(value)}; it must be a number") from None
    return read


Entries = Mapping[str, tuple[str, str]]
"""Value and place by keyword."""


def _entry(entries: Entries, key: str, path: str) -> tuple[str, str]:
    if key not in entries or not entries[key][0]:
        raise ValueError(f"{entries[key][1] if key in entries else path}: the OMM gives no {key}")
    return entries[key]


def _kvn_entries(text: str, path: str) -> Entries:
    entries: dict[str, tuple[str, str]] = {}
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
        entries[key] = value.partition("[")[0].strip(), f"{path}:{at}"
    if not entries:
        raise ValueError(f"{path}:1: the file is empty")
    return entries


def _xml_entries(text: str, path: str) -> Entries:
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
    return {each.tag.rpartition("}")[2]: ((each.text or "").strip(), path) for each in messages[0].iter()}
