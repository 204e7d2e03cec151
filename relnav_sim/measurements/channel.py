"""One number of a sensor's measurement: its name and unit, for reports and results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """One number of a measurement.

    Attributes:
        name: A word for it, as in names of results: ``range``.
        unit: Its SI unit, ``m``; ``rad`` for an angle.
        label: What it is, in words.
        angle: Whether it is an angle, whose differences are wrapped.
    """

    name: str
    unit: str
    label: str
    angle: bool = False
