"""HDF5 datasets and attributes as the layout names them, written and read with every check in one place.

A file may come from a stranger. Reading it runs no code: text is the only variable-length type accepted, links
to other files, external storage and virtual datasets are refused, and a dataset that claims far more data than
the file holds is refused before memory is asked for.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5g, h5l, h5o

from relnav_sim.results import hdf5, layout, seal
from relnav_sim.results.block import AnyArray, ResultsError
from relnav_sim.results.layout import Dataset, Dimension
from relnav_sim.results.locked import in_use, open_locked
from relnav_sim.results.patient_file import PatientFile
from relnav_sim.results.sound import odd_coordinate, odd_values, too_deep

# What h5py raises for damaged objects, unknown types and broken text.
_UNREADABLE = (KeyError, OSError, RuntimeError, TypeError, ValueError)
_LARGEST_COMPRESSION = 16
"""Bytes that a dataset may take in memory for each byte of its file; relnav writes without compression."""
_ALWAYS = 1 << 20
"""Bytes that any dataset may take."""
_MOST_NAMES = 100_000
_TEXT_AT_ONCE = 1 << 26
"""Bytes that are read at once where each text may be as long as the file."""


def create(group: h5py.Group, specs: Iterable[Dataset], lengths: dict[str, int]) -> dict[str, h5d.DatasetID]:
    """Create datasets of the layout with their attributes, and the dimensions that stand beside them.

    Args:
        group: The group, which has the coordinates of the dimensions.
        specs: The datasets.
        lengths: The length of each dimension.
    """
    shapes = {spec: layout.shape(spec, lengths) for spec in specs}
    made = {spec: _described(group, spec, _type(spec.dtype), shape) for spec, shape in shapes.items()}
    hdf5.attach_scales(group, [(dataset, spec.dims) for spec, dataset in made.items()])
    return {spec.name: dataset for spec, dataset in made.items()}


def write(group: h5py.Group, values: Mapping[Dataset, Any]) -> None:
    """Create datasets of the layout and fill them; the coordinates of their dimensions are there."""
    made = []
    for spec, given in values.items():
        array = _fixed_texts(given) if spec.dtype == layout.FIXED else np.asarray(given, dtype=_type(spec.dtype))
        dataset = _described(group, spec, array.dtype, array.shape)
        hdf5.write(dataset, array)
        made.append((dataset, spec.dims))
    hdf5.attach_scales(group, made)


def write_dimensions(group: h5py.Group, specs: Iterable[Dataset], **given: Sequence[Any] | AnyArray) -> None:
    """Write the coordinates that the datasets need and the group lacks: the layout's, and those given by name."""
    needed = dict.fromkeys(dim for spec in specs for dim in spec.dims)
    for name in [name for name in needed if name not in group]:
        dimension = layout.DIMENSIONS[name]
        values = given[name] if dimension.values is None else dimension.values
        array = np.asarray(values, dtype=_type(dimension.dtype))
        coordinate = _described(group, dimension, array.dtype, array.shape)
        hdf5.write(coordinate, array)
        hdf5.make_scale(coordinate, name)


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
    with open_locked(path) as raw:
        try:
            sealed = whole and seal.verify(raw, path)
            file = h5py.File(path, "r")
        except OSError as error:
            if isinstance(error, BlockingIOError):
                raise in_use(path) from None
            raise ResultsError(f"{path}: no HDF5 file, or a damaged one") from error
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


def text(group: h5py.Group | h5py.File, name: str) -> str:
    """Return a text attribute.

    Raises:
        ResultsError: It is missing or no text.
    """
    value = _attribute(group, name)
    if not isinstance(value, str):
        raise ResultsError(f"{group.file.filename}: {group.name} has no text attribute {name!r}")
    return value


def number(group: h5py.Group | h5py.File, name: str) -> float:
    """Return a numeric attribute.

    Raises:
        ResultsError: It is missing or no single finite number.
    """
    value = np.asarray(_attribute(group, name))
    if value.dtype.kind not in "iuf" or not np.isfinite(value):
        raise ResultsError(f"{group.file.filename}: {group.name} has no number {name!r}")
    return float(value)


def whole_number(group: h5py.Group | h5py.File, name: str) -> int:
    """Return an attribute that is a whole number.

    Raises:
        ResultsError: It is missing or none.
    """
    value = number(group, name)
    if not value.is_integer():
        raise ResultsError(f"{group.file.filename}: {name!r} of {group.name} is {value:g}, no whole number")
    return int(value)


def _attribute(group: h5py.Group | h5py.File, name: str) -> Any:
    """Return an attribute that is one text or one number; None for any other and where there is none."""
    try:
        return hdf5.attribute(group.id, name)
    except _UNREADABLE:
        return None


