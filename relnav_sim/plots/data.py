"""What the figures draw: chosen filters and runs of a case, over a window of its stored epochs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.plots.axes import (
    AXIS_COMPONENTS,
    Axes,
    source_component,
    turned_covariances,
    turned_sigmas,
    turned_states,
)
from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import time_unit
from relnav_sim.results import layout

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

Case = int | str | CaseFacts
_MOST_POINTS = 1200
PERFECT_BOUND = "PCRB, perfect model"
OWN_BOUND = "PCRB, own model"
_SLOW_M_S = 0.2  # below this, axes of velocity are in mm/s


class FigureError(ValueError):
    """A figure that can't be drawn as it is asked for; the message says why."""


@dataclass(frozen=True)
class Window:
    """The stored epochs that a figure draws.

    Attributes:
        rows: Which of the stored epochs.
        times: Their times in the unit of the axis.
        unit: That unit.
        settled: Which of them lie after settling; all of them where none does.
        length_s: The unit in seconds.
    """

    rows: Integers
    times: Array
    unit: str
    settled: Mask
    length_s: float


def window(case: CaseFacts, from_s: float | None = None, until_s: float | None = None) -> Window:
    """Return the stored epochs between two times, every k-th where there are very many.

    Raises:
        FigureError: There are fewer than two.
    """
    low, high = (-np.inf if from_s is None else from_s), (np.inf if until_s is None else until_s)
    rows = np.flatnonzero((case.times_s >= low) & (case.times_s <= high))
    if rows.size < 2 and (from_s is not None or until_s is not None):
        raise FigureError(
            f"fewer than two stored epochs lie between {max(low, 0):g} and {high:g} s; the first is "
            f"{case.times_s[0]:g} s, the last {case.times_s[-1]:g} s"
            if len(case.times_s)
            else "no run is stored"
        )
    rows = rows[:: drawn_step(rows.size)]
    unit, length = time_unit(case.times_s[rows])
    settled = case.times_s[rows] >= case.settle_s
    return Window(rows, case.times_s[rows] / length, unit, settled if settled.any() else np.ones_like(settled), length)


