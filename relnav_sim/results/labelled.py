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

from relnav_sim.results import layout, stacks, store
from relnav_sim.results.stored_cases import columns_of


def labelled_tree(path: Path, file: h5py.File) -> xarray.DataTree:
    """Return the tree: a node per case or stack of cases, below it one per filter and one for the failures.

    Args:
        path: The results file; datasets are read from it when they are used, also after ``file`` is closed.
        file: The same file, open.
    """
    nodes = {"/": xarray.Dataset(attrs=store.attributes(file))}
    if stacks.CASES in store.names(file):
        table = store.subgroup(file, stacks.CASES)
        nodes[stacks.CASES] = _dataset(path, table, (*stacks.CASE_TABLE, stacks.STACK))
    for name in [name for name in store.names(file) if name.startswith(("case_", "stack_"))]:
        case = store.subgroup(file, name)
        held = "failures" in store.names(case)
        nodes[name] = _dataset(path, case, (layout.TRUTH, *_limits(case), *_owners(case)) if held else ())
        for child in [child for child in store.names(case) if store.is_group(case, child)]:
            group = store.subgroup(case, child)
            columns = columns_of(group)
            units = (layout.AUGMENTED_UNIT,) if columns.augmented else ()
            specs = (*columns.datasets, *units, *_limits(group)) if child != "failures" else layout.FAILURES
            nodes[f"{name}/{child}"] = _dataset(path, group, (*specs, *_owners(group)))
    return xarray.DataTree.from_dict(nodes)


def _limits(group: h5py.Group) -> tuple[layout.Dataset, ...]:
    """Return what a group holds of bounds and observability."""
    held = store.names(group)
    limits = tuple(spec for spec in layout.LIMITS if spec.name in held)
    if "case" not in held:
        return limits
    facts = [spec for spec in stacks.OBSERVED_FACTS if spec.name in held]
    return (*map(stacks.stacked, limits), *facts)


def _owners(group: h5py.Group) -> tuple[layout.Dataset, ...]:
    """Return what says in a stack whose the rows are."""
    held = store.names(group)
    axis = next((axis for axis in ("run", "trajectory", "failure") if axis in held), "")
    return (stacks.row_of_case("failure" if "reason" in held else axis),) if "case" in held else ()


def _dataset(path: Path, group: h5py.Group, specs: Sequence[layout.Dataset]) -> xarray.Dataset:
    coordinates = {}
    for name in dict.fromkeys(dim for spec in specs for dim in spec.dims):
        dimension = layout.DIMENSIONS[name]
        rows = stacks.rows_of(name) if name in ("run", "trajectory") and "case" in store.names(group) else dimension
        coordinates[name] = (name, store.read(group, rows), _meaning(dimension))
    variables = {}
    for spec in specs:
        if spec.dtype in layout.TEXTS:
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
