"""Where a results file holds a case: in a group of its own, or in rows of a stack that it shares with cases alike.

Who reads a case asks here for a dataset by its name in the layout, and gets what is of that case.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import h5py
import numpy as np

from relnav_sim.results import layout, stacks, store
from relnav_sim.results.block import AnyArray, Failure, ResultsError
from relnav_sim.results.layout import Dataset, Dimension
from relnav_sim.results.observability import Observability, course_of
from relnav_sim.results.read_ahead import ReadAhead
from relnav_sim.results.sound import odd_coordinate

_NO_ROWS = slice(0, 0)
_MOST_PARTS = 64
"""Cases and filters whose groups and datasets are kept open."""
_OWN_AXES = ("run", "trajectory", "failure")
"""Along which a stack has rows of many cases."""


class StoredCases:
    """The cases of an open results file.

    Raises:
        ResultsError: The file does not say where they are.
    """

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._stacks: AnyArray | None = None
        if stacks.CASES in store.names(file):
            self._stacks = store.read(store.subgroup(file, stacks.CASES), stacks.STACK)
        self._groups: dict[str, _Stack] = {}
        self._ahead = ReadAhead()
        self._parts: OrderedDict[tuple[int, str], StoredPart | None] = OrderedDict()

    def case(self, index: int) -> StoredPart | None:
        """Return what the file holds of a case beside its filters; None where nothing has been computed yet."""
        return self._kept((index, ""), lambda: self._case(index))

    def filter(self, index: int, name: str) -> StoredPart | None:
        """Return what the file holds of a filter of a case; None where no run has been computed yet."""
        return self._kept((index, name), lambda: self._filter(index, name))

    def _kept(self, key: tuple[int, str], find: Callable[[], StoredPart | None]) -> StoredPart | None:
        """Return a part that has been found; the last ones are kept, with the datasets that were checked."""
        if key not in self._parts:
            self._parts[key] = find()
            if len(self._parts) > _MOST_PARTS:
                self._parts.popitem(last=False)
        return self._parts[key]

    def _case(self, index: int) -> StoredPart | None:
        if self._stacks is None:
            group = store.subgroup(self._file, layout.case_group(index))
            return StoredPart(group) if "failures" in store.names(group) else None
        number = int(self._stacks[index])
        return None if number < 0 else StoredPart(*self._stack(stacks.stack_group(number), index))

    def _filter(self, index: int, name: str) -> StoredPart | None:
        case = self.case(index)
        if case is None or name not in case.names:
            return None
        if case.stack is None:
            return StoredPart(store.subgroup(case.group, name))
        part = StoredPart(*self._stack(f"{case.group.name}/{name}", index))
        return part if part.rows("run") != _NO_ROWS else None

    def failures(self, index: int) -> tuple[Failure, ...]:
        """Return the failures of a case; none where nothing has been computed yet.

        Raises:
            ResultsError: They are damaged.
        """
        case = self.case(index)
        if case is None:
            return ()
        if case.stack is None:
            part = StoredPart(store.subgroup(case.group, "failures"))
        else:
            part = StoredPart(*self._stack(f"{case.group.name}/failures", index))
            if part.rows("failure") == _NO_ROWS:
                return ()
        table = {spec.name: part.read(spec) for spec in layout.FAILURES}
        rows = zip(table["run"], table["filter"], table["epoch"], table["reason"], strict=True)
        return tuple(Failure(int(run), name, int(epoch), reason) for run, name, epoch, reason in rows)

    def _stack(self, path: str, index: int) -> tuple[h5py.Group, _Stack, int]:
        stack = self._groups.get(path)
        if stack is None:
            group: h5py.Group | h5py.File = self._file
            for name in path.strip("/").split("/"):
                group = store.subgroup(group, name)
            stack = self._groups[path] = _Stack(group, self._ahead)
        return stack.group, stack, index


@dataclass(frozen=True)
class StoredPart:
    """What a group holds of one case: everything, or some of its rows.

    Attributes:
        group: The group.
        stack: Its rows by case; None: all of it is of the case.
        case: Number of the case in the file.
    """

    group: h5py.Group
    stack: _Stack | None = None
    case: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """The names inside the group."""
        return (self.stack or self._alone).names

    @cached_property
    def _alone(self) -> _Stack:
        """What has been read and checked of a group that is all of the case."""
        return _Stack(self.group, ReadAhead())

    def rows(self, axis: str) -> slice:
        """Return the rows of the case along one of the axes that cases share in a stack."""
        return slice(None) if self.stack is None else self.stack.rows(axis, self.case)

    def read(self, spec: Dataset | Dimension, index: Any = ...) -> AnyArray:
        """Return a dataset of the case, or a part of it.

        Args:
            spec: The dataset.
            index: Along its first axis a row, a slice or ascending rows, counted within the case; or a tuple of this
                and indices along the next axes.

        Raises:
            ResultsError: It is missing or damaged.
        """
        axis = spec.dims[0] if isinstance(spec, Dataset) else spec.name
        if self.stack is None:
            return store.values_of(self._alone.checked(spec), spec, index)
        if axis not in _OWN_AXES:
            return np.asarray(self.stack.column(spec)[index])
        return self.stack.read(spec, _within(self.rows(axis), index))

    def limit(self, spec: Dataset) -> AnyArray | None:
        """Return a bound of the case; None where there is none."""
        if spec.name not in self.names:
            return None
        if self.stack is None:
            return store.read(self.group, spec)
        row = self.stack.row_of(stacks.stacked(spec).dims[0], self.case)
        return None if row is None else self.stack.read(stacks.stacked(spec), row)

    def observability(self) -> Observability | None:
        """Return the observability of a filter in this case; None where it is not known."""
        first = layout.OBSERVABILITY[0]
        if first.name not in self.names:
            return None
        axis = layout.DIMENSIONS["state"]
        states = tuple(map(str, store.read(self.group, axis) if self.stack is None else self.stack.column(axis)))
        if self.stack is None:
            ratio, direction, sigma_ratio = (store.read(self.group, spec) for spec in layout.OBSERVABILITY)
            blind, weakest = store.whole_number(self.group, "blind"), store.text(self.group, "weakest")
            sensors = store.json_value(self.group, "sensors", list)
            # Earlier versions say nothing of the course.
            course = store.json_value(self.group, "course", list) if "course" in self.group.attrs else []
        else:
            row = self.stack.row_of(stacks.stacked(first).dims[0], self.case)
            if row is None:
                return None
            ratio, direction, sigma_ratio = (
                self.stack.read(stacks.stacked(spec), row) for spec in layout.OBSERVABILITY
            )
            words, number, which, times = (self.stack.column(spec)[row] for spec in stacks.OBSERVED_FACTS)
            sensors, blind, weakest = store.plain(str(words), list), int(number), str(which)
            course = store.plain(str(times), list)
        file, name = self.group.file.filename, self.group.name
        if sensors is None:
            raise ResultsError(f"{file}: {name}/sensors is damaged")
        try:
            over_time = course_of(course)
        except (TypeError, ValueError):
            raise ResultsError(f"{file}: the course of {name} is damaged") from None
        return Observability(tuple(map(str, sensors)), ratio, states, direction, sigma_ratio, blind, weakest, over_time)

    def columns(self) -> layout.Columns:
        """Return what a filter's group holds beyond what all of them hold.

        Raises:
            ResultsError: The names are damaged.
        """
        return (self.stack or self._alone).columns


def columns_of(group: h5py.Group) -> layout.Columns:
    """Return what a filter's group holds beyond what all of them hold.

    Raises:
        ResultsError: The names are damaged.
    """

    def labels(spec: layout.Dataset | layout.Dimension) -> tuple[str, ...]:
        return tuple(map(str, store.read(group, spec))) if spec.name in store.names(group) else ()

    dimensions = layout.DIMENSIONS
    extra, units = labels(dimensions["extra"]), labels(layout.AUGMENTED_UNIT)
    if len(extra) != len(units):
        raise ResultsError(f"{group.file.filename}: {group.name} lacks units of its augmented states")
    names = ("sensor", "edited", "factor", "channel")
    sensors, edited, factor, channels = (labels(dimensions[name]) for name in names)
    return layout.Columns(labels(dimensions["diagnostic"]), extra, units, sensors, edited, factor, channels)


@dataclass
class _Stack:
    """A group with rows of many cases; what is asked of it for every case is read and checked once."""

    group: h5py.Group
    ahead: ReadAhead
    _checked: dict[Dataset | Dimension, h5py.Dataset] = field(default_factory=dict)
    _beside: store.Shapes = field(default_factory=dict)
    _kept: dict[Any, Any] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        if "names" not in self._kept:
            self._kept["names"] = store.names(self.group)
        found: tuple[str, ...] = self._kept["names"]
        return found

    @property
    def columns(self) -> layout.Columns:
        if "columns" not in self._kept:
            self._kept["columns"] = columns_of(self.group)
        found: layout.Columns = self._kept["columns"]
        return found

    def column(self, spec: Dataset | Dimension) -> AnyArray:
        """Return a whole dataset, which is small."""
        if spec not in self._kept:
            self._kept[spec] = store.read(self.group, spec)
        found: AnyArray = self._kept[spec]
        return found

    def rows(self, axis: str, case: int) -> slice:
        if (axis, "rows") not in self._kept:
            owners = self.column(stacks.row_of_case(axis))
            if (np.diff(owners) < 0).any():
                raise ResultsError(f"{self.group.file.filename}: {self.group.name}/case does not ascend")
            cases, first = np.unique(owners, return_index=True)
            ends = [*first.tolist()[1:], len(owners)]
            places = zip(cases.tolist(), map(slice, first.tolist(), ends), strict=True)
            self._kept[axis, "rows"] = dict(places)
        found: slice = self._kept[axis, "rows"].get(case, _NO_ROWS)
        return found

    def row_of(self, dim: str, case: int) -> int | None:
        owners = self.column(layout.DIMENSIONS[dim])
        row = int(np.searchsorted(owners, case))
        return row if row < len(owners) and owners[row] == case else None

    def checked(self, spec: Dataset | Dimension) -> h5py.Dataset:
        """Return a dataset, checked when it is asked for first."""
        dataset = self._checked.get(spec)
        if dataset is None:
            dataset = self._checked[spec] = store.checked(self.group, spec, self._beside)
        return dataset

    def read(self, spec: Dataset | Dimension, index: Any) -> AnyArray:
        if isinstance(spec, Dimension):
            return self._coordinate(spec, index)
        if spec.dtype in layout.TEXTS:
            return np.asarray(self.column(spec)[index])
        dataset = self.checked(spec)
        if isinstance(index, slice) and index.step in (None, 1):
            return self.ahead.rows(dataset, spec, index)
        if isinstance(index, int):
            return np.asarray(self.ahead.rows(dataset, spec, slice(index, index + 1))[0])
        return store.values_of(dataset, spec, index)

    def _coordinate(self, dimension: Dimension, index: Any) -> AnyArray:
        """Return numbers of runs, which ascend within a case only."""
        values = np.asarray(self.column(stacks.rows_of(dimension.name))[index])
        if odd := odd_coordinate(dimension, values):
            raise ResultsError(f"{self.group.file.filename}: {self.group.name}/{dimension.name} {odd}")
        return values


def _within(rows: slice, index: Any) -> Any:
    """Return an index within some rows as one of the whole dataset."""
    if index is ...:
        return rows
    if isinstance(index, tuple):
        return _within(rows, index[0]), *index[1:]
    if isinstance(index, slice):
        first, last, step = index.indices(rows.stop - rows.start)
        return slice(rows.start + first, rows.start + last, step)
    return np.arange(rows.start, rows.stop)[index]
