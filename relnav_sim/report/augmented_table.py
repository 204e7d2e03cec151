"""What the filters of a case found out about the states they carry behind position and velocity."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.report.layouts import INTERVALS
from relnav_sim.report.metrics import numbers
from relnav_sim.report.tables import Column, Row, Table
from relnav_sim.results.block import AugmentedStates
from relnav_sim.statistics.intervals import mean_interval

_SETTLED = 1
_SHOWN_UNITS = {"rad": ("deg", degrees(1.0)), "m/s^2": ("um/s^2", 1e6)}
"""Unit that a table shows in place of an SI unit, and the factor to it."""


def augmented_table(case: CaseFacts) -> Table | None:
    """Return the errors of the augmented states, settled, and their formal sigma at the end; None if none has any."""
    states = {
        name: unit
        for item in case.filters
        if item.augmented is not None
        for name, unit in zip(item.augmented.names, item.augmented.units, strict=True)
    }
    if not states:
        return None
    rows: list[Row] = []
    for name, unit in states.items():
        shown, factor = _SHOWN_UNITS.get(unit, (unit, 1.0))
        figures: tuple[tuple[str, Callable[[AugmentedStates], Array]], ...] = (
            ("rms error, steady state", lambda extra: extra.rms[:, _SETTLED]),
            ("mean error, steady state", lambda extra: extra.mean[:, _SETTLED]),
            ("formal sigma at the end", lambda extra: extra.sigma[:, -1]),
        )
        for place, (what, of) in enumerate(figures):
            cells = numbers([mean_interval(factor * _of_state(item, name, of)) for item in case.filters])
            rows.append(Row(f"{name}, {what}", cells, shown, opens_block=place == 0 and bool(rows)))
    return Table(
        name=f"case_{case.index:03d}_augmented",
        title="Augmented states",
        caption=f"States that a filter carries behind position and velocity. {INTERVALS} Errors are missing where the "
        "truth is not known; a state that is only considered keeps its mean at 0 and its sigma.",
        corner="quantity",
        columns=tuple(Column(item.name) for item in case.filters),
        rows=tuple(rows),
    )


def _of_state(item: FilterFacts, name: str, of: Callable[[AugmentedStates], Array]) -> Array:
    """Return a figure of one state, one for each run that did not fail; NaN where the filter has no such state."""
    if item.augmented is None or name not in item.augmented.names:
        return np.full(len(item.runs), np.nan)[item.ok]
    return of(item.augmented)[item.ok][:, item.augmented.names.index(name)]