def drawn_step(epochs: int) -> int:
    """Return one in how many stored epochs a figure draws."""
    return max(1, -(-epochs // _MOST_POINTS))


def chosen_filters(case: CaseFacts, names: Sequence[str] | None) -> tuple[FilterFacts, ...]:
    """Return the filters of these names that have runs, or all of them.

    Raises:
        KeyError: A name that has no run in the case.
    """
    return case.filters if names is None else tuple(case.filter(name) for name in names)


def leading_filter(case: CaseFacts) -> str:
    """Return the filter with the smallest mean position RMS, the first one where no run was completed.

    Before any that can't observe the state, or that knows it only later, as in rankings.

    Raises:
        FigureError: No filter has a run.
    """
    if not case.filters:
        raise FigureError(f"no run of case {case.label!r} has been computed yet")

    def place(item: FilterFacts) -> tuple[bool, bool, bool, float]:
        return not item.completed, not item.observable, bool(item.known_when), _mean_rms(item, case)

    return min(case.filters, key=place).name


def _mean_rms(item: FilterFacts, case: CaseFacts) -> float:
    sizes = item.errors("rms", case.span, "r")[item.ok]
    return float(sizes.mean()) if sizes.size and np.isfinite(sizes).all() else np.inf


def run_row(item: FilterFacts, case: CaseFacts, run: int | None) -> int:
    """Return which of the completed runs to draw alone: the one asked for, else the one with the median RMS.

    Raises:
        FigureError: That run failed, or has not been computed.
    """
    if run is None:
        return item.median_row(case.span)
    rows = np.flatnonzero(item.runs[item.ok] == run)
    if not rows.size:
        why = "failed" if run in item.runs else "has not been computed"
        raise FigureError(f"run {run} of {item.name} {why}")
    return int(rows[0])


def errors_of(results: Results, case: CaseFacts, item: FilterFacts, rows: Integers) -> Array:
    """Return the errors of the completed runs in the axes of the case, (runs, epochs, 6)."""
    return turned_states(results.error(case.index, item.name)[:, rows][item.ok], case.axes)


def sigmas_of(results: Results, case: CaseFacts, item: FilterFacts, rows: Integers) -> Array:
    """Return the sigmas that the filter states in its completed runs, in the axes of the case, (runs, epochs, 6)."""
    return turned_sigmas(results.sigma(case.index, item.name)[:, rows][item.ok], case.axes)


def covariances_of(results: Results, case: CaseFacts, item: FilterFacts, rows: Integers) -> Array | None:
    """Return the formal covariances of the completed runs in the axes of the case, (runs, epochs, 6, 6).

    None where the result holds sigmas only.
    """
    first, last = int(rows.min()), int(rows.max())
    stored = results.covariance(case.index, item.name, epochs=slice(first, last + 1))
    return None if stored is None else turned_covariances(stored[:, rows - first][item.ok], case.axes)


def bound_of(results: Results, case: CaseFacts, rows: Integers, filter: str | None = None) -> Array | None:
    """Return the bound on the RMS errors (epochs, 8), x y z vx vy vz r v in the axes of the case; None if not stored.

    With a filter: the bound for that filter's own process noise; without, the one for a perfect model: with the sensors
    of the case's filters where all go by the same, else with all sensors, which no filter beats either.
    """
    if filter is not None:
        stored = results.bound(case.index, filter)
    elif len({item.named_sensors for item in case.filters}) == 1:
        stored = results.perfect_bound(case.index, case.filters[0].name)
    else:
        stored = results.bound(case.index)
    return None if stored is None else _of_components(stored, case, rows)


def perfect_bounds(
    results: Results, case: CaseFacts, rows: Integers, filters: Sequence[FilterFacts]
) -> list[tuple[str, Array]]:
    """Return the bounds of perfect models, as `bound_of`, one for each set of sensors that some filters go by.

    Each with what a legend calls it: `PERFECT_BOUND`, and the sensors where there are several.
    """
    found: list[tuple[str, Array]] = []
    for item in filters:
        stored = results.perfect_bound(case.index, item.name)
        if stored is not None and not any(np.array_equal(stored, other, equal_nan=True) for _, other in found):
            found.append((" + ".join(item.named_sensors) or "all sensors", stored))
    return [
        (PERFECT_BOUND if len(found) == 1 else f"PCRB, {label}", _of_components(stored, case, rows))
        for label, stored in found
    ]


def _of_components(stored: Array, case: CaseFacts, rows: Integers) -> Array:
    """Return a stored bound at some epochs, (epochs, 8), in the axes of the case."""
    sources = [source_component(name, case.axes)[0] for name in (*AXIS_COMPONENTS, "r", "v")]
    return stored[rows][:, [layout.QUANTITIES.index(source) for source in sources]]


def facts_of(results: Results, case: Case, axes: Axes = "rtn") -> CaseFacts:
    """Return the facts of a case that has runs.

    Raises:
        FigureError: No run has been computed yet.
    """
    facts = case_facts(results, case, axes)
    if not facts.filters:
        raise FigureError(f"no run of case {facts.label!r} has been computed yet")
    return facts


def sizes(parts: Array) -> Array:
    """Return the norms of (..., 3)."""
    return np.asarray(np.sqrt(np.sum(parts**2, axis=-1)))


def rms_over_runs(parts: Array) -> Array:
    """Return the RMS over runs (axis 0) of the norms of (runs, time, n); NaN, thus not drawn, where it is 0."""
    if not len(parts):
        return np.full(parts.shape[1], np.nan)
    found: Array = np.sqrt(np.mean(np.sum(parts**2, axis=-1), axis=0))
    return np.where(found > 0, found, np.nan)


def largest(values: Array) -> float:
    """Return the largest number that is known; NaN where none is."""
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else np.nan


def speed_unit(largest_m_s: float) -> tuple[float, str]:
    """Return the factor and the unit of an axis of velocity: mm/s where all is slow."""
    return (1e3, "mm/s") if largest_m_s < _SLOW_M_S else (1.0, "m/s")
