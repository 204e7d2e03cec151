"""What a caller states of a file of orbits, beside what the file says itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stated:
    """What a caller states; None: nothing.

    Attributes:
        frame: EME2000, ICRF, GCRF or ITRF.
        time_scale: UTC, TAI, GPS or TT.
        velocity_frame: The frame, or inertial.
        epoch: The epoch from which seconds count.
        interpolation: LAGRANGE, HERMITE or LINEAR.
        interpolation_degree: Its degree.
    """

    frame: str | None = None
    time_scale: str | None = None
    velocity_frame: str | None = None
    epoch: str | None = None
    interpolation: str | None = None
    interpolation_degree: int | None = None
