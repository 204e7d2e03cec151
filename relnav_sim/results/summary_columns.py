"""What a results file holds as flat columns, a row for each run of a filter in a case."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.results import layout
from relnav_sim.results.editing_columns import editing_columns

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def summary_columns(results: Results) -> dict[str, NDArray[Any]]:
    """Return the per-run statistics as flat columns, see `Results.summary`."""
    stress = ("stress",) if any(header.stress for header in results.headers) else ()
    names = ("case", "case_label", *stress, "filter", "run")
    columns: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    for index, case in enumerate(results.headers):
        for name in case.filters:
            runs = results.case_runs(index, name)
            columns["case"].append(np.full(len(runs), index))
            columns["case_label"].append(np.full(len(runs), case.label))
            for column in stress:
                columns[column].append(np.full(len(runs), case.stress))
            columns["filter"].append(np.full(len(runs), name))
            columns["run"].append(runs)
            for spec in layout.SUMMARY:
                data = results.statistic(index, name, spec.name) if len(runs) else None
                for column, place in layout.columns(spec):
                    where: tuple[Any, ...] = (slice(None), *place)
                    part = np.empty(0, dtype=spec.dtype) if data is None else data[where]
                    columns.setdefault(column, []).append(part)
    summary = {name: np.concatenate(parts) for name, parts in columns.items() if parts}
    summary |= _diagnostic_columns(results) | _sensor_columns(results)
    summary |= editing_columns(
        [
            (len(runs), results.editing(index, name))
            for index, case in enumerate(results.headers)
            for name in case.filters
            if len(runs := results.case_runs(index, name))
        ]
    )
    if "failed" in summary:
        summary["failed"] = summary["failed"].astype(bool)
    return summary


def _diagnostic_columns(results: Results) -> dict[str, Array]:
    """Return what any filter reports as columns ``diagnostic_<name>``; NaN for the filters that do not."""
    held = [
        (len(runs), results.diagnostics(index, name))
        for index, case in enumerate(results.headers)
        for name in case.filters
        if len(runs := results.case_runs(index, name))
    ]
    names = sorted({name for _, reported in held for name in reported})
    return {
        f"diagnostic_{name}": np.concatenate([found.get(name, np.full(runs, np.nan)) for runs, found in held])
        for name in names
    }


def _sensor_columns(results: Results) -> dict[str, Array]:
    """Return what the filters' sensors gave as columns ``nis_sum_<sensor>`` and the like; NaN for other filters."""
    held = [
        (len(runs), results.by_sensor(index, name))
        for index, case in enumerate(results.headers)
        for name in case.filters
        if len(runs := results.case_runs(index, name))
    ]
    columns: dict[str, Array] = {}
    for sensor, spec in itertools.product(results.sensors, (spec for spec in layout.BY_SENSOR if spec.column)):
        for span, prefix in enumerate(layout.SPAN_PREFIXES):
            columns[spec.column.format(span=prefix, sensor=sensor)] = np.concatenate(
                [
                    np.full(runs, np.nan) if found is None else found.of(spec, sensor, runs)[:, span]
                    for runs, found in held
                ]
            )
    return columns
