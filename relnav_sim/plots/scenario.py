"""The scenario of a case: where the deputy flies, how far away and how fast it turns, what is read when, manoeuvres."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.plots.availability import availability
from relnav_sim.plots.axes import Axes, describe_axes, turned_states
from relnav_sim.plots.data import Case, Window, facts_of, window
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.geometry import PLANES, draw_ends, length_unit, plane_axes
from relnav_sim.plots.panels import time_axis
from relnav_sim.plots.sensor_times import Windows
from relnav_sim.plots.style import INK, PALETTE, house_style, new_figure, shown_name
from relnav_sim.plots.words import FigureWords
from relnav_sim.wording import counted, listed, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_LEFT, _RIGHT = 0.58, 0.16  # inches, as all heights below
_PLANES_INCH, _CURVE_INCH, _STRIP_INCH = 1.05, 0.85, 0.17
_LOG_FROM_RATIO = 8.0
_LEAST_SPAN = 0.01  # of an axis of a plane, of the largest range
_SLOW_DEG_S = 1e-4
_READ_IN = 0.5
_NARROW_KM_FROM_M = 1000.0


def scenario(
    results: Results, case: Case = 0, axes: Axes = "rtn", from_s: float | None = None, until_s: float | None = None
) -> Figure:
    """Draw the scenario of a case from its stored truth.

    The relative trajectory in three planes; below it against time the range, the rate at which the line of sight turns
    in the chief's RTN frame, and when each sensor gives measurements in half of the runs or more; sensors of their
    host's own state show their fixed outages. Dotted lines: manoeuvres. Truths that differ between runs are drawn
    for the first run.

    Args:
        results: An opened result.
        case: The case.
        axes: The axes of the planes.
        from_s: Start, s.
        until_s: End, s.
    """
    facts = facts_of(results, case, axes)
    view = window(facts, from_s, until_s)
    states = results.truth(facts.index)[0][view.rows]
    shares = {name: share[view.rows] >= _READ_IN for name, share in availability(facts.filters).items()}
    shares |= {name: _outside(windows, view.times * view.length_s) for name, windows in facts.own_outages.items()}
    strips = 0.12 + _STRIP_INCH * len(shares) if shares else 0.0
    height = 0.1 + _PLANES_INCH + 0.42 + 2 * (_CURVE_INCH + 0.1) + strips + 0.38
    with house_style():
        figure = new_figure(height)
        _draw_planes(figure, turned_states(states, facts.axes)[:, :3])
        bottom = 0.38
        panels = []
        for inch in (*([_STRIP_INCH * len(shares)] if shares else []), _CURVE_INCH, _CURVE_INCH):
            panels.append(_panel(figure, bottom, inch))
            bottom += inch + 0.1
        rates, distances = panels[-2], panels[-1]
        distance = np.linalg.norm(states[:, :3], axis=-1)
        _draw_range(distances, view, distance)
        turning = line_of_sight_rate(states)
        factor, unit = (1e3, "mdeg/s") if np.nanmax(turning, initial=0.0) > _SLOW_DEG_S else (1e6, "µdeg/s")
        rates.plot(view.times, factor * turning, color=INK, linewidth=1.0)
        rates.set_ylim(bottom=0)
        rates.set_ylabel(f"LOS rate\n[{unit}]")
        if shares:
            _draw_strips(panels[0], view, shares)
        for panel in panels:
            panel.set_xlim(view.times[0], view.times[-1])
            for at in facts.manoeuvres_s:
                panel.axvline(at / view.length_s, color=PALETTE[1], linewidth=0.9, linestyle=":")
            if panel is not panels[0]:
                panel.tick_params(labelbottom=False)
        time_axis(panels[0], view.times, view.unit)
    return figure


def line_of_sight_rate(states: Array) -> Array:
    """Return how fast the direction to the deputy turns in the frame of its states, deg/s.

    It is |r x v| / |r|^2, NaN where the range is 0.

    Args:
        states: Relative position and velocity (..., 6), m and m/s, in one frame.

    Example:
        >>> float(line_of_sight_rate(np.array([0.0, 1000.0, 0.0, 1.0, 0.0, 0.0])))  # 1 m/s across at 1 km: 1 mrad/s
        0.057...
    """
    r, v = states[..., :3], states[..., 3:]
    squared = np.sum(r**2, axis=-1)
    turning = np.linalg.norm(np.cross(r, v), axis=-1)
    return np.degrees(turning / np.where(squared > 0, squared, np.nan))


def scenario_words(case: CaseFacts, ranges_m: Array) -> FigureWords:
    """Return the words of `scenario`.

    Args:
        case: The case.
        ranges_m: The true ranges over time, m.
    """
    low, high = float(ranges_m.min()), float(ranges_m.max())
    far = f"{significant(low)} m" if low == high else f"{significant(low)} to {significant(high)} m"
    burns = f", {counted(len(case.manoeuvres_s), 'manoeuvre')}" if case.manoeuvres_s else ", no manoeuvre"
    read = " Bars: the sensor gives measurements in half of the runs or more." if availability(case.filters) else ""
    if case.own_outages:
        read += f" Of {listed(list(case.own_outages))}: outside of fixed outages."
    dotted = " Dotted: manoeuvres." if case.manoeuvres_s else ""
    return FigureWords(
        f"Scenario: true relative trajectory (circle: start, square: end, cross: chief), range, rate of the line of "
        f"sight (LOS) in the chief's RTN frame.{read}{dotted} {describe_axes(case.axes)}.",
        f"Relative trajectory in three planes, range and line-of-sight rate against time; range {far}{burns}.",
    )


def _draw_planes(figure: Figure, truth: Array) -> None:
    width, height = (float(size) for size in figure.get_size_inches())
    factors, units = zip(*(length_unit(truth[:, axis], _NARROW_KM_FROM_M) for axis in range(3)), strict=True)
    each = (width - _LEFT - _RIGHT - 2 * 0.5) / 3
    least_m = _LEAST_SPAN * float(np.linalg.norm(truth, axis=-1).max())
    for place, (across, up) in enumerate(PLANES):
        left = _LEFT + place * (each + 0.5)
        panel = figure.add_axes(
            (left / width, (height - 0.1 - _PLANES_INCH) / height, each / width, _PLANES_INCH / height)
        )
        panel.plot(truth[:, across] * factors[across], truth[:, up] * factors[up], color=INK, linewidth=1.0)
        draw_ends(panel, truth * factors, across, up)
        plane_axes(panel, "xyz"[across], "xyz"[up], units[across], units[up], 1)
        widen(panel, least_m * factors[across], least_m * factors[up])
        panel.yaxis.labelpad = 0


def widen(panel: Panel, across: float, up: float) -> None:
    """Give the axes of a panel at least these spans: a deputy at rest does not fill it with a drift of millimetres."""
    for least, limits, set_limits in (
        (across, panel.get_xlim(), panel.set_xlim),
        (up, panel.get_ylim(), panel.set_ylim),
    ):
        lacking = least - (limits[1] - limits[0])
        if lacking > 0:
            set_limits(limits[0] - lacking / 2, limits[1] + lacking / 2)


def _panel(figure: Figure, bottom: float, inch: float) -> Panel:
    width, height = (float(size) for size in figure.get_size_inches())
    shape: Any = (_LEFT / width, bottom / height, (width - _LEFT - _RIGHT) / width, inch / height)
    return figure.add_axes(shape)


def _draw_range(panel: Panel, view: Window, distance: Array) -> None:
    factor, unit = length_unit(distance)
    panel.plot(view.times, factor * distance, color=INK, linewidth=1.0)
    if distance.min() > 0 and distance.max() > _LOG_FROM_RATIO * distance.min():
        panel.set_yscale("log")
    else:
        panel.set_ylim(0, 1.1 * factor * float(distance.max()))
    panel.set_ylabel(f"range\n[{unit}]")


def _outside(windows: Windows, times_s: Array) -> Mask:
    """Return which stored epochs, standing for the time since the one before, lie outside of all windows."""
    return ~np.any([(times_s > start) & (times_s < end) for start, end in windows], axis=0)


def _draw_strips(panel: Panel, view: Window, shares: dict[str, Mask]) -> None:
    """Draw a bar for each sensor wherever it gives measurements; stored epochs stand for the time before them."""
    for row, read in enumerate(shares.values()):
        panel.fill_between(
            view.times, row - 0.32, row + 0.32, where=read.tolist(), step="pre", color=f"{INK}99", linewidth=0
        )
    panel.set_yticks(range(len(shares)), [shown_name(name, 12) for name in shares])
    panel.set_ylim(len(shares) - 0.4, -0.6)
    panel.grid(visible=False, axis="y")
