"""HDF5 datasets and attributes as the layout names them, written and read with every check in one place.

A file may come from a stranger. Reading it runs no code: text is the only variable-length type accepted, links
to other files, external storage and virtual datasets are refused, and a dataset that claims far more data than
the file holds is refused before memory is asked for.
"""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from relnav_sim.results import layout, seal
from relnav_sim.results.block import Array, ResultsError, UnavailableError
from relnav_sim.results.layout import Dataset, Dimension
from relnav_sim.results.patient_file import PatientFile

# What h5py raises for damaged objects, unknown types and broken text.
_UNREADABLE = (KeyError, OSError, RuntimeError, TypeError, ValueError)
_TEXT = h5py.string_dtype("utf-8")
_LARGEST_COMPRESSION = 1100  # deflate can't do better than about 1030 to 1


def create(group: h5py.Group, spec: Dataset, shape: tuple[int, ...]) -> h5py.Dataset:
    """Create a dataset of the layout, with its attributes and the dimensions that stand beside it."""
    dataset = group.create_dataset(spec.name, shape=shape, dtype=_stored_type(spec.dtype), track_times=False)
    _describe(dataset, spec.units, spec.long_name)
    if spec.timing:
        dataset.attrs["timing"] = 1
    for axis, dim in enumerate(spec.dims):
        dataset.dims[axis].attach_scale(group[dim])
    return dataset


def write(group: h5py.Group, spec: Dataset, values: Any) -> None:
    """Create a dataset of the layout and fill it."""
    array = np.asarray(values, dtype=object if spec.dtype == "str" else spec.dtype)
    create(group, spec, array.shape)[...] = array


def write_dimensions(group: h5py.Group, specs: Iterable[Dataset], **given: Sequence[Any] | Array) -> None:
    """Write the coordinates that the datasets need and the group lacks: the layout's, and those given by name."""
    for name in dict.fromkeys(dim for spec in specs for dim in spec.dims if dim not in group):
        dimension = layout.DIMENSIONS[name]
        values = given[name] if dimension.values is None else dimension.values
        array = np.asarray(values, dtype=object if dimension.dtype == "str" else dimension.dtype)
        coordinate = group.create_dataset(name, data=array, dtype=_stored_type(dimension.dtype), track_times=False)
        _describe(coordinate, dimension.units, dimension.long_name)
        coordinate.make_scale(name)


@contextmanager
def create_file(path: Path) -> Iterator[h5py.File]:
    """Create a file whose object headers carry checksums of their own: damage is then an error, not a crash.

    Raises:
        OSError: It can't be written.
    """
    with open(path, "w+b", buffering=0) as raw:
        patient = PatientFile(raw)
        try:
            with h5py.File(patient, "w", libver=("v108", "v108")) as file:
                yield file
        except Exception:
            # Any type: h5py reports a failed write by several, and the caller may raise in here too. What HDF5 makes of
            # a file that could not be written in full is only a consequence.
            patient.raise_error()
            raise
        patient.raise_error()


def open_checked(path: Path, expected: str, whole: bool = False) -> h5py.File:
    """Open a file for reading and check that it is what it should be.

    Args:
        path: The file.
        expected: The format that it should have.
        whole: Compare all its bytes with the seal at its end, if it has one.

    Raises:
        ResultsError: It is missing, no HDF5 file, damaged, of another format or of a newer version.
        UnavailableError: It is in use by another program, or may not be read.
    """
    with _open_locked(path) as raw:
        try:
            sealed = whole and seal.verify(raw, path)
            file = h5py.File(path, "r")
        except OSError as error:
            if isinstance(error, BlockingIOError):
                raise _in_use(path) from None
            raise ResultsError(f"{path}: no HDF5 file, or a damaged one ({error})") from None
    try:
        _check_format(file, path, expected)
        if whole and not sealed and is_sealed(file):
            raise seal.damaged(path)
    except ResultsError:
        file.close()
        raise
    return file


def is_sealed(file: h5py.File) -> bool:
    """Return whether a file says that it has a seal; earlier versions wrote none."""
    try:
        return seal.ATTRIBUTE in file.attrs
    except _UNREADABLE as error:
        raise ResultsError(f"{file.filename}: its attributes can't be read ({error})") from None


def _open_locked(path: Path) -> BinaryIO:
    """Open a file that no other program writes to."""
    try:
        if path.is_dir():
            raise ResultsError(f"{path} is a directory; give a file in it")
        if not path.exists():
            raise ResultsError(f"{path}: no such file")
        if not path.is_file():
            raise ResultsError(f"{path} is no regular file")
        raw = open(path, "rb")  # noqa: SIM115
    except OSError as error:
        raise UnavailableError(f"{path} can't be opened: {error.strerror or error}") from None
    try:
        if not raw.read(1):
            raise ResultsError(f"{path} is empty")
        fcntl.flock(raw, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        raw.close()
        raise _in_use(path) from None
    except ResultsError:
        raw.close()
        raise
    except OSError:
        pass  # Some file systems can't lock.
    return raw


def _in_use(path: Path) -> UnavailableError:
    return UnavailableError(f"{path} is in use: another program has it open to write; close it there and try again")


def text(group: h5py.Group | h5py.File, name: str) -> str:
    """Return a text attribute.

    Raises:
        ResultsError: It is missing or no text.
    """
    try:
        value = group.attrs[name]
    except _UNREADABLE:
        value = None
    if not isinstance(value, str):
        raise ResultsError(f"{group.file.filename}: {group.name} has no text attribute {name!r}")
    return value


def number(group: h5py.Group | h5py.File, name: str) -> float:
    """Return a numeric attribute.

    Raises:
        ResultsError: It is missing or no single number.
    """
    try:
        value = np.asarray(group.attrs[name])
    except _UNREADABLE:
        value = np.empty(0)
    if value.shape != () or value.dtype.kind not in "iuf":
        raise ResultsError(f"{group.file.filename}: {group.name} has no number {name!r}")
    return float(value)


def json_value(group: h5py.Group | h5py.File, name: str, kind: type) -> Any:
    """Return an attribute that holds JSON of the given top-level type.

    Raises:
        ResultsError: It is missing, no JSON, or of another type.
    """
    try:
        value = json.loads(text(group, name))
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, kind):
        raise ResultsError(f"{group.file.filename}: attribute {name!r} of {group.name} is damaged")
    return value


