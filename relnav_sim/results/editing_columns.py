"""What came of the editing of measurements, as flat columns of the summary."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.results import layout
from relnav_sim.results.block import Editing


def editing_columns(held: Sequence[tuple[int, Editing | None]]) -> dict[str, Array]:
    """Return the columns ``edit_lost``, ``edit_rejected_<sensor>`` and the like; NaN for filters that edit nothing.

    Args:
        held: How many runs, and what came of their editing, by case and filter.
    """
    columns: dict[str, list[Array]] = {}
    sensors = list(dict.fromkeys(name for _, found in held if found is not None for name in found.names))
    if not sensors:
        return {}
    for runs, found in held:
        for spec in layout.EDITING:
            values = None if found is None else np.asarray(getattr(found, spec.name.removeprefix("edit_")), dtype=float)
            for column, index in _columns(spec, sensors, () if found is None else found.names):
                part = np.full(runs, np.nan)
                if values is not None and index is not None:
                    part = values.reshape(runs, -1)[:, np.ravel_multi_index(index, values.shape[1:]) if index else 0]
                columns.setdefault(column, []).append(part)
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def _columns(
    spec: layout.Dataset, sensors: Sequence[str], own: Sequence[str]
) -> list[tuple[str, tuple[int, ...] | None]]:
    """Return the columns of a dataset, and where each stands behind the run axis; None: not in this filter's."""
    if "edited" not in spec.dims:
        return [(spec.column, ())]
    spans = enumerate(layout.SPAN_PREFIXES) if "span" in spec.dims else [(None, "")]
    found: list[tuple[str, tuple[int, ...] | None]] = []
    for span, prefix in spans:
        for sensor in sensors:
            place = None if sensor not in own else own.index(sensor)
            index = None if place is None else (place,) if span is None else (span, place)
            found.append((spec.column.format(span=prefix, sensor=sensor), index))
    return found
