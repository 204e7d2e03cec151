"""Datasets, attributes and dimension scales by HDF5's own calls, which h5py has in `h5py.h5d`, `h5py.h5a` and so on.

A results file is hundreds of small datasets with two or three attributes each. h5py's objects look each of them up by
its path and ask for its type at every step, and HDF5's `H5DSattach_scale` writes the list of a scale's datasets again
for each of them: most of the time that a small campaign took to write. The file says the same either way.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5p, h5r, h5s, h5t
from numpy.typing import NDArray

TEXT = h5py.string_dtype("utf-8")
"""Texts of any length."""

_LIST_OF_SCALES, _LIST_OF_DATASETS = b"DIMENSION_LIST", b"REFERENCE_LIST"
"""The attributes that a dataset and a scale have of each other: HDF5 Dimension Scale Specification, section 3."""
_SCALES = h5py.vlen_dtype(h5py.ref_dtype)
_USE = np.dtype(
    {"names": ["dataset", "dimension"], "formats": [h5py.ref_dtype, "<u4"], "offsets": [0, 8], "itemsize": 16}
)
"""That a dataset has a scale along one of its axes."""
_OWN = (TEXT, _SCALES, _USE)


def create(group: h5py.Group, name: str, dtype: np.dtype[Any], shape: Sequence[int]) -> h5d.DatasetID:
    """Create a contiguous dataset without times, so that the same numbers give the same bits."""
    return h5d.create(group.id, name.encode(), _types(dtype)[0], h5s.create_simple(tuple(shape)), _without_times())


def write(dataset: h5d.DatasetID, values: NDArray[Any], first: int = 0) -> None:
    """Write as many rows of a dataset as there are values, from the first on."""
    _, in_memory = _types(values.dtype)
    values = np.asarray(values, order="C")
    if values.shape == dataset.shape:
        dataset.write(h5s.ALL, h5s.ALL, values, in_memory)
        return
    rows = dataset.get_space()
    rows.select_hyperslab((first, *[0] * (values.ndim - 1)), values.shape)
    dataset.write(h5s.create_simple(values.shape), rows, values, in_memory)


def read(dataset: h5d.DatasetID) -> NDArray[Any]:
    """Return all numbers of a dataset."""
    values = np.zeros(dataset.shape, dtype=dataset.dtype)  # a chunk that the file lacks may leave its place as it is
    dataset.read(h5s.ALL, h5s.ALL, values, _types(values.dtype)[1])
    return values


def set_attributes(place: h5py.h5g.GroupID | h5d.DatasetID, values: Mapping[str, Any]) -> None:
    """Give a group or dataset attributes that it has not yet, each a text or a number."""
    for name, value in values.items():
        _set(place, name.encode(), np.asarray(value, dtype=TEXT if isinstance(value, str) else None))


def attribute(place: h5py.h5g.GroupID, name: str) -> str | int | float | bytes | None:
    """Return an attribute that is one text or one number; None for any other."""
    found = h5a.open(place, name.encode())
    if found.get_space().get_simple_extent_type() != h5s.SCALAR:
        return None
    dtype = found.dtype
    if dtype.kind not in "iuf" and h5py.check_string_dtype(dtype) is None:
        return None
    value = np.empty((), dtype=dtype)
    found.read(value)
    plain: str | int | float | bytes = value.item()
    return plain.decode("utf-8", "surrogateescape") if isinstance(plain, bytes) and dtype.kind == "O" else plain


def make_scale(dataset: h5d.DatasetID, name: str) -> None:
    """Make a dataset the scale of the dimension of this name."""
    h5ds.set_scale(dataset, name.encode())


def attach_scales(group: h5py.Group, datasets: Iterable[tuple[h5d.DatasetID, Sequence[str]]]) -> None:
    """Give new datasets of a group their scales, named in the order of their axes, which stand beside them."""
    scales: dict[str, h5d.DatasetID] = {}
    beside: dict[str, NDArray[Any]] = {}
    uses: dict[str, list[tuple[h5r.Reference, int]]] = {}
    for dataset, dims in datasets:
        own = h5r.create(dataset, b".", h5r.OBJECT)
        for axis, dim in enumerate(dims):
            if dim not in scales:
                scales[dim] = h5d.open(group.id, dim.encode())
                beside[dim] = np.array([h5r.create(scales[dim], b".", h5r.OBJECT)], dtype=h5py.ref_dtype)
                uses[dim] = []
            uses[dim].append((own, axis))
        along = np.empty(len(dims), dtype=_SCALES)
        along[:] = [beside[dim] for dim in dims]
        _set(dataset, _LIST_OF_SCALES, along)
    for dim, scale in scales.items():
        known = _taken(scale, _LIST_OF_DATASETS) if h5a.exists(scale, _LIST_OF_DATASETS) else []
        _set(scale, _LIST_OF_DATASETS, np.array([*known, *uses[dim]], dtype=_USE))


def _taken(place: h5d.DatasetID, name: bytes) -> list[Any]:
    """Return an attribute's entries, and delete it: HDF5 can't make one longer."""
    known = h5a.open(place, name)
    values = np.empty(known.shape, dtype=known.dtype)
    known.read(values)
    h5a.delete(place, name)
    return list(values.tolist())


def _set(place: h5py.h5g.GroupID | h5d.DatasetID, name: bytes, values: NDArray[Any]) -> None:
    in_file, in_memory = _types(values.dtype)
    space = h5s.create_simple(values.shape) if values.shape else _single()
    h5a.create(place, name, in_file, space).write(values, in_memory)


def _types(dtype: np.dtype[Any]) -> tuple[h5t.TypeID, h5t.TypeID]:
    """Return HDF5's types of a NumPy type in the file and in memory, which take as long to make as to write a text."""
    if dtype.kind in "iuf":
        return _types_of_numbers(dtype.str)
    # What h5py notes in a type of texts or references does not count when NumPy compares types: by identity, then.
    return next((_types_here(place) for place, own in enumerate(_OWN) if dtype is own), None) or _made(dtype)


@functools.cache
def _types_of_numbers(dtype: str) -> tuple[h5t.TypeID, h5t.TypeID]:
    return _made(np.dtype(dtype))


@functools.cache
def _types_here(place: int) -> tuple[h5t.TypeID, h5t.TypeID]:
    return _made(_OWN[place])


def _made(dtype: np.dtype[Any]) -> tuple[h5t.TypeID, h5t.TypeID]:
    return h5t.py_create(dtype, logical=True), h5t.py_create(dtype)


@functools.cache
def _single() -> h5s.SpaceID:
    return h5s.create(h5s.SCALAR)


@functools.cache
def _without_times() -> h5p.PropDCID:
    plain = h5p.create(h5p.DATASET_CREATE)
    plain.set_obj_track_times(False)
    return plain
