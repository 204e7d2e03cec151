"""Rows of many runs into datasets that lie beside each other, a stretch at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import h5py
import numpy as np

from relnav_sim.results import hdf5
from relnav_sim.results.block import AnyArray, RefusedError
from relnav_sim.results.layout import Dataset

Arrays = Mapping[str, AnyArray]


class Waiting:
    """Bytes that wait to be written, of all writers of a file together.

    Args:
        most: So many bytes at most.
    """

    def __init__(self, most: int = 32 << 20) -> None:
        self._most, self._bytes = most, 0
        self._writers: list[RowWriter] = []

    def add(self, writer: RowWriter, size: int) -> None:
        """Count bytes of a writer; write all where they have become too many."""
        if writer not in self._writers:
            self._writers.append(writer)
        self._bytes += size
        if self._bytes > self._most:
            self.write()

    def write(self) -> None:
        """Write all that waits."""
        for writer in self._writers:
            writer.flush()
        self._writers, self._bytes = [], 0


class RowWriter:
    """Writes rows of datasets that are created at full size; of a row that comes twice the second must be the same.

    Args:
        datasets: The datasets by name.
        specs: What the layout says of them.
        rows: How many rows they have.
        waiting: Counts what waits; neighbouring rows are written together, as each call costs the same.
    """

    def __init__(
        self, datasets: Mapping[str, h5py.h5d.DatasetID], specs: Sequence[Dataset], rows: int, waiting: Waiting
    ) -> None:
        self.done = np.zeros(rows, dtype=bool)
        self._datasets, self._specs, self._waiting = datasets, specs, waiting
        self._first = self._next = 0
        self._parts: list[Arrays] = []

    def put(self, arrays: Arrays, sources: Sequence[int], targets: Sequence[int], where: Callable[[int], str]) -> None:
        """Write some rows of arrays.

        Args:
            arrays: The arrays by dataset.
            sources: Their rows.
            targets: The rows of the datasets that these go to.
            where: Says of a row of the datasets what it is that two disagree about.

        Raises:
            RefusedError: A row is there already and differs.
        """
        twice = [(i, row) for i, row in zip(sources, targets, strict=True) if self.done[row]]
        if twice:
            self.flush()
        for i, row in twice:
            for spec in self._specs:
                stored = h5py.Dataset(self._datasets[spec.name])
                if not spec.timing and not same_bits(arrays[spec.name][i], stored[row]):
                    raise RefusedError(f"{where(row)} ({spec.name})")
        fresh = [(i, row) for i, row in zip(sources, targets, strict=True) if not self.done[row]]
        for first, last in _chunks(fresh):
            (source, target), (last_source, last_target) = fresh[first], fresh[last]
            part = {spec.name: arrays[spec.name][source : last_source + 1] for spec in self._specs}
            self._append(part, target, last_target + 1)
        self.done[[row for _, row in fresh]] = True

    def flush(self) -> None:
        """Write what waits."""
        parts, self._parts = self._parts, []
        for name, dataset in self._datasets.items() if parts else ():
            values = parts[0][name] if len(parts) == 1 else np.concatenate([part[name] for part in parts])
            hdf5.write(dataset, values, self._first)

    def _append(self, part: Arrays, first: int, following: int) -> None:
        if first != self._next:
            self.flush()
        if not self._parts:
            self._first = first
        self._parts.append(part)
        self._next = following
        self._waiting.add(self, sum(array.nbytes for array in part.values()))


def same_bits(a: AnyArray, b: AnyArray) -> bool:
    """Return whether two arrays are the same, NaN and signs of zero too."""
    return a.shape == b.shape and a.dtype == b.dtype and np.asarray(a).tobytes() == np.asarray(b).tobytes()


def _chunks(pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return first and last positions of the chunks where source and target rows both count up by one."""
    chunks: list[tuple[int, int]] = []
    for n, (i, row) in enumerate(pairs):
        if chunks and pairs[n - 1] == (i - 1, row - 1):
            chunks[-1] = (chunks[-1][0], n)
        else:
            chunks.append((n, n))
    return chunks
