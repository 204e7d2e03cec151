"""Figures in space: the relative trajectory with its estimate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.axes import Axes, axis_names, describe_axes, turned_states
from relnav_sim.plots.data import (
    Case,
    FigureError,
    Window,
    chosen_filters,
    errors_of,
    facts_of,
    leading_filter,
    run_row,
    window,
)
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.panels import heading
from relnav_sim.plots.style import (
    INK,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    new_figure,
    shown_name,
)
from relnav_sim.plots.words import FigureWords

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_Line = tuple[Array, str, Any, float]  # states, colour, dashes, width
_KM_FROM_M = 9000.0  # from five digits on
_NEAR = 40  # stored epochs in a magnified part
PLANES = ((1, 0), (2, 0), (1, 2))  # horizontal, vertical axis: y lies, x stands


def trajectory(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    run: int | None = None,
    axes: Axes = "rtn",
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw the true relative trajectory of a run with its estimates, in space and in the three planes.

    A circle marks the start, a square the end, a cross the chief where it is in the picture.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters whose estimates are drawn; default: the one with the smallest position RMS.
        run: The run; default: the one with the median position RMS of the first filter.
        axes: The axes of the panels.
        from_s: Start, s.
        until_s: End, s.
    """
    facts = facts_of(results, case, axes)
    view = window(facts, from_s, until_s)
    truth, estimates, shown = _flight(results, facts, filters or [leading_filter(facts)], run, view)
    factors, units = zip(*(length_unit(truth[:, axis]) for axis in range(3)), strict=True)
    styles = line_styles(facts.all_filters)
    labels = [f"truth of run {shown}", *(shown_name(name) for name in estimates)]
    with house_style():
        figure = new_figure(4.9 + legend_height(labels))
        height = float(figure.get_figheight())
        planes = figure.subplots(2, 2)
        planes[1, 1].remove()
        lines: list[_Line] = [(truth * factors, INK, "-", 1.2)]
        lines += [(states * factors, styles[name].colour, (0, (4, 1.5)), 0.9) for name, states in estimates.items()]
        for panel, (across, up) in zip(planes.flat, PLANES, strict=False):
            for states, colour, dashes, width in lines:
                panel.plot(states[:, across], states[:, up], color=colour, linestyle=dashes, linewidth=width)
            draw_ends(panel, truth * factors, across, up)
            plane_axes(panel, "xyz"[across], "xyz"[up], units[across], units[up], 3)
        margins(figure, 0.52, 0.14, 2.3 + legend_height(labels), 0.36, hspace=0.48, wspace=0.62)
        space: Any = figure.add_axes(
            (0.04, 1 - (2.2 + legend_height(labels)) / height, 0.9, 2.2 / height), projection="3d"
        )
        for states, colour, dashes, width in lines:
            space.plot(states[:, 1], states[:, 2], states[:, 0], color=colour, linestyle=dashes, linewidth=width)
        space.plot(*(truth * factors)[0, [1, 2, 0]], "o", color=INK, markersize=3.5, mfc="white")
        space.plot(*(truth * factors)[-1, [1, 2, 0]], "s", color=INK, markersize=3.5, mfc="white")
        _space_axes(space, units)
        x, y, z = axis_names(facts.axes)
        figure.text(0.62, 0.2, f"x {x}\ny {y}\nz {z}\n\n○ start   □ end", va="center", fontsize=7, linespacing=1.5)
        legend_above(figure, [key(colour, dashes, width) for _, colour, dashes, width in lines], labels)
    return figure


def trajectory_words(case: CaseFacts, filters: Sequence[str]) -> FigureWords:
    """Return the words of `trajectory` for one filter."""
    (name,) = filters
    run = case.filter(name).median_run(case.span)
    return FigureWords(
        f"True relative trajectory of run {run} and its estimate by {name}. {describe_axes(case.axes)}.",
        f"Relative trajectory in space and in three planes, the truth and the estimate of {name}.",
    )


