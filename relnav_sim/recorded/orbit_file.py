"""The segments of a file as one orbit: whether they fit together, and the part that is needed."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.ephemeris import Ephemeris, Span
from relnav_sim.recorded.errors import at_line
from relnav_sim.recorded.interpolation import Interpolation
from relnav_sim.recorded.pull import misplaced, outlier, unlike_the_earths
from relnav_sim.recorded.segment import Segment, is_inertial, is_realisation
from relnav_sim.wording import counted, listed

Needed = tuple[Epoch | None, Epoch | None]
"""First and last epoch that are needed; None: no such bound."""

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


@dataclass(frozen=True)
class OrbitFile:
    """What stands in a file of an orbit.

    Attributes:
        path: The file.
        segments: Its segments, in order.
        interpolation: How all are interpolated; None: as each says, or by default.

    Raises:
        EphemerisError: The segments are of different things, or overlap.
    """

    path: str
    segments: tuple[Segment, ...]
    interpolation: Interpolation | None

    def __post_init__(self) -> None:
        _check_order(self.segments, self.path)

    def between(self, start: Epoch | None = None, stop: Epoch | None = None) -> Ephemeris:
        """Return the orbit from one instant to another; None: from the first or to the last.

        Raises:
            EphemerisError: The file does not cover that, or its rows can't be interpolated there.
        """
        needed = start, stop
        _check_coverage(self.segments, needed, self.path)
        first = self.segments[0].epochs[0]
        spans, times, states, rows = [], [], [], 0
        for segment in self.segments:
            method = self.interpolation or segment.interpolation or _default(segment)
            kept = _kept(segment, method, needed)
            if kept is None:
                continue
            at = np.array([each.seconds_since(first) for each in segment.epochs[kept]])
            _check_rows(segment, kept, at, method, self.path)
            begin = max(segment.useable[0], start or segment.useable[0]).seconds_since(first)
            end = min(segment.useable[1], stop or segment.useable[1]).seconds_since(first)
            _check_motion(segment, kept, at, self.path)
            spans.append(Span(slice(rows, rows + len(at)), begin, end, method))
            times.append(at)
            states.append(segment.states[kept])
            rows += len(at)
        frame = self.segments[0].frame
        notes = [f"{frame} is taken for the ITRF: its realisations differ by centimetres."] * is_realisation(frame)
        notes += [note for segment in self.segments for note in segment.notes]
        whole = np.concatenate(times), np.concatenate(states)
        return Ephemeris(self.path, first, *whole, frame, tuple(spans), tuple(notes))


def _check_order(segments: Sequence[Segment], name: str) -> None:
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


def _default(segment: Segment) -> Interpolation:
    """Return the default interpolation of a segment; of a very short one Hermite's through all its rows."""
    times_s = np.array([each.seconds_since(segment.epochs[0]) for each in segment.epochs])
    tried = [each for each in _DEFAULTS if each.rows < len(times_s)]
    if not tried:
        return Interpolation("HERMITE", max(2 * len(times_s) - 1, 3))
    errors = [each.error(times_s, segment.states)[0] for each in tried]
    clear = [each for each, error in zip(tried[1:], errors[1:], strict=True) if error < errors[0] / 2]
    return min(clear, key=lambda each: errors[tried.index(each)], default=tried[0])


def _check_coverage(segments: Sequence[Segment], needed: Needed, name: str) -> None:
    """Refuse a file that does not cover what is needed: all from one bound to the other, or the only one."""
    first, last = needed[0] or needed[1], needed[1] or needed[0]
    if first is None or last is None:
        return
    reached: Epoch | None = None
    for begin, end in (segment.useable for segment in segments):
        if begin <= (reached or first) <= end:
            reached = end
    if reached is not None and reached >= last:
        return
    shown = [f"{each.useable[0].text()} to {each.useable[1].text()}" for each in segments[:_SHOWN]]
    more = [f"{len(segments) - _SHOWN} more"] if len(segments) > _SHOWN else []
    span = f"at {first.text()}" if first == last else f"from {first.text()} to {last.text()}"
    raise at_line(name, segments[0].line, f"the orbit is useable from {listed([*shown, *more])}; it is needed {span}")


def _kept(segment: Segment, method: Interpolation, needed: Needed) -> slice | None:
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


def _check_motion(segment: Segment, kept: slice, times_s: Array, name: str) -> None:
    """Refuse rows that are nowhere near the Earth, that do not move as it pulls them, and single rows that are off."""
    states, turning = segment.states[kept], not is_inertial(segment.frame)
    whole = np.array([each.seconds_since(segment.epochs[0]) for each in segment.epochs])
    for fault, lines in (
        (misplaced(states), segment.lines[kept]),
        (unlike_the_earths(whole, segment.states, turning), segment.lines),
        (outlier(times_s, states, turning), segment.lines[kept]),
    ):
        if fault is not None:
            raise at_line(name, lines[fault.row], fault.sentence)


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
