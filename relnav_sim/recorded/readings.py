"""Recorded measurements: what each sensor read and when, over one run or one flight, whatever file it came from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.astro.line_of_sight import half_open
from relnav_sim.printable import printable

_LONGEST_QUOTED = 60


class ReadingsError(ValueError):
    """A file of measurements can't be used; the message is one sentence that names file, line and remedy."""


def quoted(text: str) -> str:
    """Return a piece of a file as a sentence has it: in quotes, of bounded length, without characters that act."""
    return repr(printable(text, _LONGEST_QUOTED))


class Quantity(Protocol):
    """One number of a measurement, as `measurements.Channel` has it."""

    @property
    def name(self) -> str:
        """A word for it: ``range``."""
        ...

    @property
    def unit(self) -> str:
        """Its SI unit: ``m``, ``rad``; empty for a pure number."""
        ...

    @property
    def angle(self) -> bool:
        """Whether it is an angle, whose full turns do not count."""
        ...


Layout = Mapping[str, Sequence[Quantity]]
"""The numbers of one measurement of every sensor, by the sensor's name."""


@dataclass(frozen=True)
class Column:
    """One channel of one sensor as one file has it: only the values that are there, in the order of the file.

    Attributes:
        sensor: Name of the sensor.
        channel: Place of the channel in a measurement.
        times_s: Seconds since the campaign's start, (N,).
        values: SI units and rad, (N,).
        file: The file, as the user named it.
        lines: Lines of the file, (N,).
    """

    sensor: str
    channel: int
    times_s: Array
    values: Array
    file: str
    lines: Integers


@dataclass(frozen=True)
class SensorReadings:
    """What one sensor read.

    Attributes:
        times_s: Seconds since the campaign's start, (N,), rising.
        values: Measurements (N, m), SI units and rad; NaN where a channel is missing. Each row has a number.
        files: Names of the files that they come from.
        origins: For each row the place of its file in `files`, and the line there, (N, 2).
    """

    times_s: Array
    values: Array
    files: tuple[str, ...]
    origins: Integers

    def where(self, row: int) -> str:
        """Return where a row stands, as ``pass.csv:17``."""
        file, line = self.origins[row].tolist()
        return f"{self.files[file]}:{line}"


@dataclass(frozen=True)
class Start:
    """Where the filters start, at 0 s: the prior of the relative state, without augmented states.

    Attributes:
        mean: State of the deputy relative to the chief, RTN, (6,), m and m/s.
        covariance: Its covariance, (6, 6).
    """

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Readings:
    """Everything that was recorded of one run.

    Attributes:
        sensors: What each sensor read, by its name; those without a single measurement are left out.
        start: Where the filters start; None: where the campaign says.
        run: Number of the run, of which the random numbers of sampling filters are a function.
        notes: What the user should know of the files: sentences.
    """

    sensors: Mapping[str, SensorReadings]
    start: Start | None = None
    run: int = 0
    notes: tuple[str, ...] = field(default=())


def assemble(columns: Iterable[Column], layout: Layout, sort: bool = False) -> dict[str, SensorReadings]:
    """Return the measurements of each sensor, put together from columns of one file or of several.

    Args:
        columns: The columns, in the order in which the files were given.
        layout: The numbers of each sensor's measurement.
        sort: Whether rows may be out of order, or stand there twice with the same value.

    Raises:
        ReadingsError: A channel's times do not rise, or it has two values at one time.
    """
    by_sensor: dict[str, dict[int, list[Column]]] = {}
    for column in columns:
        if len(column.times_s):
            by_sensor.setdefault(column.sensor, {}).setdefault(column.channel, []).append(column)
    return {name: _one_sensor(name, layout[name], by_sensor[name], sort) for name in layout if name in by_sensor}


def _one_sensor(
    name: str, quantities: Sequence[Quantity], channels: Mapping[int, Sequence[Column]], sort: bool
) -> SensorReadings:
    files = tuple(dict.fromkeys(column.file for parts in channels.values() for column in parts))
    joined = {
        channel: _in_order(f"{name}.{quantities[channel].name}", parts, files, sort)
        for channel, parts in channels.items()
    }
    times_s = np.unique(np.concatenate([times for times, _, _ in joined.values()]))
    values = np.full((len(times_s), len(quantities)), np.nan)
    origins = np.zeros((len(times_s), 2), dtype=np.int64)
    for channel, (times, numbers, places) in sorted(joined.items(), reverse=True):
        rows = np.searchsorted(times_s, times)
        values[rows, channel] = _within_a_turn(numbers) if quantities[channel].angle else numbers
        origins[rows] = places
    return SensorReadings(times_s, values, files, origins)


def _within_a_turn(angles: Array) -> Array:
    """Return angles in (-pi, pi]; those that are there already keep every bit, the sign of a zero included."""
    return np.where((angles > -np.pi) & (angles <= np.pi), angles, half_open(angles))


def _in_order(what: str, parts: Sequence[Column], files: Sequence[str], sort: bool) -> tuple[Array, Array, Integers]:
    """Return times, values and origins of one channel, its times rising."""
    times = np.concatenate([part.times_s for part in parts])
    values = np.concatenate([part.values for part in parts])
    places = np.concatenate(
        [np.stack([np.full(len(part.lines), files.index(part.file)), part.lines], axis=1) for part in parts]
    )

    def at(row: int) -> str:
        return f"{files[places[row, 0]]}:{places[row, 1]}"

    lost = np.flatnonzero(~(np.isfinite(times) & np.isfinite(values)))
    if len(lost):
        raise ReadingsError(f"{at(int(lost[0]))}: {what} or its time is too large for a number of 64 bits in SI units")
    if sort:
        order = np.argsort(times, kind="stable")
        times, values, places = times[order], values[order], places[order]
        again = np.flatnonzero((times[1:] == times[:-1]) & (values[1:] != values[:-1]))
        if len(again):
            row = int(again[0]) + 1
            raise ReadingsError(
                f"{at(row)}: {what} has two different values at {times[row]!s} s, the other at {at(row - 1)}; "
                "leave out the wrong one"
            )
        kept = np.concatenate([[True], times[1:] > times[:-1]])
        return times[kept], values[kept], places[kept]
    wrong = np.flatnonzero(times[1:] <= times[:-1])
    if len(wrong):
        row = int(wrong[0]) + 1
        what_is = "is given twice" if times[row] == times[row - 1] else "goes back in time"
        raise ReadingsError(
            f"{at(row)}: {what} {what_is}: {times[row]!s} s comes after {times[row - 1]!s} s ({at(row - 1)}); "
            "put the rows in order, or give --sort"
        )
    return times, values, places
