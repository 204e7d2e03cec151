"""Measurements written as a CCSDS Tracking Data Message."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from pathlib import Path

import numpy as np

from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.readings import Layout, Quantity, Readings, SensorReadings
from relnav_sim.recorded.tdm import KINDS
from relnav_sim.recorded.tdm_segments import VERSION

_SCALE = "UTC"


def fits_tdm(quantities: Sequence[Quantity]) -> bool:
    """Return whether a Tracking Data Message has a keyword for every number of a measurement."""
    known = set(KINDS.values())
    return all((quantity.name, quantity.unit) in known for quantity in quantities)


def write_tdm(
    path: Path, readings: Readings, layout: Layout, epoch: Epoch, targets: Mapping[str, str], created: Epoch
) -> None:
    """Write measurements as a Tracking Data Message, a segment for each sensor that has any.

    Times are to the picosecond, km, km/s and degrees with all their digits, so that reading them back errs by some
    units of the last place.

    Args:
        path: The file.
        readings: What is written; each sensor must be one that `fits_tdm`.
        layout: The numbers of the measurements.
        epoch: The instant of 0 s.
        targets: What each sensor measures, by the sensor's name: ``chief`` or ``deputy``.
        created: When the file is written.

    Raises:
        OSError: The file can't be written.
    """
    header = [
        f"{VERSION} = 2.0",
        f"COMMENT run: {readings.run}",
        f"CREATION_DATE = {_text(created)}",
        "ORIGINATOR = RELNAV",
    ]
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in header)
        for name, one in readings.sensors.items():
            file.writelines(f"{line}\n" for line in _segment(name, one, layout[name], epoch, targets[name]))


def _segment(name: str, one: SensorReadings, quantities: Sequence[Quantity], epoch: Epoch, target: str) -> list[str]:
    keywords = {kind: keyword for keyword, kind in KINDS.items()}
    own = [keywords[quantity.name, quantity.unit] for quantity in quantities]
    times = [_text(epoch.later(seconds)) for seconds in one.times_s.tolist()]
    meta = [
        "META_START",
        f"TIME_SYSTEM = {_SCALE}",
        f"START_TIME = {times[0]}",
        f"STOP_TIME = {times[-1]}",
        f"PARTICIPANT_1 = {name}",
        f"PARTICIPANT_2 = {target}",
        "MODE = SEQUENTIAL",
        "PATH = 2,1",
        "RANGE_UNITS = km",
        *(["ANGLE_TYPE = AZEL"] if "ANGLE_1" in own or "ANGLE_2" in own else []),
        "META_STOP",
        "DATA_START",
    ]
    data = [
        f"{keyword} = {time} {degrees(value) if keyword.startswith('ANGLE') else value / 1e3!r}"
        for time, row in zip(times, one.values.tolist(), strict=True)
        for keyword, value in zip(own, row, strict=True)
        if not np.isnan(value)
    ]
    return [*meta, *data, "DATA_STOP"]


def _text(epoch: Epoch) -> str:
    return epoch.text(_SCALE).removesuffix(f" {_SCALE}")
