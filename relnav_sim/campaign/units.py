"""What a key or a value in another unit or by another word probably means: `a_m` for `a_km`, `sma_km`, `height_km`."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from typing import Any

from relnav_sim.campaign.problems import quoted

# Ending of a key -> (what it measures, its size in SI units).
_UNITS = {
    **{f"{name}_s2": ("acceleration", size) for name, size in (("m", 1.0), ("km", 1e3), ("mm", 1e-3), ("cm", 1e-2))},
    **{f"{name}_s": ("speed", size) for name, size in (("m", 1.0), ("km", 1e3), ("mm", 1e-3), ("cm", 1e-2))},
    **{"m": ("length", 1.0), "km": ("length", 1e3), "mm": ("length", 1e-3), "cm": ("length", 1e-2)},
    **{"deg": ("angle", pi / 180), "arcmin": ("angle", pi / 10_800), "arcsec": ("angle", pi / 648_000)},
    **{"rad": ("angle", 1.0), "mrad": ("angle", 1e-3), "urad": ("angle", 1e-6)},
    **{"s": ("time", 1.0), "ms": ("time", 1e-3), "min": ("time", 60.0), "h": ("time", 3600.0), "d": ("time", 86_400.0)},
    **{"kg": ("mass", 1.0), "g": ("mass", 1e-3), "t": ("mass", 1e3)},
}
_ELEMENTS = {
    **dict.fromkeys(("semi_major_axis", "semimajor_axis", "sma"), "a"),
    **dict.fromkeys(("eccentricity", "ecc"), "e"),
    **dict.fromkeys(("inclination", "incl", "inc"), "i"),
    **dict.fromkeys(("argument_of_perigee", "arg_perigee", "aop"), "argp"),
    **dict.fromkeys(("right_ascension", "right_ascension_of_ascending_node"), "raan"),
    **dict.fromkeys(("true_anomaly", "nu"), "ta"),
    **dict.fromkeys(("alt", "h", "height", "orbit_altitude", "mean_altitude", "perigee_altitude"), "altitude"),
}
_SEMI_MAJOR_AXIS = "a_km"


def meant_key(key: str, value: Any, known: Iterable[str]) -> str:
    """Return ``; did you mean ...`` for a key that is known in another unit or by another word, or nothing.

    Args:
        key: The unknown key.
        value: What it is given; numbers are told in the known key's unit.
        known: The keys of the section.
    """
    known = list(known)
    stem, unit = _split(key)
    if _SEMI_MAJOR_AXIS in known:
        stem = _ELEMENTS.get(stem, stem)
    for name in known:
        its_stem, its_unit = _split(name)
        if its_stem == stem and name != key and _measure(unit or its_unit) == _measure(its_unit):
            converted = _converted(value, unit or its_unit, its_unit)
            return f"; did you mean {quoted(name)}?" + (f" Write {name}: {_written(converted)}" if converted else "")
    return ""


def meant_value(key: str, value: Any, most: float) -> str:
    """Return ``; in metres? ...`` for a number of kilometres that is too large and would fit as metres, or nothing."""
    if _split(key)[1] == "km" and isinstance(value, int | float) and most < value <= 1e3 * most:
        return f"; in metres? Write {value / 1e3:.12g}"
    return ""


def _split(key: str) -> tuple[str, str]:
    """Return a key without its unit, and the unit; empty where it has none."""
    ends = [unit for unit in _UNITS if key.endswith(f"_{unit}")]
    unit = max(ends, key=len, default="")
    return (key.removesuffix(f"_{unit}") if unit else key), unit


def _measure(unit: str) -> str:
    return _UNITS[unit][0] if unit else ""


def _converted(value: Any, unit: str, wanted: str) -> Any:
    """Return a number, or a list of them, in the wanted unit; None for anything else."""
    if isinstance(value, list):
        inner = [_converted(one, unit, wanted) for one in value]
        return None if None in inner else inner
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if unit == wanted else value * _UNITS[unit][1] / _UNITS[wanted][1]


def _written(value: Any) -> str:
    return f"[{', '.join(map(_written, value))}]" if isinstance(value, list) else f"{value:.12g}"
