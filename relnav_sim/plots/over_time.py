"""Figures over runs against time: RMS, covariance against actual error, NEES and NIS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from relnav_sim.plots.axes import AXIS_COMPONENTS, Array, Axes, axis_names
from relnav_sim.plots.data import (
    Case,
    chosen_filters,
    errors_of,
    facts_of,
    perfect_bounds,
    rms_over_runs,
    run_row,
    sigmas_of,
    speed_unit,
    window,
)
from relnav_sim.plots.facts import FilterFacts
from relnav_sim.plots.panels import heading, log_axis, say, time_axis
from relnav_sim.plots.start import start_span
from relnav_sim.plots.style import (
    BAND,
    BOUND,
    CLAIMED,
    INK,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    nested_width,
    new_figure,
    shown_name,
)
from relnav_sim.statistics.intervals import chi_square_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

Which = Literal["nees", "nis"]
_STATE, _MEASUREMENT = 6, 3  # dimensions of the error and of a radar reading
_ZERO_RATIO = 1e-5
_NEAR_TOP = 5.0


def rms_over_time(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    run: int | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    at_start: bool = False,
) -> Figure:
    """Draw the RMS over runs of position and velocity error against time, a line per filter, log axis, with the bound.

    Dotted lines of a filter's colour are what it claims: the root mean over runs of its covariance's trace. The black
    dash-dotted line, where it is stored, is the posterior Cramer-Rao bound of a filter with a perfect model, one line
    for each set of sensors that the filters go by.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        run: Draw the size of the error in this run alone instead of the RMS over runs.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
        at_start: End the time axis where all filters have converged, unless ``until_s`` says where; with a line at
            the position error that counts as converged.
    """
    facts = facts_of(results, case)
    if at_start and until_s is None:
        until_s = start_span(results, facts)
    view = window(facts, from_s, until_s)
    items = chosen_filters(facts, filters)
    styles = line_styles(facts.all_filters)
    bounds = perfect_bounds(results, facts, view.rows, items)
    with house_style():
        labels = [shown_name(item.name) for item in items] + ["claimed"] + [label for label, _ in bounds]
        figure = new_figure(2.8 + legend_height(labels))
        panels = figure.subplots(2, 1, sharex=True)
        handles: list[Any] = []
        for place, item in enumerate(items):
            look = styles[item.name]
            kept = slice(None) if run is None else [run_row(item, facts, run)]
            errors, sigmas = (read(results, facts, item, view.rows)[kept] for read in (errors_of, sigmas_of))
            for panel, part in zip(panels, (slice(0, 3), slice(3, 6)), strict=True):
                (line,) = panel.plot(
                    view.times,
                    rms_over_runs(errors[..., part]),
                    color=look.colour,
                    linestyle=look.dashes,
                    linewidth=nested_width(place, len(items)),
                )
                panel.plot(
                    view.times, rms_over_runs(sigmas[..., part]), color=look.colour, linestyle=":", linewidth=0.9
                )
            handles.append(line)
        for panel, quantity, unit in zip(panels, ("position", "velocity"), ("m", "m/s"), strict=True):
            if any(item.completed for item in items):
                for dashes, (_, bound) in zip(_bound_dashes(bounds), bounds, strict=True):
                    limit = bound[:, 6 + (quantity == "velocity")]
                    panel.plot(
                        view.times, np.where(limit > 0, limit, np.nan), color=BOUND, linestyle=dashes, linewidth=1.0
                    )
                _leave_out_zeros(panel)
                log_axis(panel, "y")
            else:
                say(panel, "every run failed")
            panel.set_ylabel(f"{quantity} {'RMS' if run is None else 'error'} [{unit}]")
        bottom, top = panels[0].get_ylim()
        if at_start and bottom < facts.convergence_m < _NEAR_TOP * top:
            panels[0].set_ylim(bottom, max(top, 1.25 * facts.convergence_m))
            panels[0].axhline(facts.convergence_m, color=CLAIMED, linewidth=0.8, linestyle=(0, (1, 2)))
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        handles.append(key(CLAIMED, ":", 0.9))
        legend_above(figure, [*handles, *(key(BOUND, dashes, 1.0) for dashes in _bound_dashes(bounds))], labels)
    return figure


def covariance_against_error(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    axes: Axes = "rtn",
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw per axis what each filter claims against what it does: sigma and RMS error over runs, log axis.

    Solid: RMS of the error over runs. Dotted, in the same colour: the sigma that the filter states (root mean of
    its covariance's diagonal over runs). Where the two coincide the filter knows how good it is.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        axes: The axes of the panels.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
    """
    facts = facts_of(results, case, axes)
    view = window(facts, from_s, until_s)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    styles = line_styles(facts.all_filters)
    bounds = perfect_bounds(results, facts, view.rows, items)
    labels = [shown_name(item.name) for item in items] + ["claimed"] + [label for label, _ in bounds]
    with house_style():
        figure = new_figure(3.45 + legend_height(labels))
        panels = figure.subplots(3, 2, sharex=True)
        read = {
            item.name: (errors_of(results, facts, item, view.rows), sigmas_of(results, facts, item, view.rows))
            for item in items
        }
        slow = [np.sqrt(np.mean(errors[:, view.settled, 3:] ** 2)) for errors, _ in read.values()]
        for index, name in enumerate(AXIS_COMPONENTS):
            panel, velocity = panels[index % 3, index // 3], index >= 3
            factor, unit = speed_unit(max(slow, default=1.0)) if velocity else (1.0, "m")
            for place, item in enumerate(items):
                look, part = styles[item.name], slice(index, index + 1)
                errors, sigmas = read[item.name]
                width = nested_width(place, len(items), 1.8)
                panel.plot(
                    view.times, factor * rms_over_runs(errors[..., part]), color=look.colour, linewidth=width,
                    linestyle=look.dashes,
                )  # fmt: skip
                panel.plot(
                    view.times,
                    factor * rms_over_runs(sigmas[..., part]),
                    color=look.colour,
                    linestyle=":",
                    linewidth=1.1,
                )
            for dashes, (_, bound) in zip(_bound_dashes(bounds), bounds, strict=True):
                panel.plot(view.times, factor * bound[:, index], color=BOUND, linestyle=dashes, linewidth=1.0)
            if items:
                _leave_out_zeros(panel)
                log_axis(panel, "y")
            else:
                say(panel, "every run failed")
            panel.set_ylabel(f"{name} [{unit}]")
            heading(panel, axis_names(facts.axes)[index % 3] + (" velocity" if velocity else ""))
        for panel in panels[-1]:
            time_axis(panel, view.times, view.unit)
        margins(figure, 0.5, 0.16, 0.18 + legend_height(labels), 0.36, hspace=0.24, wspace=0.58)
        handles = [key(styles[item.name].colour, styles[item.name].dashes, 1.2) for item in items]
        handles += [key(CLAIMED, ":", 1.1), *(key(BOUND, dashes, 1.0) for dashes in _bound_dashes(bounds))]
        legend_above(figure, handles, labels)
    return figure


def consistency_over_time(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    which: Sequence[Which] = ("nees", "nis"),
) -> Figure:
    """Draw NEES and NIS, mean over runs divided by their dimension, against time with their 95 % chi-square band.

    A consistent filter stays inside the band in 95 % of the epochs (Bar-Shalom, Li and Kirubarajan 2001, section
    5.4.2). The band is that of the filter with the fewest runs, which is the widest. There is none for the NIS of
    filters that assume a mixture as noise: its mean is known then, not its distribution.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
        which: ``nees``, ``nis`` or both: a panel each.
    """
    facts = facts_of(results, case)
    view = window(facts, from_s, until_s)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    styles = line_styles(facts.all_filters)
    labels = [shown_name(item.name) for item in items] + ["95 % band"]
    with house_style():
        figure = new_figure(0.6 + 1.15 * len(which) + legend_height(labels))
        panels = figure.subplots(len(which), 1, sharex=True, squeeze=False)[:, 0]
        for panel, quantity in zip(panels, which, strict=True):
            dimension = _STATE if quantity == "nees" else _MEASUREMENT
            panel.set_ylabel(f"{quantity.upper()} / {dimension} [-]")
            counts = []
            for place, item in enumerate(items):
                mean, count = _mean_over_runs(results, facts.index, item, quantity, view.rows)
                if quantity == "nees" or item.nis_is_chi_square:
                    counts.append(count)
                look = styles[item.name]
                panel.plot(
                    view.times,
                    mean / dimension,
                    color=look.colour,
                    linestyle=look.dashes,
                    linewidth=nested_width(place, len(items), 1.8),
                )
            if items and not counts:
                panel.axhline(1.0, color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
            else:
                _band(panel, view.times, np.array(counts), dimension)
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.5, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        from matplotlib.patches import Patch

        handles = [key(styles[item.name].colour, styles[item.name].dashes, 1.2) for item in items]
        legend_above(figure, [*handles, Patch(color=BAND)], labels)
    return figure


def _bound_dashes(bounds: Sequence[tuple[str, Array]]) -> list[Any]:
    """Return how the line of each bound is drawn: dash-dotted, with a dot more for each further set of sensors."""
    return ["-." if not place else (0, (6, 2, *(1, 2) * (place + 1))) for place in range(len(bounds))]


def _mean_over_runs(results: Results, case: int, item: FilterFacts, which: Which, rows: Any) -> tuple[Array, Array]:
    """Return the mean over the completed runs that have a number at an epoch, and how many those are."""
    values = (results.nees if which == "nees" else results.nis)(case, item.name)[:, rows][item.ok]
    known = np.isfinite(values)
    count = known.sum(axis=0).astype(float)
    with np.errstate(invalid="ignore"):
        return np.where(known, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan), count


def _band(panel: Panel, times: Array, counts: Array, dimension: int) -> None:
    """Draw the band and let the axis show it, whatever the start of the lines."""
    if not counts.size or not counts.any():
        say(panel, "nothing to average")
        return
    runs = np.where(counts > 0, counts, np.inf).min(axis=0)
    bands = {n: chi_square_band(int(n), dimension) for n in np.unique(runs[np.isfinite(runs)])}
    low = np.array([bands[n].low if n in bands else np.nan for n in runs])
    high = np.array([bands[n].high if n in bands else np.nan for n in runs])
    panel.fill_between(times, low, high, color=BAND, linewidth=0, zorder=0.5)
    panel.axhline(1.0, color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
    lines = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in panel.lines])
    bulk = np.quantile(lines[np.isfinite(lines)], [0.01, 0.99])
    bottom, top = min(bulk[0], np.nanmin(low)), max(bulk[1], np.nanmax(high))
    if bottom > 0 and top > 10 * bottom:
        panel.set_ylim(max(0.8 * bottom, 1e-3 * top), 1.25 * top)
        log_axis(panel, "y")
    else:
        panel.set_ylim(max(0.0, bottom - 0.15 * (top - bottom)), top + 0.15 * (top - bottom))


def _leave_out_zeros(panel: Panel) -> None:
    """Keep a start without error, 1e-13 and the like after rounding, from stretching the axis."""
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in panel.lines])
    shown = drawn[drawn > _ZERO_RATIO * np.max(drawn, initial=0.0, where=np.isfinite(drawn))]
    if shown.size:
        panel.set_ylim(0.8 * shown.min(), 1.25 * shown.max())
