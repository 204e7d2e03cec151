"""What HDF5's own calls write is what h5py's objects and HDF5's own dimension scales would have written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5py import h5a

from relnav_sim.results import hdf5

AXES = {"run": np.arange(3), "name": np.array(["Größe", "", "v"], dtype=object)}
FACTS = {"text": "Größe in m", "empty": "", "whole": -(2**62), "number": np.pi, "flag": np.int8(1)}
DATA = {
    "first": (("run", "name"), np.random.default_rng(1).standard_normal((3, 3))),
    "square": (("run", "run"), np.arange(9, dtype="<i2").reshape(3, 3)),
    "words": (("name",), np.array(["a", "ß" * 300, ""], dtype=object)),
    "fixed": (("run",), np.array([b"ab", "ß".encode(), b""], dtype=h5py.string_dtype("utf-8", 2))),
    "single": (("run",), np.arange(3, dtype="<f4")),
}
LATER = ("single",)
"""Written once the scales have lists of datasets already."""


def by_objects(file: h5py.File) -> None:
    group = file.create_group("group")
    group.attrs.update(FACTS)
    for name, values in AXES.items():
        kind = hdf5.TEXT if values.dtype == object else values.dtype
        group.create_dataset(name, data=values, dtype=kind, track_times=False).make_scale(name)
    for name, (dims, values) in DATA.items():
        kind = hdf5.TEXT if values.dtype == object else values.dtype
        dataset = group.create_dataset(name, data=values, dtype=kind, track_times=False)
        dataset.attrs["units"] = "m"
        for axis, dim in enumerate(dims):
            dataset.dims[axis].attach_scale(group[dim])


def by_calls(file: h5py.File) -> None:
    group = file.create_group("group")
    hdf5.set_attributes(group.id, FACTS)
    for name, values in AXES.items():
        hdf5.make_scale(_written(group, name, values), name)
    made = {}
    for name, (_, values) in DATA.items():
        made[name] = _written(group, name, values)
        hdf5.set_attributes(made[name], {"units": "m"})
    hdf5.attach_scales(group, [(made[name], dims) for name, (dims, _) in DATA.items() if name not in LATER])
    hdf5.attach_scales(group, [(made[name], DATA[name][0]) for name in LATER])


def _written(group: h5py.Group, name: str, values: np.ndarray) -> Any:
    values = values.astype(hdf5.TEXT) if values.dtype == object else values
    dataset = hdf5.create(group, name, values.dtype, values.shape)
    for row in (range(0, 1), range(1, 3)):
        hdf5.write(dataset, values[row.start : row.stop], row.start)
    return dataset


def facts_of(place: h5py.Group | h5py.Dataset) -> Iterator[Any]:
    """Yield name, type as HDF5 encodes it, shape and value of every attribute; places in place of references."""
    for name in sorted(place.attrs):
        one = h5a.open(place.id, name.encode())
        yield name, one.get_type().encode(), one.shape, one.get_space().get_simple_extent_type()
        yield _told(place.file, place.attrs[name])


def _told(file: h5py.File, value: Any) -> Any:
    if isinstance(value, h5py.Reference):
        return file[value].name
    plain = value.tolist() if isinstance(value, np.ndarray) else value
    return [_told(file, one) for one in plain] if isinstance(plain, list | tuple) else plain


def test_the_file_says_the_same(tmp_path: Path) -> None:
    for name, write in (("objects", by_objects), ("calls", by_calls)):
        with h5py.File(tmp_path / name, "w", libver=("v108", "v108")) as file:
            write(file)
    with h5py.File(tmp_path / "objects") as one, h5py.File(tmp_path / "calls") as other:
        here, there = one["group"], other["group"]
        assert list(here) == list(there) and list(facts_of(here)) == list(facts_of(there))
        for name in here:
            a, b = here[name], there[name]
            assert a.id.get_type().encode() == b.id.get_type().encode() and a.shape == b.shape
            assert a.id.get_create_plist().equal(b.id.get_create_plist())
            assert a[...].tolist() == b[...].tolist() and list(facts_of(a)) == list(facts_of(b))
            assert [dim.keys() for dim in a.dims] == [dim.keys() for dim in b.dims]
        assert there["square"].dims[1][0] == there["run"] and len(there["run"].attrs["REFERENCE_LIST"]) == 5
        assert {name: hdf5.attribute(there.id, name) for name in FACTS} == FACTS


@pytest.mark.parametrize("value", [[1, 2], np.zeros((1,)), h5py.Empty("f8"), True])
def test_what_is_no_single_text_or_number_is_none(tmp_path: Path, value: Any) -> None:
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.attrs["odd"] = value
        assert hdf5.attribute(file.id, "odd") is None


def test_chunks_that_a_file_lacks_are_zeros(tmp_path: Path) -> None:
    """HDF5 leaves their places as they are, which may be numbers that the process had before."""
    with h5py.File(tmp_path / "lacks.h5", "w") as file:
        dataset = file.create_dataset("x", (3000, 2), "<i8", chunks=(1, 2), fill_time="never")
        dataset[0] = 7
        before = np.full((3000, 2), 123456789, "<i8")
        del before
        found = hdf5.read(dataset.id)
    np.testing.assert_array_equal(found, np.pad([[7, 7]], ((0, 2999), (0, 0))))