def plane(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    run: int | None = None,
    axes: Axes = "rtn",
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw the relative trajectory in the chief's orbital plane with the estimates, and a part of it magnified.

    The magnified part lies about the stored epoch at which the estimates of the settled span differ most from the
    truth. Arguments as `trajectory`; default filters: all.
    """
    facts = facts_of(results, case, axes)
    view = window(facts, from_s, until_s)
    truth, estimates, shown = _flight(results, facts, filters, run, view)
    across, up = (1, 0) if facts.axes == "rtn" else (0, 2)
    factors, units = zip(*(length_unit(truth[:, axis]) for axis in range(3)), strict=True)
    styles = line_styles(facts.all_filters)
    labels = [f"truth of run {shown}", *(shown_name(name) for name in estimates)]
    with house_style():
        figure = new_figure(4.3 + legend_height(labels))
        panels = figure.subplots(2, 1)
        near, metres = _worst_part(truth, estimates, view)
        lines: list[_Line] = [(truth, INK, "-", 1.2)]
        lines += [(states, styles[name].colour, styles[name].dashes, 0.9) for name, states in estimates.items()]
        for panel, part, scale in ((panels[0], slice(None), np.array(factors)), (panels[1], near, np.ones(3))):
            for states, colour, dashes, width in lines:
                here = states[part] * scale
                panel.plot(here[:, across], here[:, up], color=colour, linestyle=dashes, linewidth=width)
        draw_ends(panels[0], truth * factors, across, up)
        box = truth[near] * factors
        panels[0].plot(box[:, across], box[:, up], color=INK, linewidth=4.0, alpha=0.25, solid_capstyle="butt")
        names = axis_names(facts.axes)
        heading(panels[0], f"orbital plane, {names[up]} over {names[across]}")
        part_of = view.times[near]
        heading(
            panels[1], f"magnified: {part_of[0]:g} to {part_of[-1]:g} {view.unit}, within {metres:.2g} m of the truth"
        )
        plane_axes(panels[0], "xyz"[across], "xyz"[up], units[across], units[up], 5)
        plane_axes(panels[1], "xyz"[across], "xyz"[up], "m", "m", 5)
        margins(figure, 0.6, 0.16, 0.2 + legend_height(labels), 0.36, hspace=0.6, wspace=0.1)
        legend_above(figure, [key(colour, dashes, width) for _, colour, dashes, width in lines], labels)
    return figure


def _flight(
    results: Results, facts: CaseFacts, filters: Sequence[str] | None, run: int | None, view: Window
) -> tuple[Array, dict[str, Array], int]:
    """Return the truth (epochs, 3), the estimates by filter, and the number of the run."""
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    if not items:
        raise FigureError(f"no filter of case {facts.label!r} completed a run")
    if run is None:
        best = facts.filter(leading_filter(facts))
        run = (best if best in items else items[0]).median_run(facts.span)
    items = [item for item in items if run in item.runs[item.ok]]
    if not items:
        raise FigureError(f"run {run} failed or has not been computed")
    series = results.series(facts.index, items[0].name, run)
    truth = turned_states(series.truth, facts.axes)[view.rows, :3]
    return (
        truth,
        {
            item.name: truth + errors_of(results, facts, item, view.rows)[run_row(item, facts, run)][:, :3]
            for item in items
        },
        run,
    )


def _worst_part(truth: Array, estimates: dict[str, Array], view: Window) -> tuple[slice, float]:
    """Return some epochs about the largest settled error of any filter, and how large that is."""
    off = np.max([np.linalg.norm(states - truth, axis=1) for states in estimates.values()], axis=0)
    off = np.where(view.settled & np.isfinite(off), off, 0.0)
    middle = int(np.argmax(off))
    half = min(_NEAR, max(2, len(truth) // 12)) // 2
    first = max(0, min(middle - half, len(truth) - 1 - 2 * half))
    part = slice(first, first + 2 * half + 1)
    return part, float(off[part].max())


def length_unit(lengths: Array, km_from_m: float = _KM_FROM_M) -> tuple[float, str]:
    """Return the factor and the unit of an axis of lengths in m: km where they have five digits, or from ``km_from_m``.

    On a narrow axis labels of four digits and a sign run into each other.
    """
    return (1e-3, "km") if np.abs(lengths).max() > km_from_m else (1.0, "m")


def draw_ends(panel: Panel, truth: Array, across: int, up: int) -> None:
    """Mark start and end of a trajectory (K, 3) in a plane, and the chief where it is near."""
    panel.plot(*truth[0, [across, up]], "o", color=INK, markersize=3.5, mfc="white")
    panel.plot(*truth[-1, [across, up]], "s", color=INK, markersize=3.5, mfc="white")
    low, high = truth.min(axis=0), truth.max(axis=0)
    near = 0.2 * np.maximum(high - low, 1e-9)
    if all(low[axis] - near[axis] <= 0 <= high[axis] + near[axis] for axis in (across, up)):
        panel.plot(0, 0, "+", color=INK, markersize=6)


def plane_axes(panel: Panel, across: str, up: str, unit_across: str, unit_up: str, ticks: int) -> None:
    """Label the axes of a plane, with so many ticks across, and keep a line at rest a line."""
    from matplotlib.ticker import MaxNLocator

    panel.set_xlabel(f"{across} [{unit_across}]")
    panel.set_ylabel(f"{up} [{unit_up}]")
    panel.ticklabel_format(style="plain", useOffset=False)
    panel.xaxis.set_major_locator(MaxNLocator(ticks))
    panel.yaxis.set_major_locator(MaxNLocator(5))
    panel.margins(0.08)
    # A plane in which nothing moves shows a line, not rounding errors blown up.
    for limits, set_limits in ((panel.get_xlim(), panel.set_xlim), (panel.get_ylim(), panel.set_ylim)):
        if limits[1] - limits[0] < 1e-9 * max(1.0, abs(limits[0])):
            set_limits(limits[0] - 1, limits[1] + 1)


def _space_axes(space: Any, units: Sequence[str]) -> None:
    from matplotlib.ticker import MaxNLocator

    for axis, name, unit in ((space.xaxis, "y", units[1]), (space.yaxis, "z", units[2]), (space.zaxis, "x", units[0])):
        axis.set_label_text(f"{name} [{unit}]")
        axis.labelpad = -7
        axis.set_tick_params(pad=-3, labelsize=6)
        axis.set_major_locator(MaxNLocator(4))
        axis.pane.set_facecolor("white")
    space.ticklabel_format(style="plain", useOffset=False)
    space.view_init(elev=24, azim=-62)
    space.set_box_aspect((2.0, 1.1, 1.0), zoom=1.15)
