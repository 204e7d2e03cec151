"""Units as the endings of column names: ``range_km`` is a range in kilometres."""

from __future__ import annotations

from math import pi

_LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3}
FACTORS: dict[str, dict[str, float]] = {
    "m": _LENGTHS,
    "rad": {
        "rad": 1.0,
        "mrad": 1e-3,
        "urad": 1e-6,
        "deg": pi / 180,
        "arcmin": pi / 10800,
        "arcsec": pi / 648000,
    },
    "m/s": {f"{unit}_s": factor for unit, factor in _LENGTHS.items()},
    "m/s^2": {f"{unit}_s2": factor for unit, factor in _LENGTHS.items()},
}
"""By SI unit: the endings that stand for a unit of the kind, and what a number in it is in SI."""


def ending(unit: str) -> str:
    """Return the ending that stands for an SI unit: ``m_s2`` for ``m/s^2``, empty for a pure number."""
    return unit.replace("/", "_").replace("^", "").replace(" ", "_")


def factors(unit: str) -> dict[str, float]:
    """Return the endings that a column may have whose SI unit is given, with what a number in it is in SI."""
    return FACTORS.get(unit, {ending(unit): 1.0})
