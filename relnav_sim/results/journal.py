"""Many small shards in one file that only grows: where a folder of a hundred thousand files would hurt.

A journal is a row of frames: a mark, the lengths of what follows, a digest of the frame's head, the head (what a
bundle's file has as attributes), the bundle's bytes, the length of it all. Whoever is killed while he appends leaves a
torn frame at the end, which the next one cuts off; a frame that is damaged in the middle costs itself alone, as the
next mark is searched for.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

from relnav_sim.results.atomic import sync_directory, written_whole
from relnav_sim.results.block import ResultsError, UnavailableError
from relnav_sim.results.bundle import Arrays, Bundle, parted

JOURNAL = "shards.journal"
_MARK = b"\x89relnav\n"
_LENGTHS = struct.Struct("<IQ")
_DIGEST = hashlib.sha256().digest_size
_PREFIX = len(_MARK) + _LENGTHS.size + _DIGEST
_WHOLE = struct.Struct("<Q")
_PIECE = 1 << 20
_TEXTS = ("name", "header", "table", "checksum")


@dataclass(frozen=True)
class Frame:
    """A bundle in a journal.

    Attributes:
        first: Where the frame begins, bytes.
        last: Where it ends.
        data_first: Where the bundle's bytes begin.
        data_length: How many they are.
        texts: Its name, and its texts as `bundle.written` makes them.
    """

    first: int
    last: int
    data_first: int
    data_length: int
    texts: Mapping[str, str]


def append(folder: Path, bundles: Iterable[tuple[str, Mapping[str, str], bytes]]) -> None:
    """Add bundles to the journal of a folder; they are on the disk when this returns.

    Args:
        folder: The folder, held by this process alone.
        bundles: Each with its name, and its texts and bytes as `bundle.written` makes them.

    Raises:
        OSError: The journal can't be written.
    """
    path = folder / JOURNAL
    path.touch()
    with open(path, "r+b") as file:
        file.seek(_end(path))
        file.truncate()  # of a torn frame
        for name, texts, data in bundles:
            file.write(_frame(name, texts, data))
        file.flush()
        os.fsync(file.fileno())
    sync_directory(folder)


def names(folder: Path) -> set[str]:
    """Return the names of what the journal of a folder holds.

    Raises:
        UnavailableError: It can't be read.
    """
    return {frame.texts["name"] for frame in _frames(folder / JOURNAL)}


def bundles(folder: Path, suffix: str) -> dict[str, Bundle]:
    """Return what the journal of a folder holds with such names, by name; the latest of a name counts.

    Raises:
        UnavailableError: It can't be read.
    """
    path = folder / JOURNAL
    frames = {frame.texts["name"]: frame for frame in _frames(path) if frame.texts["name"].endswith(suffix)}
    return {name: bundle for name, frame in frames.items() if (bundle := _bundle(path, frame)) is not None}


def _bundle(path: Path, frame: Frame) -> Bundle | None:
    texts = frame.texts
    try:
        header = json.loads(texts["header"])
    except (RecursionError, ValueError):
        return None
    load = partial(_load, path, texts, frame.data_first, frame.data_length)
    return Bundle(path, texts["name"], header, texts["checksum"], load)


def drop(folder: Path, names: Iterable[str]) -> None:
    """Write the journal of a folder anew without some of its bundles.

    Raises:
        OSError: It can't be written.
    """
    path, unwanted = folder / JOURNAL, set(names)
    kept = [frame for frame in _frames(path) if frame.texts["name"] not in unwanted]
    with open(path, "rb") as old, written_whole(path) as temporary, open(temporary, "wb") as new:
        for frame in kept:
            old.seek(frame.first)
            new.write(old.read(frame.last - frame.first))


def _frame(name: str, texts: Mapping[str, str], data: bytes) -> bytes:
    head = json.dumps({"name": name, **texts}).encode()
    lengths = _LENGTHS.pack(len(head), len(data))
    body = _MARK + lengths + hashlib.sha256(lengths + head).digest() + head + data
    return body + _WHOLE.pack(len(body) + _WHOLE.size)


def _frames(path: Path) -> Iterator[Frame]:
    """Yield the whole frames of a journal, in order; nothing where there is none."""
    try:
        file = open(path, "rb")  # noqa: SIM115 - closed below
    except FileNotFoundError:
        return
    except OSError as error:
        raise UnavailableError(f"{path} can't be opened: {error.strerror or error}") from None
    with file:
        size = file.seek(0, os.SEEK_END)
        place: int | None = 0
        while place is not None and place < size:
            frame = _frame_at(path, file, place, size)
            if frame is not None:
                yield frame
            place = frame.last if frame is not None else _next_mark(file, place + 1)


def _end(path: Path) -> int:
    """Return where the last whole frame of a journal ends."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        file.seek(max(size - _WHOLE.size, 0))
        length = file.read()
        if len(length) == _WHOLE.size and 0 < (whole := _WHOLE.unpack(length)[0]) <= size:
            frame = _frame_at(path, file, size - whole, size)
            if frame is not None and frame.last == size:
                return size
    last = 0  # the last frame is torn
    for frame in _frames(path):
        last = frame.last
    return last


def _frame_at(path: Path, file: BinaryIO, first: int, size: int) -> Frame | None:
    """Return the frame that begins at a place; None where none does, or a damaged or torn one."""
    file.seek(first)
    prefix = file.read(_PREFIX)
    if len(prefix) < _PREFIX or not prefix.startswith(_MARK):
        return None
    lengths = prefix[len(_MARK) : -_DIGEST]
    head_length, data_length = _LENGTHS.unpack(lengths)
    data_first = first + _PREFIX + head_length
    last = data_first + data_length + _WHOLE.size
    if last > size:
        return None
    head = file.read(head_length)
    if hashlib.sha256(lengths + head).digest() != prefix[-_DIGEST:]:
        return None
    try:
        found = json.loads(head)
        texts = {name: str(found[name]) for name in _TEXTS}
    except (KeyError, RecursionError, TypeError, ValueError):
        return None
    return Frame(first, last, data_first, data_length, texts)


def _next_mark(file: BinaryIO, start: int) -> int | None:
    """Return where the next mark begins, from a place on; None where there is none."""
    file.seek(start)
    before = b""
    while piece := file.read(_PIECE):
        if (found := (before + piece).find(_MARK)) >= 0:
            return start - len(before) + found
        start += len(piece)
        before = (before + piece)[-len(_MARK) + 1 :]
    return None


def _load(path: Path, texts: Mapping[str, str], first: int, length: int) -> Arrays:
    try:
        with open(path, "rb") as file:
            file.seek(first)
            data = file.read(length)
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file") from None
    except OSError as error:
        raise UnavailableError(f"{path} can't be read: {error.strerror or error}") from None
    return parted(texts, data, f"{path}: {texts['name']}")


Take = Callable[[Path], tuple[dict[str, str], bytes] | None]
"""Returns the texts and bytes of a bundle's file; None for one that has to stay."""


def take_over(folder: Path, files: Iterable[Path], take: Take) -> None:
    """Move bundles from files of their own into the journal; at any moment each is whole in one of them at least.

    Raises:
        OSError: The journal can't be written.
    """
    moved: list[Path] = []

    def taken() -> Iterator[tuple[str, Mapping[str, str], bytes]]:
        for file in files:
            try:
                found = take(file)
            except ResultsError:  # damaged: whoever looks for it will say so
                continue
            if found is not None:
                moved.append(file)
                yield (file.name, *found)

    append(folder, taken())
    for file in moved:
        file.unlink()
