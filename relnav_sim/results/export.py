"""Results as tidy CSV: one observation a row, one variable a column, units in the column names."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.results import layout
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.csv_cells import csv_cell
from relnav_sim.results.read import Results


def export_summary(results: Results, path: Path) -> None:
    """Write the per-run statistics: one row per case, filter and run.

    Args:
        results: An open result.
        path: The CSV file; replaced as a whole. NaN is an empty field.

    Raises:
        OSError: The file can't be written.
    """
    summary = results.summary()
    _write(path, list(summary), _rows(list(summary.values())))


def _rows(columns: Sequence[NDArray[Any]]) -> Iterator[Iterable[Any]]:
    """Yield the rows of columns, some thousand at a time: as Python's own numbers they take four times the memory."""
    for first in range(0, len(columns[0]) if columns else 0, _ROWS_AT_A_TIME):
        yield from zip(*(column[first : first + _ROWS_AT_A_TIME].tolist() for column in columns), strict=True)


def export_series(results: Results, path: Path) -> None:
    """Write the stored series: one row per case, filter, run and stored epoch.

    Where the file holds covariances whole, the correlations stand beside the sigmas.

    Args:
        results: An open result.
        path: The CSV file; replaced as a whole. NaN is an empty field.

    Raises:
        OSError: The file can't be written.
    """
    states = [f"{name}_{{}}_{layout.quantity_unit(name)}" for name in layout.COMPONENTS]
    parts = [name.format(what) for what in ("truth", "error", "sigma") for name in states]
    sensors = results.sensors
    by_sensor = [f"{what}_{sensor}" for what in ("nis", "dof") for sensor in sensors]
    pairs = [f"correlation_{row}_{column}" for row, column in _PAIRS] if results.holds_covariances else []
    heading = ["case_label", "filter", "run", "time_s", *parts, *pairs, "nis", "nees", *by_sensor]
    _write(path, heading, _series_rows(results, sensors))


_ROWS_AT_A_TIME = 2000
_PAIRS = tuple(combinations(layout.COMPONENTS, 2))
_PLACES = tuple(combinations(range(len(layout.COMPONENTS)), 2))


def _correlations(covariance: Array | None, epochs: int) -> Array:
    """Return the correlations of each pair of components, (K, 15); NaN where they are not known."""
    if covariance is None:
        return np.full((epochs, len(_PLACES)), np.nan)
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return np.stack([covariance[:, i, j] / (sigma[:, i] * sigma[:, j]) for i, j in _PLACES], axis=1)


def _series_rows(results: Results, sensors: Sequence[str]) -> Iterator[Iterable[Any]]:
    for label, header in zip(results.cases, results.headers, strict=True):
        for name in header.filters:
            for run in results.case_runs(header.id, name).tolist():
                one = results.series(header.id, name, run)
                numbers = [one.time_s[:, None], one.truth, one.error, one.sigma]
                numbers += [_correlations(one.covariance, len(one.time_s))] if results.holds_covariances else []
                numbers += [one.nis[:, None], one.nees[:, None]]
                absent = np.full(len(one.time_s), np.nan)
                numbers += [
                    part.get(sensor, absent)[:, None] for part in (one.nis_by, one.dof_by) for sensor in sensors
                ]
                for row in np.hstack(numbers).tolist():
                    yield [label, name, run, *row]


def _write(path: Path, heading: list[str], rows: Iterable[Iterable[Any]]) -> None:
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading)
        for row in rows:
            writer.writerow(map(csv_cell, row))
