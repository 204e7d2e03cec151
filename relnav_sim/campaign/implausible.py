"""Numbers of a campaign that no flight has: most often a slip of the unit, or an exponent too many."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_MOST: Mapping[str, tuple[float, str]] = {
    "m2_s3": (1e4, "m^2/s^3"),
    "m_s2": (1e3, "m/s^2"),
    "m_s": (1e5, "m/s"),
    "kg": (1e7, "kg"),
    "km": (1e7, "km"),
    "deg": (1e3, "deg"),
    "arcsec": (3.6e6, "arcsec"),
    "m": (1e9, "m"),
    "s": (1e9, "s"),
}
"""The most that is asked no question, far beyond what spacecraft meet, by the end of a key: the longest that fits."""
_WITHOUT_END = ("tau_s", "until_s")
"""Keys of numbers that may be meant to be huge, as infinity is not taken: a bias, to the end of the run."""
_FROM_TO = ("windows_s", "range_limits_m")
"""Keys of pairs of which the second number may be: to the end of the run, no limit."""


def implausible_values(content: Mapping[str, Any]) -> list[str]:
    """Return a sentence on each number of a campaign that is too large for its unit.

    Args:
        content: The campaign's content, as `Campaign.content`.

    Example:
        >>> implausible_values({"filters": {"ekf": {"process_noise": {"acceleration_psd_m2_s3": 1e60}}}})
        ['filters.ekf.process_noise.acceleration_psd_m2_s3: 1e+60 m^2/s^3 is implausibly large; check the unit.']
    """
    found = []
    for path, value in _numbers((), content):
        most, unit = _most(path)
        if most < abs(value) < math.inf:
            found.append(f"{'.'.join(path)}: {value:g} {unit} is implausibly large; check the unit.")
    return list(dict.fromkeys(found))


def _numbers(path: tuple[str, ...], value: Any) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield every number with its keys; those of a list have the list's."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _numbers((*path, str(key)), part)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        pair = _name(path) in _FROM_TO and len(value) == 2 and not any(isinstance(part, Sequence) for part in value)
        for part in value[:1] if pair else value:
            yield from _numbers(path, part)
    elif isinstance(value, int | float) and not isinstance(value, bool) and _name(path) not in _WITHOUT_END:
        yield path, float(value)


def _name(path: Sequence[str]) -> str:
    return path[-1].rpartition(".")[2] if path else ""


def _most(path: Sequence[str]) -> tuple[float, str]:
    words = _name(path).split("_")
    ends = ("_".join(words[place:]) for place in range(1, len(words)))
    return next((_MOST[end] for end in ends if end in _MOST), (math.inf, ""))
