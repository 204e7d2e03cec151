"""The cases of one group of a results file: its datasets created at full size, then filled piece by piece."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import h5py
import numpy as np

from relnav_sim.results import hdf5, layout, stacks, store
from relnav_sim.results.block import AnyArray, BlockResult, Failure, RefusedError
from relnav_sim.results.bound import write_limits, write_stacked_limits
from relnav_sim.results.case_failures import CaseFailures
from relnav_sim.results.case_rows import CaseRows, offsets
from relnav_sim.results.pieces import Piece
from relnav_sim.results.row_writer import RowWriter, Waiting, same_bits
from relnav_sim.results.shards import ShardInfo


class StackWriter:
    """Writes cases that share their epochs, and what each filter holds, into one group.

    Args:
        group: The group.
        cases: The cases in order.
        many: Whether rows say whose they are; else the group is of the one case alone.
    """

    def __init__(self, group: h5py.Group, cases: Sequence[CaseRows], many: bool = False) -> None:
        self._group, self._cases, self._many = group, cases, many
        self._waiting = Waiting()
        self._time_s: AnyArray | None = None
        self._columns = {name: own for rows in cases for name, own in rows.columns.items()}
        self._first = {
            name: offsets({rows.index: len(rows.filters.get(name, ())) for rows in cases}) for name in self._columns
        }
        self._first_truth = offsets({rows.index: len(rows.trajectories) for rows in cases})
        self._failures: list[tuple[int, Failure]] = []

    def write(self) -> None:
        """Write everything.

        Raises:
            ResultsError: A piece is damaged.
            RefusedError: Two pieces disagree.
        """
        for rows in self._cases:
            case = _Case(rows)
            for piece in rows.pieces:
                block = piece.load()
                self._check_epochs(piece, block)
                if not piece.info.retry:
                    self._fill(case, piece.info, block)
                case.failures.take(piece.info, block)
            self._failures += [(rows.index, failure) for failure in case.failures.in_order()]
        self._waiting.write()
        for row in np.flatnonzero(~self._truth.done):
            self._group[layout.TRUTH.name][row] = np.nan
        self._write_failures()
        limits = {rows.index: rows.limits for rows in self._cases}
        if self._many:
            write_stacked_limits(self._group, limits)
        else:
            write_limits(self._group, limits[self._cases[0].index])

    def _check_epochs(self, piece: Piece, block: BlockResult) -> None:
        if self._time_s is None:
            self._time_s = block.time_s
            self._create(block.time_s)
        elif not same_bits(self._time_s, block.time_s):
            raise RefusedError(f"{piece.info.path}: its epochs differ from those of the other shards of this case")

    def _create(self, time_s: AnyArray) -> None:
        owners = {rows.index: rows.trajectories for rows in self._cases}
        self._write_rows(self._group, "trajectory", owners)
        count = sum(map(len, owners.values()))
        store.write_dimensions(self._group, [layout.TRUTH], time=time_s)
        made = store.create(self._group, [layout.TRUTH], layout.sizes(len(time_s), len(time_s), count))
        self._truth = RowWriter(made, [layout.TRUTH], count, self._waiting)
        self._filters = {name: self._created(name, own, time_s) for name, own in self._columns.items()}

    def _created(self, name: str, columns: layout.Columns, time_s: AnyArray) -> RowWriter:
        group = self._group.create_group(name)
        if not self._many:
            hdf5.set_attributes(group.id, {"case": self._cases[0].case.label, "filter": name})
        runs = {rows.index: rows.filters.get(name, []) for rows in self._cases}
        count = sum(map(len, runs.values()))
        self._write_rows(group, "run", runs)
        units = [layout.AUGMENTED_UNIT] if columns.augmented else []
        store.write_dimensions(group, [*columns.datasets, *units], time=time_s, **columns.labels)
        made = store.create(group, columns.datasets, layout.sizes(count, len(time_s)) | columns.lengths)
        store.write(group, {spec: columns.augmented_units for spec in units})
        return RowWriter(made, columns.datasets, count, self._waiting)

    def _write_rows(self, group: h5py.Group, axis: str, values: Mapping[int, Sequence[int]]) -> None:
        """Write the coordinate of an axis that cases share, and whose the rows are."""
        rows = [value for own in values.values() for value in own]
        store.write_dimensions(group, [layout.Dataset(axis, (axis,), "<i8", "", "")], **{axis: rows})
        if self._many:
            owners = np.repeat(list(values), [len(own) for own in values.values()])
            store.write(group, {stacks.row_of_case(axis): owners})

    def _fill(self, case: _Case, info: ShardInfo, block: BlockResult) -> None:
        rows, where = case.rows, f"case {case.rows.case.label}"
        # A block whose process died knows no truth; another block of the same run may.
        known = np.flatnonzero(~np.isnan(block.relative).all(axis=(1, 2))).tolist()
        owners = [-1] if block.shared_truth else block.runs
        here = [(i, case.truth_rows[owners[i]]) for i in known if owners[i] in case.truth_rows]
        self._put(
            self._truth,
            {layout.TRUTH.name: block.relative},
            here,
            self._first_truth[rows.index],
            rows.trajectories,
            f"{where}, truth",
        )
        for name in info.filters:
            if name in rows.filters:
                place = case.filter_rows[name]
                here = [(i, place[run]) for i, run in enumerate(block.runs) if run in place]
                arrays = block.filters[name].arrays(self._columns[name])
                first = self._first[name][rows.index]
                self._put(self._filters[name], arrays, here, first, rows.filters[name], f"{where}, filter {name}")

    def _put(
        self,
        writer: RowWriter,
        arrays: Mapping[str, AnyArray],
        here: Sequence[tuple[int, int]],
        first: int,
        runs: Sequence[int],
        what: str,
    ) -> None:
        sources, targets = [i for i, _ in here], [first + row for _, row in here]
        writer.put(arrays, sources, targets, lambda row: f"{what}: two shards disagree about run {runs[row - first]}")

    def _write_failures(self) -> None:
        group = self._group.create_group("failures")
        count = len(self._failures)
        store.write_dimensions(group, layout.FAILURES, failure=range(count))
        values = {spec: [getattr(failure, spec.name) for _, failure in self._failures] for spec in layout.FAILURES}
        if self._many:
            values[stacks.row_of_case("failure")] = [index for index, _ in self._failures]
        store.write(group, values)


class _Case:
    """What is known of a case while its pieces are read."""

    def __init__(self, rows: CaseRows) -> None:
        self.rows, self.failures = rows, CaseFailures(rows)
        self.truth_rows = {run: row for row, run in enumerate(rows.trajectories)}
        self.filter_rows = {name: {run: row for row, run in enumerate(runs)} for name, runs in rows.filters.items()}
