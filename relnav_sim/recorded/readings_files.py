"""Files of measurements, each in the format that it turns out to have, put together to runs."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.readings import Layout, Readings, ReadingsError, Start, assemble
from relnav_sim.recorded.readings_csv import read_csv
from relnav_sim.recorded.recording import LINE_ENDS, Recording
from relnav_sim.recorded.tdm import read_tdm
from relnav_sim.recorded.tdm_segments import VERSION
from relnav_sim.wording import listed

_MARKS = {
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
    b"\x89HDF": "an HDF5 file",
    b"PK\x03\x04": "a ZIP archive or a spreadsheet",
    b"\x1f\x8b": "compressed",
}


def load_readings(
    paths: Sequence[str | os.PathLike[str]],
    layout: Layout,
    epoch: Epoch | None = None,
    sort: bool = False,
    participants: Mapping[str, str] | None = None,
) -> tuple[Readings, ...]:
    """Return the runs that are recorded in some files, CSV or CCSDS TDM.

    Files of the same run are put together: sensors may have a file each, a long flight one after the other. A file that
    names no run belongs to the only one that the others name.

    Args:
        paths: The files.
        layout: The numbers of the measurements of the campaign's sensors, as `sensors.readings_layout` gives them.
        epoch: The instant of the campaign's 0 s; None: it has no calendar.
        sort: Whether rows may be out of order or stand there twice.
        participants: Which sensor a participant of a TDM is, by the participant's name.

    Returns:
        The runs by ascending number; 0 where no file names one.

    Raises:
        ReadingsError: A file can't be used, or files do not go together.
        OSError: A file can't be read.
    """
    files = [_read(os.fspath(path), layout, epoch, sort, participants or {}) for path in paths]
    _check_epochs(files, epoch)
    runs = sorted({file.run for file in files if file.run is not None}) or [0]
    for file in files:
        if file.run is None and len(runs) > 1:
            raise ReadingsError(f"{file.file}: it names no run, and other files are of several; add a line '# run: N'")
    return tuple(_run(run, [file for file in files if file.run in (run, None)], layout, sort) for run in runs)


def _run(run: int, files: Sequence[Recording], layout: Layout, sort: bool) -> Readings:
    sensors = assemble([column for file in files for column in file.columns], layout, sort)
    if not sensors:
        raise ReadingsError(f"{listed([file.file for file in files])}: no cell holds a measurement")
    notes = tuple(note for file in files for note in file.notes)
    return Readings(sensors, _start(files), run, notes)


def _start(files: Sequence[Recording]) -> Start | None:
    given = [(file.file, file.start) for file in files if file.start is not None]
    if not given:
        return None
    (first, start), *others = given
    for name, other in others:
        if (other.mean != start.mean).any() or (other.covariance != start.covariance).any():
            raise ReadingsError(f"{name}: its start is another one than that of {first}; leave one of them out")
    return start


def _check_epochs(files: Sequence[Recording], epoch: Epoch | None) -> None:
    """Refuse files that count from different instants, where the campaign's epoch does not join them."""
    told = [(file.file, file.epoch) for file in files if file.epoch is not None]
    if epoch is not None or not told:
        return
    (first, zero), *others = told
    for name, other in others:
        if other != zero:
            raise ReadingsError(
                f"{name}: it counts from {other.text()}, and {first} from {zero.text()}; "
                "give the campaign a truth.epoch"
            )


def _read(path: str, layout: Layout, epoch: Epoch | None, sort: bool, participants: Mapping[str, str]) -> Recording:
    """Return what a file holds, in the format that its beginning tells."""
    text = _text(path)
    begin = text.lstrip()
    if begin.startswith(VERSION):
        return read_tdm(path, text, layout, epoch, sort, participants)
    if found := re.match(r"CCSDS_(\w+)_VERS", begin):
        raise ReadingsError(f"{path}:1: it is a CCSDS {found[1]}; measurements are in CSV or in a CCSDS TDM")
    if begin.startswith("<"):
        raise ReadingsError(f"{path}:1: it is XML; measurements are in CSV or in a CCSDS TDM of KEYWORD = value lines")
    return read_csv(path, text, layout, epoch)


def _text(path: str) -> str:
    data = Path(path).read_bytes()
    for mark, what in _MARKS.items():
        if data.startswith(mark):
            raise ReadingsError(f"{path}: it is {what}; give a text file in UTF-8, CSV or CCSDS TDM")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = _line(data[: error.start].decode("utf-8", "replace"))
        raise ReadingsError(f"{path}:{line}: it is no text in UTF-8; save it as such") from None
    if "\0" in text:
        raise ReadingsError(f"{path}:{_line(text[: text.index(chr(0))])}: it holds a zero byte, so it is no text")
    if not text.strip():
        raise ReadingsError(f"{path}: it is empty")
    return text


def _line(before: str) -> int:
    return len(LINE_ENDS.split(before))
