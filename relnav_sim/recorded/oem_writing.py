"""Orbit Ephemeris Messages, written: keyword = value notation, version 2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.printable import printable

_TRIANGLE = np.tril_indices(6)


@dataclass(frozen=True)
class OemOrbit:
    """An orbit to be written.

    Attributes:
        name: The object's name.
        epoch: When the times count from.
        times_s: SI seconds from the epoch, increasing, (T,).
        states: ECI (EME2000), m and m/s, (T, 6).
        covariance: The same axes, SI units, (T, 6, 6); None: none.
        comments: What readers should know, a sentence each.
    """

    name: str
    epoch: Epoch
    times_s: Array
    states: Array
    covariance: Array | None = None
    comments: Sequence[str] = ()


def write_oem(path: Path, orbit: OemOrbit, created: Epoch) -> None:
    """Write an orbit with all digits that a number of 64 bits has, times to the picosecond, in UTC.

    Args:
        path: The file.
        orbit: The orbit.
        created: When the message was made.

    Raises:
        OSError: The file can't be written.
        ValueError: A time is before 1972, when UTC did not yet go in whole seconds.
    """
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"{line}\n" for line in _lines(orbit, created))


def _lines(orbit: OemOrbit, created: Epoch) -> Iterator[str]:
    times = [_utc(orbit.epoch.later(time)) for time in orbit.times_s.tolist()]
    yield "CCSDS_OEM_VERS = 2.0"
    yield from (f"COMMENT {printable(comment)}" for comment in orbit.comments)
    yield f"CREATION_DATE = {_utc(created)}"
    yield "ORIGINATOR = RELNAV"
    yield ""
    yield "META_START"
    yield f"OBJECT_NAME = {orbit.name}"
    yield f"OBJECT_ID = {orbit.name}"
    yield "CENTER_NAME = EARTH"
    yield "REF_FRAME = EME2000"
    yield "TIME_SYSTEM = UTC"
    yield f"START_TIME = {times[0]}"
    yield f"STOP_TIME = {times[-1]}"
    yield "META_STOP"
    for time, state in zip(times, orbit.states.tolist(), strict=True):
        yield " ".join([time, *(_shifted(value, -3) for value in state)])
    if orbit.covariance is None:
        return
    yield "COVARIANCE_START"
    for time, matrix in zip(times, orbit.covariance, strict=True):
        yield f"EPOCH = {time}"
        yield "COV_REF_FRAME = EME2000"
        values = iter(matrix[_TRIANGLE].tolist())
        for row in range(1, 7):
            yield " ".join(_shifted(next(values), -6) for _ in range(row))
    yield "COVARIANCE_STOP"


def _utc(epoch: Epoch) -> str:
    return epoch.text("UTC").removesuffix(" UTC")


def _shifted(value: float, powers: int) -> str:
    """Return a number times a power of ten, exactly."""
    if value == 0:
        return f"{value:.16e}"  # a decimal zero would keep an exponent of its own
    return f"{Decimal(repr(value)).scaleb(powers):.16e}"
