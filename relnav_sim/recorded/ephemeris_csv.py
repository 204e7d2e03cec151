"""Orbits in comma-separated tables whose header names every column with its unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.segment import Place, Segment
from relnav_sim.recorded.stated import Stated

_SCALE = r"(utc|tai|gps|tt)"
_TIME = re.compile(rf"(?:time_{_SCALE}|{_SCALE}_time)")
_CALENDAR = ("time", "epoch")
_SECONDS = "time_s"
_VALUE = re.compile(r"(?P<axis>v?[xyz])(?:_(?P<frame>[a-z]+[0-9]*))?_(?P<unit>km_s|m_s|km|m)")
_AXES = ("x", "y", "z", "vx", "vy", "vz")
_FACTORS = {"m": 1.0, "km": 1e3, "m_s": 1.0, "km_s": 1e3}
_STATEMENT = re.compile(r"#\s*(frame|velocity_frame|time_scale|epoch)\s*[:=]\s*(.+)", re.IGNORECASE)


@dataclass(frozen=True)
class _Columns:
    """Where everything stands in a row.

    Attributes:
        count: Columns of the table.
        time: Column of the time.
        axes: Columns of x, y, z and their velocities.
        factors: What turns each of the six to m and m/s.
        is_seconds: Whether the time counts seconds from an epoch.
        scale: The time scale that the header names.
        frame: The frame that the header names.
    """

    count: int
    time: int
    axes: tuple[int, ...]
    factors: Array
    is_seconds: bool
    scale: str | None
    frame: str | None


def read_ephemeris_csv(text: str, path: str, stated: Stated) -> list[Segment]:
    """Return the one segment of a table of states.

    Args:
        text: The file's text: lines that begin with `#`, which may state frame, velocity_frame, time_scale and epoch
            as `# frame: ITRF`; a header; a row for each epoch.
        path: Its path, for errors.
        stated: What the caller states of the file.

    Raises:
        EphemerisError: A column, the frame or the time scale is not said or not known, or a row is malformed.
    """
    said: dict[str, tuple[str, Place]] = {}
    columns: _Columns | None = None
    lines: list[int] = []
    epochs: list[Epoch] = []
    rows: list[list[float]] = []
    header = Place(path, 1)
    origin: Epoch | None = None
    scale = ""
    for number, line in enumerate(text.splitlines(), 1):
        place = Place(path, number)
        if line.lstrip().startswith("#"):
            if found := _STATEMENT.fullmatch(line.strip()):
                said[found[1].lower()] = found[2].strip(), place
            continue
        if not line.strip():
            continue
        words = [word.strip() for word in line.split(",")]
        if columns is None:
            columns, header = _columns(words, place), place
            origin, scale = _time_origin(columns, said, stated, place)
            continue
        if len(words) != columns.count:
            raise place.error(f"the row has {len(words)} columns; the header has {columns.count}")
        at = _epoch(words[columns.time], origin, scale, place)
        if epochs and at <= epochs[-1]:
            how = "is the same as" if at == epochs[-1] else "comes before"
            raise place.error(f"the time {how} the one of line {lines[-1]}; times must increase")
        lines.append(number)
        epochs.append(at)
        rows.append([place.number(words[column], _AXES[axis]) for axis, column in enumerate(columns.axes)])
    if columns is None:
        raise header.error("the file is empty; a table begins with a header such as time_utc,x_m,y_m,z_m,vx_m_s,...")
    if not rows:
        raise header.error("no rows follow the header")
    frame = _frame(columns, said, stated, header)
    return [
        Segment(
            line=header.line,
            lines=tuple(lines),
            epochs=tuple(epochs),
            states=np.array(rows) * columns.factors,
            frame=frame,
            scale=scale or "TAI",
            useable=(epochs[0], epochs[-1]),
            inertial_velocity=_is_inertial_velocity(frame, said, stated, header),
        )
    ]


def _columns(words: list[str], place: Place) -> _Columns:
    names = [word.lower() for word in words]
    for name in names:
        if names.count(name) > 1:
            raise place.error(f"the column {name!r} stands here twice")
    times = [name for name in names if name in (*_CALENDAR, _SECONDS) or _TIME.fullmatch(name)]
    if len(times) != 1:
        wrong = f"{' and '.join(times)} are both times" if times else "no column is a time"
        raise place.error(f"{wrong}; name one time_utc, time_gps, time_tai, time_tt or, in seconds, time_s")
    found: dict[str, tuple[int, str, str | None]] = {}
    for column, name in enumerate(names):
        if match := _VALUE.fullmatch(name):
            if match["axis"] in found:
                raise place.error(f"the column {name!r} gives {match['axis']} a second time")
            if match["unit"].endswith("_s") != match["axis"].startswith("v"):
                raise place.error(f"the column {name!r} has a unit of {'position' if 'v' in name[0] else 'velocity'}")
            found[match["axis"]] = column, match["unit"], match["frame"]
    for axis in _AXES:
        if axis not in found:
            units = "vx_m_s or vx_km_s".replace("vx", axis) if axis[0] == "v" else f"{axis}_m or {axis}_km"
            raise place.error(f"no column gives {axis} with its unit; name it {units}")
    frames = {found[axis][2] for axis in _AXES}
    if len(frames) > 1:
        named = " and ".join(sorted(str(frame).upper() for frame in frames if frame))
        raise place.error(f"some columns are in {named} and others not; one frame must hold for all")
    frame = frames.pop()
    scale = _TIME.fullmatch(times[0])
    return _Columns(
        count=len(names),
        time=names.index(times[0]),
        axes=tuple(found[axis][0] for axis in _AXES),
        factors=np.array([_FACTORS[found[axis][1]] for axis in _AXES]),
        is_seconds=times[0] == _SECONDS,
        scale=(scale[1] or scale[2]).upper() if scale else None,
        frame=frame.upper() if frame else None,
    )


def _one(what: str, values: Mapping[str, str | None], place: Place, remedy: str) -> str:
    """Return what several sources say of the same thing.

    Raises:
        EphemerisError: They differ, or none says anything.
    """
    given = {source: value for source, value in values.items() if value}
    if not given:
        raise place.error(f"nothing says the {what}; {remedy}")
    (first, value), *others = given.items()
    for source, other in others:
        if other.upper() != value.upper():
            raise place.error(f"the {what} is {value} by {first} and {other} by {source}")
    return value


def _time_origin(
    columns: _Columns, said: Mapping[str, tuple[str, Place]], stated: Stated, place: Place
) -> tuple[Epoch | None, str]:
    """Return the epoch from which seconds count, None for calendar times, and the time scale of those."""
    if not columns.is_seconds:
        given = {"its column": columns.scale, "a comment": _of("time_scale", said), "the caller": stated.time_scale}
        remedy = "name the column time_utc, time_gps, time_tai or time_tt, or give time_scale"
        return None, place.scale(_one("time scale", given, place, remedy))
    given = {"a comment": _of("epoch", said), "the caller": stated.epoch}
    text = _one(
        "epoch from which time_s counts", given, place, "write a line # epoch: 2010-07-27T00:00:00 GPS above it"
    )
    try:
        return Epoch.parse(text, stated.time_scale), ""
    except ValueError as error:
        raise (said["epoch"][1] if "epoch" in said else place).error(str(error)) from None


def _epoch(text: str, origin: Epoch | None, scale: str, place: Place) -> Epoch:
    if origin is None:
        return place.epoch(text, scale)
    return origin.later(place.number(text, _SECONDS))


def _frame(columns: _Columns, said: Mapping[str, tuple[str, Place]], stated: Stated, place: Place) -> str:
    given = {"its columns": columns.frame, "a comment": _of("frame", said), "the caller": stated.frame}
    remedy = "write a line # frame: ITRF (or EME2000, ICRF) above the header, name columns as x_itrf_m, or give frame"
    return place.frame(_one("frame", given, place, remedy))


def _is_inertial_velocity(frame: str, said: Mapping[str, tuple[str, Place]], stated: Stated, place: Place) -> bool:
    """Return whether the velocities are those seen from inertial space, in a frame that turns."""
    given = {"a comment": _of("velocity_frame", said), "the caller": stated.velocity_frame, "default": frame}
    if given["a comment"] or given["the caller"]:
        del given["default"]
    name = _one("velocity frame", given, place, "")
    if name.upper() not in (frame, "INERTIAL"):
        raise place.error(
            f"the velocity frame {name!r} is not known; it must be {frame} (velocities are the time derivative of the "
            "coordinates) or inertial (as seen from inertial space, along the axes of the frame)"
        )
    return frame.startswith("ITRF") and name.upper() == "INERTIAL"


def _of(key: str, said: Mapping[str, tuple[str, Place]]) -> str | None:
    return said[key][0] if key in said else None
