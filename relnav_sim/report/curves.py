"""The time series that the page's chart zooms into: decimated, packed small, as JSON inside the page.

A curve is base64 of 16-bit whole numbers between its smallest and largest value, linear or logarithmic: 2.7 bytes per
point, off by at most one part in 131 000 of its span (of its span in decades). 65535 stands for no value.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.plots.axes import AXIS_COMPONENTS, axis_names
from relnav_sim.plots.coinciding import coinciding
from relnav_sim.plots.data import bound_of, errors_of, rms_over_runs, sigmas_of
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.printable import visible
from relnav_sim.results import layout
from relnav_sim.statistics.intervals import chi_square_band

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

MISSING = 65535
_LEVELS = 65534
_MOST_BYTES = 1_200_000
_BYTES_PER_POINT = 8 / 3
_MOST_POINTS, _FEWEST_POINTS = 600, 60
_CURVES, _AXIS_CURVES = 6, 12
_MOST_WITH_AXES = 80  # cases times filters
_AT_START = 4  # one point in so many is spent on the start, where every epoch is kept
_STATE = layout.BLOCK_SIZES[0]


def points_of(cases: int, filters: int) -> tuple[int, bool]:
    """Return how many points a curve of a result may have, and whether the errors per axis go in as well."""
    with_axes = cases * filters <= _MOST_WITH_AXES
    curves = max(1, cases * filters * (_CURVES + (_AXIS_CURVES if with_axes else 0)))
    points = int(_MOST_BYTES / (_BYTES_PER_POINT * curves))
    return min(_MOST_POINTS, max(_FEWEST_POINTS, points)), with_axes


def picked_epochs(count: int, most: int) -> Integers:
    """Return which of ``count`` epochs to keep: all of the start, then evenly to the last one."""
    if count <= most:
        return np.arange(count)
    start = most // _AT_START
    return np.unique(
        np.concatenate([np.arange(start), np.linspace(start, count - 1, most - start).round().astype(int)])
    )


def packed(values: Array, logarithmic: bool = False) -> list[Any]:
    """Return a curve as ``[low, high, logarithmic, base64]``; on a logarithmic scale only what is positive."""
    values = np.asarray(values, dtype=float)
    known = np.isfinite(values) & ((values > 0) | (not logarithmic))
    scaled = np.log10(np.where(known, values, 1.0)) if logarithmic else np.where(known, values, 0.0)
    low, high = (float(scaled[known].min()), float(scaled[known].max())) if known.any() else (0.0, 0.0)
    levels = np.round((scaled - low) * (_LEVELS / (high - low if high > low else 1.0)))
    whole = np.where(known, levels, MISSING).astype("<u2")
    return [float(f"{low:.8g}"), float(f"{high:.8g}"), int(logarithmic), base64.b64encode(whole.tobytes()).decode()]


def case_curves(results: Results, case: CaseFacts, points: int, with_axes: bool) -> dict[str, Any]:
    """Return the curves of one case.

    Args:
        results: An opened result.
        case: The case.
        points: Most points of a curve.
        with_axes: Whether to add the error per axis of the median run, with its sigma.
    """
    rows = picked_epochs(len(case.times_s), points)
    items = [item for item in case.filters if item.completed]
    bound = bound_of(results, case, rows)
    counts = [item.completed for item in items]
    chi_square_counts = [item.completed for item in items if item.nis_is_chi_square]
    return {
        "number": case.index,
        "label": visible(case.label),
        "time": packed(case.times_s[rows]),
        "kept": [len(rows), len(case.times_s)],
        "settle": case.settle_s,
        "filters": {visible(item.name): _filter_curves(results, case, item, rows, with_axes) for item in items},
        "groups": [[visible(item.name) for item in group] for group in coinciding(items)],
        "bound": {}
        if bound is None
        else {"position": packed(bound[:, 6], True), "velocity": packed(bound[:, 7], True)},
        "bands": {"nees": _band(counts, _STATE), "nis": _band(chi_square_counts, case.dimension)},
        "axes": list(axis_names(case.axes)) if with_axes else [],
    }


def embedded(cases: Sequence[Mapping[str, Any] | None], filters: Sequence[str]) -> str:
    """Return the curves of all cases as JSON that can stand inside a script element; empty where there are none."""
    known = [case for case in cases if case and case["filters"]]
    if not known:
        return ""
    text = json.dumps(
        {"filters": list(map(visible, filters)), "cases": known}, separators=(",", ":"), ensure_ascii=True
    )
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _filter_curves(
    results: Results, case: CaseFacts, item: FilterFacts, rows: Integers, with_axes: bool
) -> dict[str, Any]:
    errors, sigmas = errors_of(results, case, item, rows), sigmas_of(results, case, item, rows)
    curves: dict[str, Any] = {"runs": item.completed, "median": item.median_run(case.span)}
    for name, part in (("position", slice(0, 3)), ("velocity", slice(3, 6))):
        curves[name] = packed(rms_over_runs(errors[..., part]), True)
        curves[f"{name}_formal"] = packed(rms_over_runs(sigmas[..., part]), True)
    nees, nis = (read(case.index, item.name)[:, rows][item.ok] for read in (results.nees, results.nis))
    dof = results.dof(case.index, item.name)[:, rows][item.ok]
    curves["nees"] = packed(_mean(nees) / _STATE)
    curves["nis"] = packed(_mean(nis) / _mean(np.where(np.isfinite(nis), dof, np.nan)))
    if with_axes:
        row = item.median_row(case.span)
        for place, name in enumerate(AXIS_COMPONENTS):
            curves[name] = packed(errors[row, :, place])
            curves[f"{name}_formal"] = packed(sigmas[row, :, place])
    return curves


def _mean(values: Array) -> Array:
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.where(known, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)


def _band(counts: Sequence[int], dimension: int | None) -> list[float]:
    if not counts or dimension is None:
        return []
    band = chi_square_band(min(counts), dimension)
    return [float(f"{band.low:.5g}"), float(f"{band.high:.5g}")]
