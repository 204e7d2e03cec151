"""Any file of an orbit to an `Ephemeris`, or to one sentence that says where it is wrong."""

from __future__ import annotations

import os
import re
from bisect import bisect_left, bisect_right
from dataclasses import replace
from itertools import pairwise

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.axes import seen_from_earth
from relnav_sim.recorded.ephemeris import Ephemeris, Span
from relnav_sim.recorded.ephemeris_csv import read_ephemeris_csv
from relnav_sim.recorded.errors import at_line
from relnav_sim.recorded.interpolation import Interpolation
from relnav_sim.recorded.oem import VERSION_KEY, read_oem
from relnav_sim.recorded.oem_xml import read_oem_xml
from relnav_sim.recorded.segment import Place, Segment, is_realisation
from relnav_sim.recorded.stated import Stated
from relnav_sim.wording import counted, listed

_MOST_BYTES = 500_000_000
_DEFAULTS = (Interpolation("LAGRANGE", 7), Interpolation("HERMITE", 7), Interpolation("HERMITE", 11))
"""Where nobody says anything, the first is taken, whose velocities are as smooth as those of the rows although
positions are rounded; or one of the others that halves its error at withheld rows, as they do where rows are sparse."""
_LONGEST_STEP = 10.0
"""A step is a gap where it is this many times as long as the median of its segment's, or ..."""
_LONGEST_NEIGHBOUR = 3.0
"""... this many times as long as the longer one of its neighbours: steps of a few files follow an eccentric orbit."""
_SHOWN = 4
_SLOPE = 0.01
"""Share by which velocities may differ from the change of position; that of the Earth's rotation in low orbit is 0.06,
and a wrong unit 1000."""


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
    """
    name = os.fspath(path)
    text = _text(name)
    stated = Stated(frame, time_scale, velocity_frame, epoch)
    segments = [_with_own_velocities(segment) for segment in _segments(text, name, stated)]
    chosen = None
    if interpolation is not None or interpolation_degree is not None:
        degree = None if interpolation_degree is None else str(interpolation_degree)
        chosen = Place(name, segments[0].line).interpolation(interpolation or "HERMITE", degree)
    _check_order(segments, name)
    needed = _needed(start, stop)
    _check_coverage(segments, needed, name)
    first = segments[0].epochs[0]
    spans, times, states, rows = [], [], [], 0
    for segment in segments:
        method = chosen or segment.interpolation or _default(segment)
        kept = _kept(segment, method, needed)
        if kept is None:
            continue
        at = np.array([each.seconds_since(first) for each in segment.epochs[kept]])
        _check_rows(segment, kept, at, method, name)
        begin = max(segment.useable[0], needed[0] or segment.useable[0]).seconds_since(first)
        end = min(segment.useable[1], needed[1] or segment.useable[1]).seconds_since(first)
        spans.append(Span(slice(rows, rows + len(at)), begin, end, method))
        times.append(at)
        states.append(segment.states[kept])
        rows += len(at)
    named = segments[0].frame
    notes = (
        (f"{named} is taken for the ITRF: its realisations differ by centimetres.",) if is_realisation(named) else ()
    )
    return Ephemeris(name, first, np.concatenate(times), np.concatenate(states), named, tuple(spans), notes)


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


def _check_order(segments: list[Segment], name: str) -> None:
    """Refuse segments of different things, and such that overlap."""
    for earlier, later in pairwise(segments):
        for what, one, other in (
            ("object", earlier.name, later.name),
            ("frame", earlier.frame, later.frame),
            ("time system", earlier.scale, later.scale),
        ):
            if one != other:
                raise at_line(name, later.line, f"the {what} of this segment is {other}, before it is {one}")
        if later.useable[0] < earlier.useable[1]:
            raise at_line(
                name,
                later.line,
                f"this segment is useable from {later.useable[0].text()} on, and the one of line {earlier.line} until "
                f"{earlier.useable[1].text()}; segments must not overlap",
            )


def _needed(start: Epoch | str | None, stop: Epoch | str | None) -> tuple[Epoch | None, Epoch | None]:
    first, last = (Epoch.parse(each) if isinstance(each, str) else each for each in (start, stop))
    return first, last


def _default(segment: Segment) -> Interpolation:
    """Return the default interpolation of a segment; of a very short one Hermite's through all its rows."""
    times_s = np.array([each.seconds_since(segment.epochs[0]) for each in segment.epochs])
    tried = [each for each in _DEFAULTS if each.rows < len(times_s)]
    if not tried:
        return Interpolation("HERMITE", max(2 * len(times_s) - 1, 3))
    errors = [each.error(times_s, segment.states)[0] for each in tried]
    clear = [each for each, error in zip(tried[1:], errors[1:], strict=True) if error < errors[0] / 2]
    return min(clear, key=lambda each: errors[tried.index(each)], default=tried[0])


