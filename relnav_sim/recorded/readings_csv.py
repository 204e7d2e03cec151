"""Measurements in CSV: a row for each time, a column for each channel, and further facts in comment lines before."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.astro.epoch import Epoch
from relnav_sim.near_names import nearest
from relnav_sim.printable import printable
from relnav_sim.recorded.column_names import column_name, places_of, time_column
from relnav_sim.recorded.number import number
from relnav_sim.recorded.readings import Column, Layout, Readings, ReadingsError, Start, quoted
from relnav_sim.recorded.recording import LINE_ENDS, Recording

_MEAN, _COVARIANCE = "start_mean_m_m_s", "start_covariance_m_m_s"
_KEYS = ("run", "epoch", _MEAN, _COVARIANCE)
"""What comment lines before the header can say."""
_TOLD = ("campaign", "case", "seed")
"""What they say for people."""


def read_csv(path: str, text: str, layout: Layout, epoch: Epoch | None = None) -> Recording:
    """Return what a CSV file of measurements holds; one that says where filters start need hold no measurements.

    Args:
        path: The file's name, for messages.
        text: Its text.
        layout: The numbers of the measurements of the campaign's sensors.
        epoch: The instant of the campaign's 0 s; None: it has no calendar.

    Raises:
        ReadingsError: The file can't be used.
    """
    keys, names, header_line, rows = _parts(path, text)
    own = _epoch(path, keys)
    zero = epoch or own
    shift_s = 0.0 if own is None or epoch is None else own.seconds_since(epoch)
    where = f"{path}:{header_line}"
    time_place, scale = time_column(where, names)
    places = places_of(where, names, layout)
    start = _start(path, keys)
    if not places and start is None:
        raise ReadingsError(f"{where}: no column holds measurements; name them SENSOR.CHANNEL_UNIT, as radar.range_m")
    if scale is not None and zero is None:
        raise ReadingsError(
            f"{where}: {names[time_place]} holds calendar dates, and the campaign has none; "
            "give it a truth.epoch, as 2010-07-27T00:00:00 UTC"
        )

    def seconds(cell: str) -> float:
        if scale is None:
            return _number("time_s", cell) + shift_s
        assert zero is not None
        return Epoch.parse(cell, scale).seconds_since(zero)

    lines, times, cells = _numbers(path, names, rows, time_place, seconds)
    if not len(lines) and start is None:
        raise ReadingsError(f"{path}: it holds no row of measurements after the header")
    with np.errstate(over="ignore"):  # what is not finite then is refused where columns are put together
        si = {index: cells[:, index] * place.factor for index, place in places.items()}
    columns = [
        Column(place.sensor, place.channel, times[there], si[index][there], path, lines[there])
        for index, place in places.items()
        for there in [~np.isnan(si[index])]
    ]
    return Recording(path, tuple(columns), _run(path, keys), own, start, _notes(path, text))


def write_csv(path: Path, readings: Readings, layout: Layout, comments: Mapping[str, str] | None = None) -> None:
    """Write measurements so that `read_csv` gives back every bit.

    Args:
        path: The file.
        readings: What is written.
        layout: The numbers of the measurements.
        comments: Further lines before the header: ``epoch`` where 0 s is an instant of the calendar, and for people
            ``campaign``, ``case`` and ``seed``.

    Raises:
        OSError: The file can't be written.
    """
    keys = {key: printable(said) for key, said in (comments or {}).items()} | {"run": str(readings.run)}
    if readings.start is not None:
        keys[_MEAN] = " ".join(map(repr, readings.start.mean.tolist()))
        keys[_COVARIANCE] = " ".join(map(repr, readings.start.covariance.ravel().tolist()))
    heading = ["time_s", *(column_name(sensor, each) for sensor in readings.sensors for each in layout[sensor])]
    times_s = np.unique(np.concatenate([np.zeros(0), *(each.times_s for each in readings.sensors.values())]))
    cells = np.full((len(times_s), len(heading)), np.nan)
    cells[:, 0] = times_s
    first = 1
    for each in readings.sensors.values():
        cells[np.searchsorted(times_s, each.times_s), first : first + each.values.shape[1]] = each.values
        first += each.values.shape[1]
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {key}: {said}\n" for key, said in keys.items())
        csv.writer(file, lineterminator="\n").writerow(heading)
        for row in cells.tolist():
            file.write(",".join("" if value != value else repr(value) for value in row) + "\n")


def _parts(path: str, text: str) -> tuple[dict[str, tuple[int, str]], list[str], int, Iterator[tuple[int, list[str]]]]:
    """Return the keys of the comment lines with their lines, the header, its line, and the rows with theirs."""
    keys: dict[str, tuple[int, str]] = {}
    lines = iter(enumerate(LINE_ENDS.split(text), start=1))
    for line, content in lines:
        if content.lstrip().startswith("#"):
            _take_key(path, line, content, keys)
        elif content.strip():
            return keys, [cell.strip() for cell in _cells(path, line, content)], line, _rows(path, lines)
    raise ReadingsError(f"{path}: it holds no header, the line that names the columns")


def _rows(path: str, lines: Iterator[tuple[int, str]]) -> Iterator[tuple[int, list[str]]]:
    for line, content in lines:
        if content.lstrip().startswith("#"):
            after: dict[str, tuple[int, str]] = {}
            _take_key(path, line, content, after)
            if after:
                raise ReadingsError(f"{path}:{line}: '# {next(iter(after))}:' must stand before the header")
        elif content.strip():
            yield line, _cells(path, line, content)


def _cells(path: str, line: int, content: str) -> list[str]:
    if '"' not in content:
        return content.split(",")
    try:
        (cells,) = csv.reader([content], strict=True)
    except (csv.Error, ValueError) as error:
        raise ReadingsError(f"{path}:{line}: quotes do not pair up ({error}); a row is one line") from None
    return cells


def _take_key(path: str, line: int, content: str, keys: dict[str, tuple[int, str]]) -> None:
    """Note what a comment line says, if it is a key; refuse what seems meant as one."""
    found = re.fullmatch(r"\s*#\s*([A-Za-z_]+)\s*[:=](.*)", content)
    if found is None or found[1] in _TOLD:
        return
    key, said = found[1], found[2].strip()
    if key not in _KEYS:
        meant = nearest(key, _KEYS)
        if meant is not None:
            raise ReadingsError(f"{path}:{line}: '# {key}:' is unknown; did you mean '# {meant}:'?")
        return
    if key in keys:
        raise ReadingsError(f"{path}:{line}: '# {key}:' is given twice, first in line {keys[key][0]}")
    keys[key] = line, said


def _numbers(
    path: str,
    names: Sequence[str],
    rows: Iterator[tuple[int, list[str]]],
    time_place: int,
    seconds: Callable[[str], float],
) -> tuple[Integers, Array, Array]:
    """Return the lines (N,), the times (N,) and the cells (N, columns); NaN where one is empty."""
    lines, times, cells = [], [], []
    for line, row in rows:
        if len(row) != len(names):
            comma = "; a decimal comma? write a decimal point" if len(row) > len(names) else ""
            raise ReadingsError(f"{path}:{line}: the row has {len(row)} cells, the header {len(names)}{comma}")
        try:
            times.append(seconds(row[time_place].strip()))
            cells.append(
                [
                    np.nan if index == time_place or not (text := cell.strip()) else _number(names[index], text)
                    for index, cell in enumerate(row)
                ]
            )
        except ValueError as error:
            raise ReadingsError(f"{path}:{line}: {error}") from None
        lines.append(line)
    return np.array(lines, dtype=np.int64), np.array(times), np.array(cells).reshape(len(lines), len(names))


def _number(name: str, text: str) -> float:
    try:
        return number(text)
    except ValueError as error:
        raise ValueError(f"{name}: {quoted(text)} {error}") from None


def _notes(path: str, text: str) -> tuple[str, ...]:
    """Return a doubt about a file that may have been cut short: a number without its last digits is one, too."""
    if text.endswith(("\n", "\r")):
        return ()
    return (f"{path}:{len(LINE_ENDS.split(text))}: the last line has no end; see that the file is whole",)


def _epoch(path: str, keys: Mapping[str, tuple[int, str]]) -> Epoch | None:
    if "epoch" not in keys:
        return None
    line, said = keys["epoch"]
    try:
        return Epoch.parse(said)
    except ValueError as error:
        raise ReadingsError(f"{path}:{line}: {error}") from None


def _run(path: str, keys: Mapping[str, tuple[int, str]]) -> int | None:
    if "run" not in keys:
        return None
    line, said = keys["run"]
    if re.fullmatch(r"\d{1,9}", said, re.ASCII) is None:
        raise ReadingsError(f"{path}:{line}: the run {quoted(said)} must be a whole number from 0 up")
    return int(said)


def _start(path: str, keys: Mapping[str, tuple[int, str]]) -> Start | None:
    given = [key for key in (_MEAN, _COVARIANCE) if key in keys]
    if not given:
        return None
    if len(given) == 1:
        missing = _COVARIANCE if given[0] == _MEAN else _MEAN
        raise ReadingsError(f"{path}:{keys[given[0]][0]}: '# {given[0]}:' needs '# {missing}:' too")
    mean, covariance = (_vector(path, *keys[key], key, size) for key, size in ((_MEAN, 6), (_COVARIANCE, 36)))
    covariance = covariance.reshape(6, 6)
    if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0) or _is_negative(covariance):
        raise ReadingsError(f"{path}:{keys[_COVARIANCE][0]}: the start's covariance is not symmetric and positive")
    return Start(mean, covariance)


def _is_negative(covariance: Array) -> bool:
    values = np.linalg.eigvalsh(covariance)
    return bool(values[0] < -1e-12 * abs(values[-1]))


def _vector(path: str, line: int, said: str, key: str, size: int) -> Array:
    words = said.replace(",", " ").split()
    if len(words) != size:
        raise ReadingsError(f"{path}:{line}: {key} has {len(words)} numbers; it must have {size}")
    try:
        return np.array([number(word) for word in words])
    except ValueError as error:
        raise ReadingsError(f"{path}:{line}: a number of {key} {error}") from None
