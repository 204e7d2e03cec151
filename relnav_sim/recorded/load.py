"""Any file of an orbit to an `Ephemeris`, or to one sentence that says where it is wrong."""

from __future__ import annotations

import os
import re
from dataclasses import replace

import numpy as np

from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.axes import seen_from_earth
from relnav_sim.recorded.ephemeris import Ephemeris
from relnav_sim.recorded.ephemeris_csv import read_ephemeris_csv
from relnav_sim.recorded.errors import at_line
from relnav_sim.recorded.oem import VERSION_KEY, read_oem
from relnav_sim.recorded.oem_xml import read_oem_xml
from relnav_sim.recorded.orbit_file import OrbitFile
from relnav_sim.recorded.segment import Place, Segment
from relnav_sim.recorded.stated import Stated

_MOST_BYTES = 500_000_000


def load_ephemeris(
    path: str | os.PathLike[str],
    *,
    frame: str | None = None,
    time_scale: str | None = None,
    velocity_frame: str | None = None,
    epoch: str | None = None,
    interpolation: str | None = None,
    interpolation_degree: int | None = None,
    start: Epoch | str | None = None,
    stop: Epoch | str | None = None,
) -> Ephemeris:
    """Return the orbit of a file: a CCSDS OEM (keyword = value or XML; versions 1, 2 and 3) or a CSV table.

    An OEM says everything itself. A CSV table names its columns with their units (`time_utc,x_m,y_m,z_m,vx_m_s,...`)
    and states the rest in lines such as `# frame: ITRF`, or the caller does.

    Args:
        path: The file.
        frame: Frame of the states: EME2000, ICRF, GCRF or ITRF.
        time_scale: Scale of calendar times: UTC, TAI, GPS or TT.
        velocity_frame: ITRF where ITRF velocities are relative to the turning Earth (default: that of the frame);
            inertial where they are those seen from inertial space, along the axes of ITRF.
        epoch: Epoch from which `time_s` counts, as 2010-07-27T00:00:00 GPS.
        interpolation: LAGRANGE, HERMITE or LINEAR, instead of what the file says; where neither says anything,
            Lagrange of degree 7, or Hermite of degree 7 or 11 where rows are sparse.
        interpolation_degree: Its degree.
        start: First epoch that is needed; None: all of the file.
        stop: Last epoch that is needed. Gaps outside of what is needed do not matter.

    Raises:
        EphemerisError: One sentence with ``file:line:`` on what is wrong.
        OSError: The file can't be read.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import ForceModel, load_ephemeris, propagate
        >>> times_s = np.arange(0.0, 900.0, 60.0)
        >>> states = propagate([[6.9e6, 0.0, 0.0, 0.0, 7.6e3, 0.0]], times_s, ForceModel(3.986004418e14, 6378137.0))[0]
        >>> columns = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
        >>> np.savetxt("flown.csv", np.column_stack([times_s, states]), delimiter=",", header=columns, comments="")
        >>> orbit = load_ephemeris("flown.csv", frame="EME2000", epoch="2026-03-01T00:00:00 UTC")
        >>> orbit.epoch.text("UTC"), orbit.states.shape
        ('2026-03-01T00:00:00 UTC', (15, 6))
    """
    first, last = (Epoch.parse(each) if isinstance(each, str) else each for each in (start, stop))
    stated = Stated(frame, time_scale, velocity_frame, epoch, interpolation, interpolation_degree)
    return read_orbit_file(os.fspath(path), stated).between(first, last)


def read_orbit_file(path: str, stated: Stated) -> OrbitFile:
    """Return what stands in a file of an orbit, checked.

    Args:
        path: The file.
        stated: What the caller states of it.

    Raises:
        EphemerisError: As `load_ephemeris`.
        OSError: The file can't be read.
    """
    segments = [_with_own_velocities(segment) for segment in _segments(_text(path), path, stated)]
    chosen = None
    if stated.interpolation is not None or stated.interpolation_degree is not None:
        degree = None if stated.interpolation_degree is None else str(stated.interpolation_degree)
        chosen = Place(path, segments[0].line).interpolation(stated.interpolation or "HERMITE", degree)
    return OrbitFile(path, tuple(segments), chosen)


def _text(name: str) -> str:
    with open(name, "rb") as file:
        content = file.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        raise at_line(name, 1, f"the file is longer than {_MOST_BYTES // 10**6} MB")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise at_line(name, line, "the file is not text (UTF-8)") from None


def _segments(text: str, name: str, stated: Stated) -> list[Segment]:
    """Return what the reader of the file's format makes of it; what the file begins with tells the format."""
    if text.lstrip().startswith("<"):
        segments = read_oem_xml(text, name)
    else:
        saying = (number_line for number_line in enumerate(text.splitlines(), 1) if number_line[1].strip())
        number, first = next(((n, line) for n, line in saying if line.split(None, 1)[0] != "COMMENT"), (1, ""))
        message = re.match(r"\s*CCSDS_(\w+)_VERS\b", first)
        if message is None:
            return read_ephemeris_csv(text, name, stated)
        if message[1] != "OEM":
            raise at_line(name, number, f"the file is a CCSDS {message[1]}; an orbit is read from {VERSION_KEY} = 2.0")
        segments = read_oem(text, name)
    _check_agreement(segments[0], stated, name)
    return segments


def _with_own_velocities(segment: Segment) -> Segment:
    """Return a segment whose velocities are the time derivatives of its coordinates."""
    if not segment.inertial_velocity:
        return segment
    first = segment.epochs[0]
    times_s = np.array([each.seconds_since(first) for each in segment.epochs])
    return replace(segment, states=seen_from_earth(segment.states, times_s, first), inertial_velocity=False)


def _check_agreement(segment: Segment, stated: Stated, name: str) -> None:
    """Refuse what a caller states against an OEM, which says everything itself."""
    for what, said, given in (
        ("frame", segment.frame, stated.frame),
        ("time system", segment.scale, stated.time_scale),
    ):
        if given is not None and not said.startswith(given.upper()):
            raise at_line(name, segment.line, f"the {what} of this OEM is {said}, not {given}; leave it out")
    if stated.velocity_frame is not None and stated.velocity_frame.upper() != segment.frame:
        raise at_line(name, segment.line, f"the velocities of an OEM are those of its frame, {segment.frame}")
    if stated.epoch is not None:
        raise at_line(name, segment.line, "the times of an OEM are calendar times; leave epoch out")
