"""Shards into one results file: verified, in run order, the same bits whatever the split into blocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from relnav_sim.arrays import Mask
from relnav_sim.conventions import RESERVED_NAMES
from relnav_sim.results import layout, seal, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import (
    AnyArray,
    BlockResult,
    CaseHeader,
    Failure,
    RefusedError,
    ResultHeader,
    ResultsError,
)
from relnav_sim.results.bound import BoundResult, bounds_of, write_case_bound
from relnav_sim.results.header import write_header
from relnav_sim.results.pieces import Piece, shard_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.shards import ShardInfo


def merge_shards(
    shards: Iterable[Path], header: ResultHeader, provenance: Provenance, out: Path, complete: bool = True
) -> None:
    """Unite shards by case, filter and run into the results file; see `merge_pieces`."""
    merge_pieces([shard_piece(path) for path in shards], header, provenance, out, complete)


def merge_pieces(
    pieces: Iterable[Piece],
    header: ResultHeader,
    provenance: Provenance,
    out: Path,
    complete: bool = True,
    bounds: Iterable[BoundResult] = (),
) -> None:
    """Unite pieces by case, filter and run into the results file.

    A run that two pieces hold counts once if they agree bit for bit (measured times aside).
    Filters are told apart by their settings, not by their names alone. Memory is bounded
    by the largest piece. Runs beyond ``header.runs`` are left out, and so are those that lacked memory, but for why.

    Args:
        pieces: The pieces, in any order.
        header: The campaign.
        provenance: How the result came about.
        out: The results file; replaced as a whole or left as it was.
        complete: Refuse to write while runs are missing; else write what there is.
        bounds: Bounds of the cases, as far as there are any.

    Raises:
        ResultsError: A piece is damaged.
        RefusedError: A piece is foreign, two disagree, or runs are missing.
        OSError: The file can't be written.
    """
    for case in header.cases:
        if bad := [name for name in case.filters if name in RESERVED_NAMES or "/" in name or name in (".", "")]:
            raise ResultsError(f"case {case.label}: a filter can't be named {bad[0]!r}")
    by_case = _by_case(pieces, header)
    limits = bounds_of(header, bounds)
    if complete and (missing := missing_runs(by_case, header)):
        raise RefusedError("runs are missing: " + "; ".join(missing))
    with written_whole(out) as temporary:
        with store.create_file(temporary) as file:
            write_header(file, header, provenance)
            file.attrs[seal.ATTRIBUTE] = seal.NOTICE
            for index, case in enumerate(header.cases):
                if by_case[case.id]:
                    group = file[layout.case_group(index)]
                    _CaseWriter(group, case, by_case[case.id], header.runs).write()
                    write_case_bound(group, case, limits[case.id])
        seal.seal(temporary)


def missing_runs(by_case: Mapping[str, Sequence[Piece]], header: ResultHeader) -> list[str]:
    """Return a sentence per case and filter that names the runs no piece holds."""
    sentences = []
    for case in header.cases:
        infos = [piece.info for piece in by_case.get(case.id, ()) if not piece.info.retry]
        for name in case.filters:
            held = {run for info in infos if name in info.filters for run in info.runs}
            if absent := [run for run in header.planned if run not in held]:
                sentences.append(f"case {case.label}, filter {name}: {run_ranges(absent)}")
    return sentences


def united_columns(parts: Sequence[layout.Columns]) -> layout.Columns:
    """Return what one filter holds beyond what all do, from the parts of its runs."""
    diagnostics = sorted({name for part in parts for name in part.diagnostics})
    augmented = next((part for part in parts if part.augmented), layout.NO_COLUMNS)
    sensors = next((part.sensors for part in parts if part.sensors), ())
    edited = next((part.edited for part in parts if part.edited), ())
    factor = next((part.factor for part in parts if part.factor), ())
    channels = next((part.channels for part in parts if part.channels), ())
    return replace(
        augmented, diagnostics=tuple(diagnostics), sensors=sensors, edited=edited, factor=factor, channels=channels
    )


def run_ranges(runs: Iterable[int]) -> str:
    """Return run numbers in words: ``run 3``, ``runs 0-7, 9``."""
    ordered = sorted(runs)
    spans: list[list[int]] = []
    for run in ordered:
        if spans and run == spans[-1][1] + 1:
            spans[-1][1] = run
        else:
            spans.append([run, run])
    words = ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in spans)
    return f"run{'s' if len(ordered) > 1 else ''} {words}"


def _by_case(pieces: Iterable[Piece], header: ResultHeader) -> dict[str, list[Piece]]:
    known = {case.id: case for case in header.cases}
    by_case: dict[str, list[Piece]] = {case_id: [] for case_id in known}
    for piece in sorted(pieces, key=lambda p: (p.info.runs, p.info.filters, str(p.info.path))):
        info = piece.info
        if info.seed != header.seed:
            raise RefusedError(f"{info.path}: the shard has seed {info.seed}, the campaign {header.seed}")
        if info.case_id not in known:
            raise RefusedError(f"{info.path}: the campaign has no case {info.case_id}")
        # Filters that the campaign no longer has, or has with other settings, are passed over.
        ids = known[info.case_id].filter_ids
        useful = tuple(name for name in info.filters if ids.get(name) == info.filter_ids[name])
        if useful:
            by_case[info.case_id].append(replace(piece, info=replace(info, filters=useful)))
    return by_case


class _CaseWriter:
    """Writes one case: creates its datasets at full size, then fills the rows shard by shard."""

    def __init__(self, group: h5py.Group, case: CaseHeader, pieces: Sequence[Piece], runs: int) -> None:
        self.group, self.case, self.pieces, self.runs = group, case, pieces, runs
        shards = [piece.info for piece in pieces if not piece.info.retry]
        self.rows = {
            name: sorted({run for s in shards if name in s.filters for run in s.runs if run < runs})
            for name in case.filters
        }
        self.columns = {
            name: united_columns([s.columns[name] for s in shards if name in s.filters]) for name in case.filters
        }
        self.order = {name: i for i, name in enumerate(case.filters)}
        self.done: dict[str, Mask] = {n: np.zeros(len(r), dtype=bool) for n, r in self.rows.items()}
        self.failures: dict[tuple[int, str], frozenset[Failure]] = {}
        shared = {piece.info.shared_truth for piece in pieces}
        if len(shared) > 1:
            raise RefusedError(f"case {case.label}: some shards share one truth between runs, others don't")
        held = sorted({run for s in shards for run in s.runs if run < runs})
        self.trajectories = [-1] if shared == {True} else held
        self.truth_done = np.zeros(len(self.trajectories), dtype=bool)
        self.time_s: AnyArray | None = None

    def write(self) -> None:
        for piece in self.pieces:
            info, block = piece.info, piece.load()
            if self.time_s is None:
                self.time_s = block.time_s
                self._create(block.time_s)
            elif not _same_bits(self.time_s, block.time_s):
                raise RefusedError(f"{info.path}: its epochs differ from those of the other shards of this case")
            if info.retry:
                self._keep_reasons(info, block)
            else:
                self._fill(info, block)
        for row in np.flatnonzero(~self.truth_done):
            self.group[layout.TRUTH.name][row] = np.nan
        known = {failure for of_run in self.failures.values() for failure in of_run}
        failures = sorted(known, key=lambda f: (f.run, self.order.get(f.filter, -1), f.epoch, f.reason))
        group = self.group.create_group("failures")
        store.write_dimensions(group, layout.FAILURES, failure=range(len(failures)))
        for spec in layout.FAILURES:
            store.write(group, spec, [getattr(failure, spec.name) for failure in failures])

    def _create(self, time_s: AnyArray) -> None:
        store.write_dimensions(self.group, [layout.TRUTH], time=time_s, trajectory=self.trajectories)
        store.create(self.group, layout.TRUTH, (len(self.trajectories), len(time_s), len(layout.COMPONENTS)))
        for name, runs in self.rows.items():
            if not runs:
                continue
            group = self.group.create_group(name)
            group.attrs.update({"case": self.case.label, "filter": name})
            columns = self.columns[name]
            units = [layout.AUGMENTED_UNIT] if columns.augmented else []
            store.write_dimensions(group, [*columns.datasets, *units], run=runs, time=time_s, **columns.labels)
            lengths = layout.sizes(len(runs), len(time_s)) | columns.lengths
            for spec in columns.datasets:
                store.create(group, spec, layout.shape(spec, lengths))
            for spec in units:
                store.write(group, spec, columns.augmented_units)

    def _fill(self, info: ShardInfo, block: BlockResult) -> None:
        where = f"case {self.case.label}"
        # A block whose process died knows no truth; another block of the same run may.
        known = np.asarray(~np.isnan(block.relative).all(axis=(1, 2)))
        truth = {layout.TRUTH.name: block.relative[known]}
        owners = [-1] if block.shared_truth else block.runs
        owners = [owner for owner, is_known in zip(owners, known, strict=True) if is_known]
        _fill_rows(self.group, (layout.TRUTH,), truth, owners, self.trajectories, self.truth_done, f"{where}, truth")
        for name in info.filters:
            columns = self.columns[name]
            arrays = block.filters[name].arrays(columns)
            rows, done = self.rows[name], self.done[name]
            if rows:
                group = self.group[name]
                _fill_rows(group, columns.datasets, arrays, block.runs, rows, done, f"{where}, filter {name}")
            self._fail(info, block, name)

    def _keep_reasons(self, info: ShardInfo, block: BlockResult) -> None:
        """Keep why runs are missing that no other piece holds."""
        for failure in block.failures:
            for name in info.filters:
                if failure.run < self.runs and failure.run not in self.rows[name] and failure.filter in ("", name):
                    self.failures[failure.run, name] = frozenset({failure})

    def _fail(self, info: ShardInfo, block: BlockResult, name: str) -> None:
        """Keep why runs of a filter failed; a run that another piece holds as well must have failed alike.

        Alike is at the same epoch: the words are an exception's, which may name an address or a moment.
        """
        reasons: dict[int, set[Failure]] = {run: set() for run in block.runs if run < self.runs}
        for failure in block.failures:
            if failure.run in reasons and failure.filter in ("", name):
                reasons[failure.run].add(failure)
        for run, found in reasons.items():
            before = self.failures.setdefault((run, name), frozenset(found))
            if {(f.filter, f.epoch) for f in before} != {(f.filter, f.epoch) for f in found}:
                where = f"case {self.case.label}, filter {name}"
                raise RefusedError(f"{info.path}: {where}: it disagrees with another shard about why run {run} failed")


def _fill_rows(
    group: h5py.Group,
    specs: Sequence[layout.Dataset],
    arrays: Mapping[str, AnyArray],
    owners: Sequence[int],
    rows: Sequence[int],
    done: Mask,
    where: str,
) -> None:
    """Write the arrays' rows, which belong to ``owners``, at their places in ``rows``; compare those already there."""
    place = {run: i for i, run in enumerate(rows)}
    here = [(i, place[run]) for i, run in enumerate(owners) if run in place]
    for i, row in here:
        if done[row]:
            for spec in specs:
                if not spec.timing and not _same_bits(arrays[spec.name][i], group[spec.name][row]):
                    raise RefusedError(f"{where}: two shards disagree about {run_ranges([rows[row]])} ({spec.name})")
    fresh = [(i, row) for i, row in here if not done[row]]
    for first, last in _chunks(fresh):
        source, target = slice(fresh[first][0], fresh[last][0] + 1), slice(fresh[first][1], fresh[last][1] + 1)
        for spec in specs:
            group[spec.name][target] = arrays[spec.name][source]
    done[[row for _, row in fresh]] = True


def _chunks(pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return first and last positions of the chunks where source and target rows both count up by one."""
    chunks: list[tuple[int, int]] = []
    for n, (i, row) in enumerate(pairs):
        if chunks and pairs[n - 1] == (i - 1, row - 1):
            chunks[-1] = (chunks[-1][0], n)
        else:
            chunks.append((n, n))
    return chunks


def _same_bits(a: AnyArray, b: AnyArray) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype and np.asarray(a).tobytes() == np.asarray(b).tobytes()
