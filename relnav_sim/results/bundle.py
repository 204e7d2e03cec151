"""Arrays with a header and a checksum over both: what a shard and a bound are, in a file of its own or in a journal.

All arrays lie one after the other in one run of bytes, whose table says name, type and shape of each. A file with a
dataset for each of sixty arrays takes many times as long to write and to read, and that is what small cases would cost.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from relnav_sim.results import hdf5, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import AnyArray, ResultsError

ONE_RUN_OF_BYTES = 2
"""Version of files that hold their arrays so; before, each was a dataset of its own."""
_DATA = "data"

Table = Sequence[Sequence[Any]]
"""Name, NumPy type string and shape of each array, in the order of their bytes."""
Arrays = dict[str, AnyArray]


@dataclass(frozen=True)
class Bundle:
    """A header, and arrays that are read and verified when they are asked for.

    Attributes:
        path: The file that it lies in.
        name: Its name: that of its own file, also where it lies in a journal.
        header: What it says of itself, not verified before the arrays are loaded.
        checksum: Over header and arrays.
        load: Returns the arrays by name; raises `ResultsError` where the checksum does not match.
    """

    path: Path
    name: str
    header: Mapping[str, Any]
    checksum: str
    load: Callable[[], Arrays]


def written(header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> tuple[dict[str, str], bytes]:
    """Return what a file or a journal stores: the texts ``header``, ``table`` and ``checksum``, and the bytes."""
    ordered = {name: np.ascontiguousarray(array) for name, array in sorted(arrays.items())}
    table = json.dumps([[name, array.dtype.str, array.shape] for name, array in ordered.items()])
    text, data = json.dumps(header), b"".join(array.tobytes() for array in ordered.values())
    return {"header": text, "table": table, "checksum": _digest(text, table, data)}, data


def parted(texts: Mapping[str, str], data: bytes, where: str) -> Arrays:
    """Return the arrays that `written` has made one run of bytes, after verifying the checksum.

    Raises:
        ResultsError: They differ from what was written.
    """
    if texts["checksum"] != _digest(texts["header"], texts["table"], data):
        raise ResultsError(f"{where}: checksum does not match; the file is damaged")
    arrays, first = {}, 0
    try:
        for name, dtype, shape in json.loads(texts["table"]):
            count = math.prod(shape)
            arrays[str(name)] = np.frombuffer(data, dtype, count, first).reshape(shape)
            first += count * np.dtype(dtype).itemsize
    except (AttributeError, MemoryError, OverflowError, RecursionError, TypeError, ValueError):
        raise ResultsError(f"{where}: its table of arrays is damaged") from None
    return arrays


def write_bundle(path: Path, form: str, header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> None:
    """Write a bundle into a file of its own.

    Raises:
        OSError: The file can't be written.
    """
    texts, data = written(header, arrays)
    with written_whole(path) as temporary, store.create_file(temporary) as file:
        hdf5.set_attributes(file.id, {"format": form, "format_version": ONE_RUN_OF_BYTES, **texts})
        values = np.frombuffer(data, dtype=np.uint8)
        hdf5.write(hdf5.create(file, _DATA, values.dtype, values.shape), values)


Former = Callable[[h5py.File, Mapping[str, Any]], Arrays]
"""Reads and verifies the arrays of a file of the version before."""


def open_bundle(path: Path, form: str, former: Former) -> Bundle:
    """Return the bundle of a file.

    Args:
        path: The file.
        form: The format that it should have.
        former: Reads and verifies the arrays of a file of the version before.

    Raises:
        ResultsError: The file is missing, torn or no such bundle.
    """
    with store.open_checked(path, form) as file:
        header, checksum = store.json_value(file, "header", dict), store.text(file, "checksum")
    return Bundle(path, path.name, header, checksum, lambda: _loaded(path, form, former))


def read_bundle(path: Path, form: str, former: Former) -> Bundle:
    """Return the bundle of a file as `open_bundle` does, its arrays loaded at once: the file is opened only once."""
    with store.open_checked(path, form) as file:
        header, checksum = store.json_value(file, "header", dict), store.text(file, "checksum")
        arrays = _arrays(file, path, former)
    return Bundle(path, path.name, header, checksum, lambda: arrays)


def stored_texts(path: Path, form: str) -> tuple[dict[str, str], bytes] | None:
    """Return what `written` returned for a file, for a journal to take over; None for a file of the version before.

    Raises:
        ResultsError: The file is missing, torn or no such bundle.
    """
    with store.open_checked(path, form) as file:
        if store.whole_number(file, "format_version") < ONE_RUN_OF_BYTES:
            return None
        return _texts(file), store.run_of_bytes(file, _DATA)


def _loaded(path: Path, form: str, former: Former) -> Arrays:
    with store.open_checked(path, form) as file:
        return _arrays(file, path, former)


def _arrays(file: h5py.File, path: Path, former: Former) -> Arrays:
    if store.whole_number(file, "format_version") < ONE_RUN_OF_BYTES:
        return former(file, store.json_value(file, "header", dict))
    return parted(_texts(file), store.run_of_bytes(file, _DATA), str(path))


def _texts(file: h5py.File) -> dict[str, str]:
    return {name: store.text(file, name) for name in ("header", "table", "checksum")}


def _digest(header: str, table: str, data: bytes) -> str:
    digest = hashlib.sha256(json.dumps([header, table]).encode())
    digest.update(data)
    return digest.hexdigest()
