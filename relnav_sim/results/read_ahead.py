"""Rows of datasets, read some more at a time than are asked for.

Who goes through the cases of a stack asks for a few hundred bytes of each dataset at a time, and HDF5 takes longer to
find them than to read a hundred times as many.
"""

from __future__ import annotations

import math
from collections import OrderedDict

import h5py

from relnav_sim.results import store
from relnav_sim.results.block import AnyArray
from relnav_sim.results.dataset import Dataset

AHEAD_BYTES = 64 << 10
"""What is read of a dataset at once."""
MOST_BYTES = 32 << 20
"""What is kept of all datasets of a file; what has not been asked for the longest goes first."""


class ReadAhead:
    """What has been read last of the datasets of a file."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, tuple[int, AnyArray]] = OrderedDict()

    def rows(self, dataset: h5py.Dataset, spec: Dataset, rows: slice) -> AnyArray:
        """Return rows of a dataset that `store.checked` gave.

        Args:
            dataset: The dataset.
            spec: What it is.
            rows: First row and the one behind the last, both counted from 0.

        Raises:
            ResultsError: They can't be read, or they or the rows behind them can't be what they should be.
        """
        each = max(1, dataset.dtype.itemsize * math.prod(dataset.shape[1:]))
        ahead = AHEAD_BYTES // each
        if rows.stop - rows.start >= ahead:
            return store.values_of(dataset, spec, rows)
        name = dataset.name
        first, kept = self._kept.get(name, (0, None))
        if kept is None or not first <= rows.start <= rows.stop <= first + len(kept):
            first, kept = rows.start, store.values_of(dataset, spec, slice(rows.start, rows.start + ahead))
            self._kept[name] = first, kept
            while len(self._kept) > MOST_BYTES // AHEAD_BYTES:
                self._kept.popitem(last=False)
        self._kept.move_to_end(name)
        return kept[rows.start - first : rows.stop - first].copy()
