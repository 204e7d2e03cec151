"""Signed errors per axis: one filter with its envelope and spread, or one run of several filters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.plots.axes import AXIS_COMPONENTS, Axes, axis_names, describe_axes
from relnav_sim.plots.data import (
    OWN_BOUND,
    PERFECT_BOUND,
    Case,
    bound_of,
    chosen_filters,
    errors_of,
    facts_of,
    largest,
    leading_filter,
    perfect_bounds,
    run_row,
    sigmas_of,
    speed_unit,
    window,
)
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import heading, say, time_axis
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.start import start_span
from relnav_sim.plots.style import (
    BAND,
    BOUND,
    FORMAL,
    OWN_DASHES,
    PERFECT_DASHES,
    house_style,
    legend_above,
    legend_height,
    line_styles,
    margins,
    new_figure,
    shown_name,
)
from relnav_sim.plots.words import FigureWords, left_out, thinned
from relnav_sim.wording import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_UNKNOWN = "no error is known"
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"


def errors_with_envelope(
    results: Results,
    case: Case = 0,
    filter: str | None = None,
    axes: Axes = "rtn",
    run: int | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    own_bound: bool = False,
) -> Figure:
    """Draw the error of one filter against time, per axis, with the filter's own 3-sigma envelope and the bound.

    The grey band is mean +- 3 standard deviations of the error over the runs: what the filter does. The
    dashed lines are 3 times the root mean over runs of its covariance diagonal: its formal sigma. A consistent
    filter's band fills its envelope. The thin line is one run, for the look of one flight; with fewer than three
    runs there is no band. Dash-dotted, where it is stored: 3 times the posterior Cramer-Rao bound (PCRB) of a perfect
    model. That of the filter's own model, dotted, all but coincides with the formal sigma and is drawn when asked for.

    Args:
        results: An opened result.
        case: The case.
        filter: The filter; default: the one with the smallest position RMS.
        axes: The axes of the panels; facts given as the case bring their own.
        run: The run to draw; default: the one with the median position RMS.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
        own_bound: Whether to draw the bound of the filter's own model too.
    """
    facts = facts_of(results, case, axes)
    item = facts.filter(filter or leading_filter(facts))
    view = window(facts, from_s, until_s)
    errors, sigmas = (read(results, facts, item, view.rows) for read in (errors_of, sigmas_of))
    bound = next((found for _, found in perfect_bounds(results, facts, view.rows, [item])), None)
    own = bound_of(results, facts, view.rows, item.name) if own_bound else None
    limits = [(limit, dashes) for limit, dashes in ((bound, PERFECT_DASHES), (own, OWN_DASHES)) if limit is not None]
    row = run_row(item, facts, run) if item.completed else 0
    labels = _envelope_labels(item, row, bound is not None, own is not None)
    colour = line_styles(facts.all_filters)[item.name].colour
    with house_style():
        figure, panels = figure_with_panels("errors", 3.45 + legend_height(labels), 3, 2, sharex=True)
        handles: list[Any] = []
        for index, name in enumerate(AXIS_COMPONENTS):
            panel, velocity = panels[index % 3, index // 3], index >= 3
            factor, unit_of = 1.0, "m"
            if item.completed:
                error, formal = errors[..., index], np.sqrt(np.mean(sigmas[..., index] ** 2, axis=0))
                reach = _reach(error, formal, view.settled)
                if velocity:
                    factor, unit_of = speed_unit(reach)
                lines = [(factor * limit[:, index], dashes) for limit, dashes in limits]
                handles = _envelope(
                    panel, view.times, factor * error, factor * formal, lines, row, factor * reach, colour
                )
            else:
                say(panel, "every run failed")
                unit_of = "m/s" if velocity else "m"
            panel.set_ylabel(f"{name} [{unit_of}]")
            heading(panel, axis_names(facts.axes)[index % 3] + (" velocity" if velocity else ""))
        for panel in panels[-1]:
            time_axis(panel, view.times, view.unit)
        margins(figure, 0.46, 0.16, 0.18 + legend_height(labels), 0.36, hspace=0.24, wspace=0.55)
        if handles:
            legend_above(figure, handles, labels)
    return figure


def errors_words(case: CaseFacts, filter: str) -> FigureWords:
    """Return the words of `errors_with_envelope`."""
    item = case.filter(filter)
    if not item.completed:
        caption = f"{filter}: every run failed; there is no error to draw."
        return FigureWords(caption, f"Empty panels: every run of {filter} failed.")
    run = f"run {item.median_run(case.span)}"
    parts = [f"{filter}: error (estimate minus truth) per axis."]
    if item.completed > 2:
        parts.append(f"Grey band: mean ± 3 standard deviations over {item.completed} runs.")
        parts.append(f"Thin line: {run}, the run with the median position RMS.")
    else:
        parts.append(f"Line: {run}.")
    parts.append(
        "Dashed: ± 3 formal sigma (root mean over runs); dash-dotted, where stored: of the posterior "
        "Cramér-Rao bound of a perfect model."
    )
    if case.times_s[0] < case.settle_s <= case.times_s[-1]:
        parts.append(f"Scaled to t ≥ {case.settle_s:g} s; the start may leave the panel.")
    return FigureWords(
        " ".join([*parts, *thinned(case), *left_out([item])]),
        f"Six panels, error of {filter} against time in position and velocity ({describe_axes(case.axes)}) between the "
        f"filter's 3-sigma lines; position RMS {significant(item.mean_rms(case.span))} m for {case.when}.",
    )


def axis_errors(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    run: int | None = None,
    axes: Axes = "rtn",
    from_s: float | None = None,
    until_s: float | None = None,
    quantity: Literal["position", "velocity"] = "position",
    at_start: bool = False,
) -> Figure:
    """Draw the error of several filters in one run against time, a panel per axis.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        run: The run; default: the one with the median position RMS of the best filter.
        axes: The axes of the panels.
        from_s: Start of the time axis, s.
        until_s: Its end, s.
        quantity: ``position`` or ``velocity``.
        at_start: End the time axis where all filters have converged, unless ``until_s`` says where.
    """
    facts = facts_of(results, case, axes)
    if at_start and until_s is None:
        until_s = start_span(results, facts)
    velocity = quantity == "velocity"
    view = window(facts, from_s, until_s)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    if run is None and items:
        run = facts.filter(leading_filter(facts)).median_run(facts.span)
    # A run that failed in one filter is still drawn for the others.
    items = [item for item in items if run in item.runs[item.ok]]
    lines = {
        item.name: errors_of(results, facts, item, view.rows)[run_row(item, facts, run)][:, 3 * velocity :][:, :3]
        for item in items
    }
    styles = line_styles(facts.all_filters)
    labels = [shown_name(item.name) for item in items]
    whole = np.stack([*lines.values()]) if lines else np.zeros((1, len(view.rows), 3))
    factor, unit_of = speed_unit(largest(np.abs(whole)[:, view.settled])) if velocity else (1.0, "m")
    with house_style():
        figure = new_figure(3.3 + legend_height(labels))
        panels = figure.subplots(3, 1, sharex=True)
        handles: list[Any] = []
        for axis, panel in enumerate(panels):
            handles = [
                panel.plot(
                    view.times,
                    factor * line[:, axis],
                    color=styles[name].colour,
                    linestyle=styles[name].dashes,
                    linewidth=1.5 - 0.9 * place / max(1, len(lines) - 1),
                )[0]
                for place, (name, line) in enumerate(lines.items())
            ]
            if not lines:
                say(panel, "no filter completed this run")
            elif (reach := 1.1 * factor * largest(np.abs(whole[:, view.settled, axis]))) > 0:
                panel.set_ylim(-reach, reach)
            elif np.isnan(reach):
                say(panel, _UNKNOWN)
            panel.set_ylabel(f"{AXIS_COMPONENTS[axis + 3 * velocity]} [{unit_of}]")
            heading(panel, axis_names(facts.axes)[axis] + (" velocity" if velocity else ""))
        if lines:
            panels[0].set_title(f"run {run}", loc="right", pad=2.0, y=1.0)
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.52, 0.16, 0.18 + legend_height(labels), 0.36, hspace=0.24, wspace=0.1)
        if handles:
            legend_above(figure, handles, labels)
    return figure


def _envelope_labels(item: FilterFacts, row: int, bound: bool, own: bool) -> list[str]:
    if not item.completed:
        return []
    lines = [f"filter's ± 3 {SIGMA}", f"run {item.runs[item.ok][row]}"]
    lines = [f"± 3 std of {item.completed} runs", *lines] if item.completed > 2 else lines
    lines += [f"± 3 {SIGMA} {PERFECT_BOUND}"] if bound else []
    return [*lines, *([f"± 3 {SIGMA} {OWN_BOUND}"] if own else [])]


def _envelope(
    panel: Panel,
    times: Array,
    error: Array,
    formal: Array,
    limits: Sequence[tuple[Array, Any]],
    row: int,
    reach: float,
    colour: str,
) -> list[Any]:
    handles: list[Any] = []
    if len(error) > 2:
        mean, spread = error.mean(axis=0), 3 * error.std(axis=0, ddof=1)
        handles.append(panel.fill_between(times, mean - spread, mean + spread, color=BAND, linewidth=0))
    (dashed,) = panel.plot(times, 3 * formal, color=FORMAL, linewidth=0.9, linestyle=(0, (4, 1.5)))
    panel.plot(times, -3 * formal, color=FORMAL, linewidth=0.9, linestyle=(0, (4, 1.5)))
    (line,) = panel.plot(times, error[row], color=colour, linewidth=0.6)
    handles += [dashed, line]
    for limit, dashes in limits:
        handles.append(panel.plot(times, 3 * limit, color=BOUND, linewidth=1.0, linestyle=dashes)[0])
        panel.plot(times, -3 * limit, color=BOUND, linewidth=1.0, linestyle=dashes)
    if reach > 0 and np.isfinite(reach):
        panel.set_ylim(-reach, reach)
    elif np.isnan(reach):
        say(panel, _UNKNOWN)
    return handles


def _reach(error: Array, formal: Array, settled: Mask) -> float:
    """Return the half height of a panel: everything after settling, with a little air."""
    done = np.abs(error).max(axis=0)
    if len(error) > 2:
        done = np.abs(error.mean(axis=0)) + 3 * error.std(axis=0, ddof=1)
    return 1.08 * largest(np.maximum(done, 3 * formal)[settled])
