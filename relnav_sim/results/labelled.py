"""A results file as a tree of labelled xarray datasets, read only where they are looked at.

`xarray.open_datatree` gives the same tree, but resolves every dimension by searching the whole file for the
name of an object: 14 s for 8 cases and 6 filters, where this takes a fraction of a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from relnav_sim.results import layout, store
from relnav_sim.results.pieces import columns_of


def labelled_tree(path: Path, file: h5py.File) -> xarray.DataTree:
    """Return the tree: a node per case, below it one per filter and one for the failures.

    Args:
        path: The results file; datasets are read from it when they are used, also after ``file`` is closed.
        file: The same file, open.
    """
    nodes = {"/": xarray.Dataset(attrs=store.attributes(file))}
    for name in [name for name in store.names(file) if name.startswith("case_")]:
        case = store.subgroup(file, name)
        nodes[name] = _dataset(path, case, (layout.TRUTH, *_limits(case)) if "failures" in store.names(case) else ())
        for child in [child for child in store.names(case) if store.is_group(case, child)]:
            group = store.subgroup(case, child)
            columns = columns_of(group)
            units = (layout.AUGMENTED_UNIT,) if columns.augmented else ()
            specs = (*columns.datasets, *units, *_limits(group))
            nodes[f"{name}/{child}"] = _dataset(path, group, layout.FAILURES if child == "failures" else specs)
    return xarray.DataTree.from_dict(nodes)


def _limits(group: h5py.Group) -> tuple[layout.Dataset, ...]:
    """Return what a group holds of bounds and observability."""
    held = store.names(group)
    return tuple(spec for spec in layout.LIMITS if spec.name in held)


def _dataset(path: Path, group: h5py.Group, specs: Sequence[layout.Dataset]) -> xarray.Dataset:
    coordinates = {}
    for name in dict.fromkeys(dim for spec in specs for dim in spec.dims):
        dimension = layout.DIMENSIONS[name]
        coordinates[name] = (name, store.read(group, dimension), _meaning(dimension))
    variables = {}
    for spec in specs:
        if spec.dtype == "str":
            values: Any = store.read(group, spec)
        else:
            values = indexing.LazilyIndexedArray(_Stored(path, group.name, spec, store.checked(group, spec).shape))
        variables[spec.name] = xarray.Variable(spec.dims, values, _meaning(spec))
    return xarray.Dataset(variables, coordinates, store.attributes(group))


class _Stored(BackendArray):
    """A dataset that is read when its numbers are asked for."""

    def __init__(self, path: Path, group: str, spec: layout.Dataset, shape: tuple[int, ...]) -> None:
        self._path, self._group, self._spec = path, group, spec
        self.shape, self.dtype = shape, np.dtype(spec.dtype)

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[Any, ...]) -> NDArray[Any]:
        with store.open_checked(self._path, layout.FORMAT) as file:
            return store.read(file[self._group], self._spec, key)


def _meaning(spec: layout.Dataset | layout.Dimension) -> dict[str, str]:
    return {"units": spec.units, "long_name": spec.long_name} if spec.units else {"long_name": spec.long_name}