def names(group: h5py.Group | h5py.File) -> tuple[str, ...]:
    """Return the names inside a group.

    Raises:
        ResultsError: They can't be read.
    """
    try:
        return tuple(str(name) for name in group)
    except _UNREADABLE as error:
        raise ResultsError(f"{group.file.filename}: {group.name} can't be read ({error})") from None


def attributes(group: h5py.Group | h5py.File) -> dict[str, Any]:
    """Return all attributes of a group.

    Raises:
        ResultsError: They can't be read.
    """
    try:
        return dict(group.attrs)
    except _UNREADABLE as error:
        raise ResultsError(f"{group.file.filename}: attributes of {group.name} can't be read ({error})") from None


def subgroup(group: h5py.Group | h5py.File, name: str) -> h5py.Group:
    """Return a group inside a group, never one that a link takes from another file.

    Raises:
        ResultsError: There is none.
    """
    found = _own_object(group, name)
    if not isinstance(found, h5py.Group):
        raise ResultsError(f"{group.file.filename}: group {name!r} is missing in {group.name}")
    return found


def checked(group: h5py.Group, spec: Dataset | Dimension) -> h5py.Dataset:
    """Return a dataset after checking that it is stored as the layout says.

    Raises:
        ResultsError: It is missing, of another type or number of dimensions, stored elsewhere, or damaged.
    """
    where = f"{group.file.filename}: {group.name}/{spec.name}"
    dataset = _own_object(group, spec.name)
    if not isinstance(dataset, h5py.Dataset):
        raise ResultsError(f"{where} is missing")
    dims = spec.dims if isinstance(spec, Dataset) else (spec.name,)
    try:
        dtype, shape = dataset.dtype, dataset.shape or ()
    except _UNREADABLE as error:
        raise ResultsError(f"{where} can't be read ({error})") from None
    fits = h5py.check_string_dtype(dtype) is not None if spec.dtype == "str" else dtype == np.dtype(spec.dtype)
    if not fits or len(shape) != len(dims) or not _lengths_fit(group, dims, shape):
        raise ResultsError(f"{where} has type {dtype} and shape {shape}; the layout differs")
    if dataset.external or dataset.is_virtual:
        raise ResultsError(f"{where} takes its data from other files; this is refused")
    if dataset.size * dataset.dtype.itemsize > _LARGEST_COMPRESSION * dataset.id.get_storage_size():
        raise ResultsError(f"{where} claims more data than the file holds")
    return dataset


def read(group: h5py.Group, spec: Dataset | Dimension, index: Any = ...) -> Array:
    """Return a checked dataset or a part of it; text as an array of `str`.

    Raises:
        ResultsError: As `checked`, or the data can't be read.
    """
    dataset = checked(group, spec)
    try:
        if spec.dtype == "str":
            return np.array([*dataset.asstr()[index]], dtype=object)
        return np.asarray(dataset[index])
    except _UNREADABLE as error:
        raise ResultsError(f"{group.file.filename}: {dataset.name} can't be read ({error})") from None


def _lengths_fit(group: h5py.Group, dims: Sequence[str], shape: tuple[int, ...]) -> bool:
    for dim, length in zip(dims, shape, strict=True):
        values = layout.DIMENSIONS[dim].values
        if values is not None and length != len(values):
            return False
        coordinate = _own_object(group, dim) if values is None else None
        if isinstance(coordinate, h5py.Dataset) and coordinate.shape != (length,):
            return False
    return True


def _check_format(file: h5py.File, path: Path, expected: str) -> None:
    try:
        found, version = text(file, "format"), number(file, "format_version")
    except ResultsError:
        raise ResultsError(f"{path}: this HDF5 file was not written by relnav") from None
    if found != expected:
        raise ResultsError(f"{path}: this is a {found}, not a {expected}")
    if version > layout.FORMAT_VERSION:
        raise ResultsError(
            f"{path}: its format version is {version:.0f}; this relnav reads up to {layout.FORMAT_VERSION}"
        )


def _own_object(group: h5py.Group | h5py.File, name: str) -> Any:
    try:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            return group[name]
    except _UNREADABLE:
        pass
    return None


def _stored_type(dtype: str) -> Any:
    return _TEXT if dtype == "str" else np.dtype(dtype)


def _describe(dataset: h5py.Dataset, units: str, long_name: str) -> None:
    if units:
        dataset.attrs["units"] = units
    dataset.attrs["long_name"] = long_name
