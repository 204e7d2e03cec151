"""Dotted paths such as ``sensors.radar.noise.kind`` or ``filters.alpha_0.5.alpha``, read and followed."""

from __future__ import annotations

import re
from typing import Any

from relnav_sim.campaign.problems import Path, dotted, quoted

_PART = re.compile(r"(?P<name>[^\[\]]*)(?P<positions>(\[[0-9]{1,6}\])*)")
MOST_PARTS = 16


class PathError(ValueError):
    """A dotted path that leads nowhere; the message is a sentence."""


def parse_path(text: str, data: Any) -> Path:
    """Return the keys and positions of a dotted path.

    Args:
        text: As people write it, ``a.b[0].c``.
        data: The data it is for. Keys may hold points themselves (a filter named ``alpha_0.5``): the longest
            key that stands in the data is taken.

    Raises:
        PathError: Not a path.
    """
    words = text.split(".")
    if len(words) > MOST_PARTS or not all(words):
        raise PathError(f"{quoted(text)} is not a path such as sensors.radar.noise")
    path: list[str | int] = []
    while words:
        taken = next(
            (count for count in range(len(words), 1, -1) if isinstance(data, dict) and ".".join(words[:count]) in data),
            1,
        )
        match = _PART.fullmatch(".".join(words[:taken]))
        if match is None or not match["name"]:
            raise PathError(f"{quoted(text)} is not a path such as sensors.radar.noise")
        parts: list[str | int] = [match["name"], *map(int, re.findall(r"[0-9]+", match["positions"]))]
        for part in parts:
            data = inside(data, part)
        path += parts
        words = words[taken:]
    return tuple(path)


def has(data: Any, part: str | int) -> bool:
    """Return whether there is a value at one key or position."""
    if isinstance(data, dict):
        return part in data
    return isinstance(data, list) and isinstance(part, int) and part < len(data)


def inside(data: Any, part: str | int) -> Any:
    """Return the value at one key or position, or None where there is none."""
    return data[part] if has(data, part) else None


def value_at(data: Any, path: Path) -> Any:
    """Return the value at a path, or None where there is none."""
    for part in path:
        data = inside(data, part)
    return data


def replaced(data: Any, path: Path, value: Any, done: Path = ()) -> Any:
    """Return a copy of the data with the value at a path set; what the path does not touch is shared.

    Missing sections on the way are made.

    Raises:
        PathError: The path leads through a value that is no section, or past the end of a list.
    """
    if not path:
        return value
    part, rest = path[0], path[1:]
    if isinstance(part, int):
        if not isinstance(data, list) or part >= len(data):
            raise PathError(f"{dotted((*done, part))} is not there: {_what(data)} stands at {quoted(dotted(done))}")
        return [*data[:part], replaced(data[part], rest, value, (*done, part)), *data[part + 1 :]]
    section = {} if data is None else data
    if not isinstance(section, dict):
        raise PathError(f"{dotted(done)} is {_what(data)}, so it cannot have the key {quoted(part)}")
    return {**section, part: replaced(section.get(part), rest, value, (*done, part))}


def _what(data: Any) -> str:
    if isinstance(data, list):
        return f"a list of {len(data)}"
    return "nothing" if data is None else "a section" if isinstance(data, dict) else "a single value"