def json_value(group: h5py.Group | h5py.File, name: str, kind: type) -> Any:
    """Return an attribute that holds JSON of the given top-level type.

    Raises:
        ResultsError: It is missing, no JSON, or of another type.
    """
    value = plain(text(group, name), kind)
    if value is None:
        raise ResultsError(f"{group.file.filename}: attribute {name!r} of {group.name} is damaged")
    return value


def plain(words: str, kind: type) -> Any:
    """Return what a text holds as JSON; None where it is none, of another top-level type, or nested too deeply."""
    try:
        value = json.loads(words)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, kind) and not too_deep(value) else None


def names(group: h5py.Group | h5py.File) -> tuple[str, ...]:
    """Return the names inside a group.

    Raises:
        ResultsError: They can't be read.
    """
    try:
        if len(group) > _MOST_NAMES:
            raise ResultsError(f"{group.file.filename}: {group.name} holds {len(group)} objects; this is refused")
        return tuple(str(name) for name in group)
    except _UNREADABLE as error:
        raise ResultsError(f"{group.file.filename}: {group.name} can't be read ({error})") from None


def attributes(group: h5py.Group | h5py.File) -> dict[str, Any]:
    """Return all attributes of a group.

    Raises:
        ResultsError: They can't be read, or one is no single text or number.
    """
    try:
        found = {str(name): _attribute(group, name) for name in itertools.islice(group.attrs, _MOST_NAMES)}
    except _UNREADABLE as error:
        raise ResultsError(f"{group.file.filename}: attributes of {group.name} can't be read ({error})") from None
    if odd := [name for name, value in found.items() if value is None]:
        raise ResultsError(f"{group.file.filename}: attribute {odd[0]!r} of {group.name} is damaged")
    return found


def subgroup(group: h5py.Group | h5py.File, name: str) -> h5py.Group:
    """Return a group inside a group, never one that a link takes from another file.

    Raises:
        ResultsError: There is none.
    """
    if not is_group(group, name):
        raise ResultsError(f"{group.file.filename}: group {name!r} is missing in {group.name}")
    return group[name]


def is_group(group: h5py.Group | h5py.File, name: str) -> bool:
    """Return whether there is a group of this name.

    Raises:
        ResultsError: The name is a link.
    """
    return isinstance(_own_object(group, name), h5py.Group)


Shapes = dict[str, tuple[int, ...] | None]
"""Shapes of the coordinates in a group by name; None of those that it does not hold."""


def checked(group: h5py.Group, spec: Dataset | Dimension, beside: Shapes | None = None) -> h5py.Dataset:
    """Return a dataset after checking that it is stored as the layout says.

    Args:
        group: The group.
        spec: The dataset.
        beside: What is known of the group's coordinates, which need not be opened again; it grows.

    Raises:
        ResultsError: It is missing, of another type or number of dimensions, stored elsewhere, or damaged.
    """
    dataset = _own_object(group, spec.name)
    if odd := _odd_dataset(group, spec, dataset, {} if beside is None else beside):
        raise ResultsError(f"{group.file.filename}: {group.name}/{spec.name} {odd}")
    return dataset


def _odd_dataset(group: h5py.Group, spec: Dataset | Dimension, dataset: Any, beside: Shapes) -> str:
    """Return in words why what a group holds under the name of a dataset is none as the layout says; empty: it is."""
    if not isinstance(dataset, h5py.Dataset):
        return "is missing"
    dims = spec.dims if isinstance(spec, Dataset) else (spec.name,)
    try:
        dtype, shape, how = dataset.id.dtype, dataset.id.shape or (), dataset.id.get_create_plist()
    except _UNREADABLE as error:
        return f"can't be read ({error})"
    fits = h5py.check_string_dtype(dtype) is not None if spec.dtype in layout.TEXTS else dtype == np.dtype(spec.dtype)
    if not fits or len(shape) != len(dims) or not _lengths_fit(group, dims, shape, beside):
        return f"has type {dtype} and shape {shape}; the layout differs"
    if how.get_external_count() or how.get_layout() == h5d.VIRTUAL:
        return "takes its data from other files; this is refused"
    declared, stored = math.prod(shape) * dtype.itemsize, dataset.id.get_storage_size()
    chunked = how.get_layout() == h5d.CHUNKED
    if declared > stored and (stored == 0 or not chunked or declared > _most_bytes(dataset)):
        return "declares more data than the file holds"
    return ""


def _most_bytes(dataset: h5py.Dataset) -> int:
    """Return how many bytes a dataset may take in memory."""
    return _ALWAYS + _LARGEST_COMPRESSION * int(dataset.file.id.get_filesize())


