"""Figures over runs against time: RMS, covariance against actual error, NEES and NIS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.plots.axes import AXIS_COMPONENTS, Axes, axis_names
from relnav_sim.plots.coinciding import coinciding, shared_name
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
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import heading, log_axis, say, time_axis
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.start import start_span
from relnav_sim.plots.style import (
    BAND,
    BOUND,
    FORMAL,
    INK,
    filter_key,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    marks,
    nested_width,
    new_figure,
    shown_name,
)
from relnav_sim.plots.words import NO_ERROR, FigureWords, left_out, thinned
from relnav_sim.results import layout
from relnav_sim.statistics.intervals import chi_square_band
from relnav_sim.wording import counted, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

Which = Literal["nees", "nis"]
_STATE = layout.BLOCK_SIZES[0]  # dimension of the error
_ZERO_RATIO = 1e-5
_NEAR_TOP = 5.0
_NO_NIS_BAND = " The band of the NIS does not hold where the noise is a mixture; its mean does."


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

    Dotted lines of a filter's colour are its formal sigma: the root mean over runs of its covariance's trace. The black
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
    groups = coinciding(chosen_filters(facts, filters))
    items = [group[0] for group in groups]
    styles = line_styles(facts.all_filters)
    bounds = perfect_bounds(results, facts, view.rows, items)
    with house_style():
        labels = [*map(shared_name, groups), "formal", *(label for label, _ in bounds)]
        figure, grid = figure_with_panels("rms", 2.8 + legend_height(labels), 2, sharex=True)
        panels = grid[:, 0]
        handles = [filter_key(facts.all_filters, item.name) for item in items]
        for place, item in enumerate(items):
            look = styles[item.name]
            kept = slice(None) if run is None else [run_row(item, facts, run)]
            errors, sigmas = (read(results, facts, item, view.rows)[kept] for read in (errors_of, sigmas_of))
            for panel, part in zip(panels, (slice(0, 3), slice(3, 6)), strict=True):
                panel.plot(
                    view.times,
                    rms_over_runs(errors[..., part]),
                    color=look.colour,
                    linestyle=look.dashes,
                    linewidth=nested_width(place, len(items)),
                    **marks(facts.all_filters, item.name, len(view.times)),
                )
                formal = rms_over_runs(sigmas[..., part])
                panel.plot(view.times, formal, color=look.colour, linestyle=":", linewidth=0.9)
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
            panels[0].axhline(facts.convergence_m, color=FORMAL, linewidth=0.8, linestyle=(0, (1, 2)))
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        handles.append(key(FORMAL, ":", 0.9))
        legend_above(figure, [*handles, *(key(BOUND, dashes, 1.0) for dashes in _bound_dashes(bounds))], labels)
    return figure


def rms_words(case: CaseFacts) -> FigureWords:
    """Return the words of `rms_over_time`."""
    count = max((item.completed for item in case.filters), default=0)
    sizes = ", ".join(f"{item.name} {significant(item.mean_rms(case.span))} m" for item in case.by_accuracy)
    alt = "Two panels, position and velocity RMS against time on logarithmic axes. "
    alt += f"Position RMS for {case.when}: {sizes}."
    if not count:
        return FigureWords(NO_ERROR, alt)
    what = f"RMS over {count} runs" if count > 1 else "Size in the one run"
    what += " of the position and velocity error against time."
    formal = "Dotted: formal sigma, the root mean trace of each filter's covariance; dash-dotted, where stored: PCRB."
    return FigureWords(" ".join([what, formal, *thinned(case), *left_out(case.filters)]), alt)


def start_words(case: CaseFacts, until_s: float) -> FigureWords:
    """Return the words of `rms_over_time` for the start."""
    level = (
        f" Dotted line across, where errors are of its size: {case.convergence_m:g} m, which counts as converged."
        if case.convergence_m > 0
        else ""
    )
    return FigureWords(
        f"The first {until_s:g} s of the RMS over runs, at the stored epochs.{level}",
        f"Two panels, position and velocity RMS of all filters against time over the first {until_s:g} s.",
    )


def covariance_against_error(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    axes: Axes = "rtn",
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw per axis the formal sigma of each filter against its error: sigma and RMS error over runs, log axis.

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
    groups = coinciding([item for item in chosen_filters(facts, filters) if item.completed])
    items = [group[0] for group in groups]
    styles = line_styles(facts.all_filters)
    bounds = perfect_bounds(results, facts, view.rows, items)
    labels = [*map(shared_name, groups), "formal", *(label for label, _ in bounds)]
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
                    linestyle=look.dashes, **marks(facts.all_filters, item.name, len(view.times)),
                )  # fmt: skip
                formal = factor * rms_over_runs(sigmas[..., part])
                panel.plot(view.times, formal, color=look.colour, linestyle=":", linewidth=1.1)
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
        handles = [filter_key(facts.all_filters, item.name) for item in items]
        handles += [key(FORMAL, ":", 1.1), *(key(BOUND, dashes, 1.0) for dashes in _bound_dashes(bounds))]
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
    """Draw NEES and NIS per degree of freedom, mean over runs, against time with their 95 % chi-square band.

    A consistent filter stays inside the band in 95 % of the epochs (Bar-Shalom, Li and Kirubarajan 2001, section
    5.4.2). The band is that of the filter with the fewest degrees of freedom, which is the widest. There is none for
    the NIS where the noise of a sensor is a mixture: its mean is known then, not its distribution. Where a filter has
    several sensors, each gets a panel with its NIS below that of all.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
        which: ``nees``, ``nis`` or both.
    """
    facts = facts_of(results, case)
    view = window(facts, from_s, until_s)
    groups = coinciding([item for item in chosen_filters(facts, filters) if item.completed])
    items = [group[0] for group in groups]
    styles = line_styles(facts.all_filters)
    labels = [*map(shared_name, groups), "95 % band"]
    sensors = _shown_sensors(items) if "nis" in which else ()
    drawn: list[tuple[Which, str]] = [*((quantity, "") for quantity in which), *(("nis", name) for name in sensors)]
    with house_style():
        height = 0.6 + 1.15 * len(drawn) + legend_height(labels)
        figure, grid = figure_with_panels("consistency", height, len(drawn), sharex=True)
        panels = grid[:, 0]
        for panel, (quantity, sensor) in zip(panels, drawn, strict=True):
            divisor = str(_STATE) if quantity == "nees" else "dof" if sensor else str(facts.dimension or "dof")
            panel.set_ylabel(f"{quantity.upper()} / {divisor} [-]")
            heading(panel, shown_name(sensor))
            counts = []
            for place, item in enumerate(items):
                if sensor and sensor not in item.sensors:
                    continue
                mean, dof = _per_dof(results, facts.index, item, quantity, sensor, view.rows)
                if quantity == "nees" or (sensor not in item.mixture_sensors if sensor else item.nis_is_chi_square):
                    counts.append(dof)
                look = styles[item.name]
                panel.plot(
                    *_joined(view.times, mean),
                    color=look.colour,
                    linestyle=look.dashes,
                    linewidth=nested_width(place, len(items), 1.8),
                    **marks(facts.all_filters, item.name, len(view.times)),
                )
                alone = _isolated(mean)
                panel.plot(view.times[alone], mean[alone], ".", color=look.colour, markersize=2.5, mew=0)
            if items and not counts:
                panel.axhline(1.0, color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
            else:
                _band(panel, view.times, np.array(counts))
        time_axis(panels[-1], view.times, view.unit)
        gap = 0.24 if sensors else 0.12
        margins(figure, 0.5, 0.16, 0.06 + legend_height(labels), 0.36, hspace=gap, wspace=0.1)
        from matplotlib.patches import Patch

        handles = [filter_key(facts.all_filters, item.name) for item in items]
        legend_above(figure, [*handles, Patch(color=BAND)], labels)
    return figure


def _bound_dashes(bounds: Sequence[tuple[str, Array]]) -> list[Any]:
    """Return how the line of each bound is drawn: dash-dotted, with a dot more for each further set of sensors."""
    return ["-." if not place else (0, (6, 2, *(1, 2) * (place + 1))) for place in range(len(bounds))]


def consistency_words(case: CaseFacts) -> FigureWords:
    """Return the words of `consistency_over_time`."""
    runs = min((item.completed for item in case.filters if item.completed), default=0)
    mixture = "" if all(item.nis_is_chi_square for item in case.filters) else _NO_NIS_BAND
    parts = [
        f"{item.name} {significant(float(item.consistency('anees', case.span)[item.ok].mean()))}"
        for item in case.filters
        if item.completed
    ]
    sensors = _shown_sensors(case.filters)
    below = f" The lower panels show each sensor by itself ({', '.join(sensors)})." if sensors else ""
    panels = f"{counted(2 + len(sensors), 'panel')}, NEES and NIS" if sensors else "Two panels, NEES and NIS"
    return FigureWords(
        "NEES and NIS divided by their dimension, mean over runs, against time. Grey: where a consistent filter lies "
        f"in 95 % of the epochs ({counted(runs, 'run')}). Above: overconfident; below: conservative.{mixture}{below}",
        f"{panels} against time with their 95 % bands. ANEES for {case.when}: {', '.join(parts)}.",
    )


def _shown_sensors(items: Sequence[FilterFacts]) -> tuple[str, ...]:
    """Return the sensors that have panels of their own: those of all filters, where there are several."""
    sensors = tuple(dict.fromkeys(name for item in items for name in item.sensors))
    return sensors if len(sensors) > 1 else ()


def _per_dof(
    results: Results, case: int, item: FilterFacts, which: Which, sensor: str, rows: Any
) -> tuple[Array, Array]:
    """Return the mean over the completed runs per degree of freedom at each epoch, and how many degrees there are."""
    if which == "nees":
        values = results.nees(case, item.name)
        degrees = np.full(values.shape, _STATE)
    elif sensor and item.by_sensor is not None:
        place = item.sensors.index(sensor)
        values, degrees = item.by_sensor.nis[..., place].astype(float), item.by_sensor.dof[..., place]
    else:
        values, degrees = results.nis(case, item.name), results.dof(case, item.name)
    values, degrees = values[:, rows][item.ok], degrees[:, rows][item.ok]
    known = np.isfinite(values)
    count, dof = known.sum(axis=0).astype(float), np.where(known, degrees, 0).sum(axis=0).astype(float)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)
        return mean / (dof / np.where(count > 0, count, np.nan)), dof


def _joined(times: Array, *series: Array) -> tuple[Array, ...]:
    """Return times and series so that a line joins the points of a sensor that is read less often than is stored.

    It is broken where the gap between two points is longer than usual.
    """
    rows = np.flatnonzero(np.isfinite(series[0]))
    usual = float(np.median(np.diff(rows))) if len(rows) > 1 else 1.0
    if usual == 1:
        return times, *series
    breaks = np.flatnonzero(np.diff(rows) > 1.5 * usual) + 1
    return times[np.insert(rows, breaks, 0)], *(np.insert(values[rows], breaks, np.nan) for values in series)


def _isolated(values: Array) -> Mask:
    """Return which values stand between two unknown ones, so that no line shows them."""
    known = np.concatenate([[False], np.isfinite(values), [False]])
    return np.asarray(known[1:-1] & ~known[:-2] & ~known[2:])


def _band(panel: Panel, times: Array, dof: Array) -> None:
    """Draw the band of the fewest degrees of freedom and let the axis show it, whatever the start of the lines."""
    if not dof.size or not dof.any():
        say(panel, "nothing to average")
        return
    fewest = np.where(dof > 0, dof, np.inf).min(axis=0)
    bands = {n: chi_square_band(1, int(n)) for n in np.unique(fewest[np.isfinite(fewest)])}
    low = np.array([bands[n].low if n in bands else np.nan for n in fewest])
    high = np.array([bands[n].high if n in bands else np.nan for n in fewest])
    at, lower, upper = _joined(times, low, high)
    panel.fill_between(at, lower, upper, color=BAND, linewidth=0, zorder=0.5)
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