def _check_coverage(segments: list[Segment], needed: tuple[Epoch | None, Epoch | None], name: str) -> None:
    """Refuse a file that does not cover what is needed."""
    first, last = needed[0] or segments[0].useable[0], needed[1] or segments[-1].useable[1]
    reached = first
    for segment in segments:
        if segment.useable[0] <= reached:
            reached = max(reached, segment.useable[1])
    if first >= segments[0].useable[0] and reached >= last:
        return
    shown = [f"{each.useable[0].text()} to {each.useable[1].text()}" for each in segments[:_SHOWN]]
    more = [f"{len(segments) - _SHOWN} more"] if len(segments) > _SHOWN else []
    raise at_line(
        name,
        segments[0].line,
        f"the orbit is useable from {listed([*shown, *more])}; it is needed from {first.text()} to {last.text()}",
    )


def _kept(segment: Segment, method: Interpolation, needed: tuple[Epoch | None, Epoch | None]) -> slice | None:
    """Return the rows that are needed, with those that an interpolation at the ends takes; None: no rows."""
    first, last = needed
    if (first is not None and segment.useable[1] < first) or (last is not None and segment.useable[0] > last):
        return None
    count, around = len(segment.epochs), method.rows
    begin = 0 if first is None else max(bisect_right(segment.epochs, first) - around, 0)
    end = count if last is None else min(bisect_left(segment.epochs, last) + around, count)
    return slice(begin, end)


def _check_rows(segment: Segment, kept: slice, times_s: Array, method: Interpolation, name: str) -> None:
    """Refuse too few rows, gaps, and velocities that are not the change of position."""
    lines = segment.lines[kept]
    if len(times_s) < max(method.rows, 2):
        what = f"{method.kind} of degree {method.degree}"
        raise at_line(
            name,
            segment.line,
            f"{counted(len(times_s), 'row')} where {what} needs {max(method.rows, 2)}; give more rows",
        )
    steps = np.diff(times_s)
    neighbours = np.maximum(np.append(steps[1:], 0.0), np.insert(steps[:-1], 0, 0.0))
    longest = np.minimum(
        _LONGEST_STEP * np.median(steps), np.where(neighbours > 0, _LONGEST_NEIGHBOUR * neighbours, np.inf)
    )
    gaps = np.flatnonzero(steps > longest)
    if len(gaps):
        gap = int(gaps[0])
        raise at_line(
            name,
            lines[gap + 1],
            f"a gap of {steps[gap]:.12g} s lies before this row, where rows are {np.median(steps):.12g} s apart; "
            "use the part before or after it, or fill it",
        )
    if (ratio := _slope_error(times_s, segment.states[kept])) > _SLOPE:
        raise at_line(
            name,
            lines[0],
            f"the velocities are not the change of position with time, from which they differ by {100 * ratio:.3g} % "
            "here and after; check the units and the velocity frame",
        )


def _slope_error(times_s: Array, states: Array) -> float:
    """Return by which share velocities differ from the change of position, less what the curvature may explain.

    The mean of two velocities is right up to angle^2 / 12 for a circle, twice which is allowed for.
    """
    position, velocity = states[:, :3], states[:, 3:]
    mean = (velocity[1:] + velocity[:-1]) / 2
    change = np.diff(position, axis=0) / np.diff(times_s)[:, None]
    speed = np.maximum(np.linalg.norm(mean, axis=1), np.linalg.norm(change, axis=1))
    angle = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.linalg.norm(position[1:], axis=1)
    share = np.linalg.norm(change - mean, axis=1) / np.where(speed > 0, speed, 1.0) - angle**2 / 6
    return float(np.median(share))