def _texts(dataset: h5py.Dataset) -> AnyArray:
    """Return a dataset of texts, a few at a time: many may stand for one long text in the file."""
    info = h5py.check_string_dtype(dataset.dtype)
    if info is not None and info.length is not None:  # they are as long as they are stored
        return np.asarray(dataset.asstr()[...], dtype=object)
    at_once = max(1, _TEXT_AT_ONCE // int(dataset.file.id.get_filesize()))
    found: list[str] = []
    size = 0
    for first in range(0, len(dataset), at_once):
        part = dataset.asstr()[first : first + at_once]
        size += sum(map(len, part))
        if size > _most_bytes(dataset):
            raise ResultsError(f"{dataset.file.filename}: {dataset.name} declares more text than the file holds")
        found.extend(part)
    return np.array(found, dtype=object)


def read(group: h5py.Group, spec: Dataset | Dimension, index: Any = ...) -> AnyArray:
    """Return a checked dataset or a part of it; text as an array of `str`.

    Raises:
        ResultsError: As `checked`, the data can't be read, or they can't be what they should be.
    """
    return values_of(checked(group, spec), spec, index)


def values_of(dataset: h5py.Dataset, spec: Dataset | Dimension, index: Any = ...) -> AnyArray:
    """Return a dataset that `checked` gave, or a part of it; text as an array of `str`.

    Raises:
        ResultsError: The data can't be read, or they can't be what they should be.
    """
    try:
        if spec.dtype in layout.TEXTS:
            values = _texts(dataset)[index]
        else:
            values = hdf5.read(dataset.id) if index is ... else np.asarray(dataset[index])
        odd = odd_coordinate(spec, values) if isinstance(spec, Dimension) else odd_values(spec, values)
        if odd:
            raise ResultsError(f"{dataset.file.filename}: {dataset.name} {odd}; the file is damaged")
        return values
    except _UNREADABLE as error:
        raise ResultsError(f"{dataset.file.filename}: {dataset.name} can't be read ({error})") from None


def run_of_bytes(file: h5py.File, name: str) -> bytes:
    """Return a dataset of bytes.

    Raises:
        ResultsError: It is missing, of another type, stored elsewhere, or damaged.
    """
    where = f"{file.filename}: {name}"
    dataset = _own_object(file, name)
    try:
        plain = isinstance(dataset, h5py.Dataset) and dataset.dtype == np.uint8 and len(dataset.shape) == 1
        if not plain or dataset.external or dataset.is_virtual or dataset.size > dataset.id.get_storage_size():
            raise ResultsError(f"{where} is missing or damaged")
        return np.asarray(dataset[...]).tobytes()
    except _UNREADABLE as error:
        raise ResultsError(f"{where} can't be read ({error})") from None


def _lengths_fit(group: h5py.Group, dims: Sequence[str], shape: tuple[int, ...], beside: Shapes) -> bool:
    for dim, length in zip(dims, shape, strict=True):
        values = layout.DIMENSIONS[dim].values
        if values is not None and length != len(values):
            return False
        if values is None and dim not in beside:
            coordinate = _own_object(group, dim)
            beside[dim] = (coordinate.shape or ()) if isinstance(coordinate, h5py.Dataset) else None
        if beside.get(dim) not in (None, (length,)):
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
    """Return what the file itself holds under a name, and under no other; None where there is nothing."""
    place = name.encode()
    try:
        own = group.id.links.get_info(place).type == h5l.TYPE_HARD
        info = h5o.get_info(group.id, place) if own else None
        if info is not None and info.rc == 1:
            # h5py's own look-up opens the object, asks what it is and how its file was opened.
            if info.type == h5o.TYPE_DATASET:
                return h5py.Dataset(h5d.open(group.id, place), readonly=True)
            return h5py.Group(h5g.open(group.id, place))
    except _UNREADABLE:
        return None
    raise ResultsError(f"{group.file.filename}: {group.name}/{name} is a link to something else; this is refused")


def _type(dtype: str) -> np.dtype[Any]:
    return hdf5.TEXT if dtype == "str" else np.dtype(dtype)


def _fixed_texts(values: Iterable[Any]) -> AnyArray:
    texts = [str(value).encode() for value in values]
    return np.array(texts, dtype=h5py.string_dtype("utf-8", max(map(len, texts), default=0) or 1))


def _described(
    group: h5py.Group, spec: Dataset | Dimension, dtype: np.dtype[Any], shape: tuple[int, ...]
) -> h5d.DatasetID:
    """Create a dataset and write what it means."""
    dataset = hdf5.create(group, spec.name, dtype, shape)
    timing = {"timing": 1} if isinstance(spec, Dataset) and spec.timing else {}
    units = {"units": spec.units} if spec.units else {}
    hdf5.set_attributes(dataset, {**units, "long_name": spec.long_name, **timing})
    return dataset
