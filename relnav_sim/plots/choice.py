"""Figures that help to choose: cost against accuracy, and the runs to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.plots.data import (
    PERFECT_BOUND,
    Case,
    chosen_filters,
    errors_of,
    facts_of,
    leading_filter,
    sizes,
    window,
)
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.panels import log_axis, say, time_axis
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.style import (
    BOUND,
    FAINT,
    INK,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    marker,
    new_figure,
    shown_name,
)
from relnav_sim.plots.sweeps import settled_bound
from relnav_sim.plots.words import BOUND_NOTE, FigureWords
from relnav_sim.statistics.intervals import mean_interval
from relnav_sim.wording import significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_RUN_COLOURS = (INK, "#8c2d04", "#cc4c02", "#fe9929")  # no filter's; dark to light
_MOST_LINES = 300
_CROWDED = 30


def cost_against_accuracy(results: Results, case: Case = 0, filters: Sequence[str] | None = None) -> Figure:
    """Draw position RMS with its 95 % interval against CPU time per filter step, and which filters are worth it.

    The grey line joins the filters in flight that no other beats in both (the Pareto front).

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
    """
    facts = facts_of(results, case)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    styles = line_styles(facts.all_filters)
    costs = np.array([np.nanmean(item.cpu_us[item.ok]) if np.isfinite(item.cpu_us[item.ok]).any() else np.nan
                      for item in items])  # fmt: skip
    found = [mean_interval(item.errors("rms", facts.span, "r")[item.ok]) for item in items]
    values = np.array([one.estimate for one in found])
    limit = settled_bound(results, facts, "position")
    labels = [shown_name(item.name) for item in items] + ([PERFECT_BOUND] if np.isfinite(limit) else [])
    with house_style():
        figure, ((panel,),) = figure_with_panels("cost", 2.2 + legend_height(labels))
        handles = []
        for item, cost, one in zip(items, costs, found, strict=True):
            ends = np.nan_to_num([[one.estimate - one.low], [one.high - one.estimate]])
            handles.append(
                panel.errorbar(
                    cost, one.estimate, yerr=ends, color=styles[item.name].colour,
                    marker=marker(facts.all_filters, item.name), markersize=4.5, elinewidth=0.9, linestyle="none",
                )
            )  # fmt: skip
        # What is known only later is worth no time in flight.
        in_flight = [not item.known_when for item in items]
        front = pareto_front(costs, np.where(in_flight, values, np.nan))
        if len(front) > 1:
            panel.plot(costs[front], values[front], color=FAINT, linewidth=0.8, zorder=1)
        if np.isfinite(limit):
            panel.axhline(limit, color=BOUND, linestyle="-.", linewidth=1.0)
            handles.append(key(BOUND, "-.", 1.0))
        if not np.isfinite(costs * values).any():
            say(panel, "no completed run with a known cost")
        else:
            panel.margins(0.12)
            panel.set_xlim(0.8 * np.nanmin(costs), 1.25 * np.nanmax(costs))
            log_axis(panel, "x")
            log_axis(panel, "y")
        panel.set_xlabel("CPU time per filter step [µs]")
        panel.set_ylabel("position RMS [m]")
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.1, wspace=0.1)
        if handles:
            legend_above(figure, handles, labels)
    return figure


def cost_words(case: CaseFacts) -> FigureWords:
    """Return the words of `cost_against_accuracy`."""
    timed = [item for item in case.filters if np.isfinite(item.cpu_us[item.ok]).any()]
    costs = [f"{item.name} {significant(float(np.nanmean(item.cpu_us[item.ok])))} µs" for item in timed]
    return FigureWords(
        f"Position RMS ({case.when}, with its 95 % interval) against CPU time per filter step: down and left is "
        f"better. Grey line: filters in flight that no other beats in both. {BOUND_NOTE}",
        f"Position RMS against CPU time per filter step. {', '.join(costs) or 'No time is known'}.",
    )


def pareto_front(costs: Array, values: Array) -> Integers:
    """Return which points no other beats in both, by rising cost; points with a missing figure never belong."""
    order = [place for place in np.lexsort((values, costs)) if np.isfinite(costs[place] + values[place])]
    front: list[int] = []
    for place in order:
        if not front or values[place] < values[front[-1]]:
            front.append(int(place))
    return np.array(front, dtype=np.int64)


def worst_runs(results: Results, case: Case = 0, filter: str | None = None, count: int = 3) -> Figure:
    """Draw the runs to look at: those with the largest position RMS, before all other runs of the filter in grey.

    The lower panel is their NEES, which tells whether the filter knew.

    Args:
        results: An opened result.
        case: The case.
        filter: The filter; default: the one with the smallest position RMS.
        count: How many runs, at most four.
    """
    facts = facts_of(results, case)
    item = facts.filter(filter or leading_filter(facts))
    view = window(facts)
    rms = item.errors("rms", facts.span, "r")[item.ok]
    worst = np.argsort(-rms, kind="stable")[: min(count, len(_RUN_COLOURS))]
    numbers = item.runs[item.ok]
    labels = [f"run {numbers[row]} ({rms[row]:.3g} m)" for row in worst]
    with house_style():
        figure = new_figure(2.8 + legend_height(labels))
        panels = figure.subplots(2, 1, sharex=True)
        series = (
            sizes(errors_of(results, facts, item, view.rows)[..., :3]),
            results.nees(facts.index, item.name)[:, view.rows][item.ok] / 6,
        )
        for panel, label, values in zip(panels, ("position error [m]", "NEES / 6 [-]"), series, strict=True):
            panel.set_ylabel(label)
            if not len(values):
                say(panel, "every run failed")
                continue
            values = np.where(values > 0, values, np.nan)
            # Many lines are one picture in a vector file: a dense bundle would be megabytes of coordinates.
            panel.plot(
                view.times, values[:_MOST_LINES].T, color="#bbbbbb", linewidth=0.4, zorder=1,
                rasterized=len(values) > _CROWDED,
            )  # fmt: skip
            for row, colour in zip(worst, _RUN_COLOURS, strict=False):
                panel.plot(view.times, values[row], color=colour, linewidth=0.9)
            settled = values[:, view.settled]
            bulk = settled[np.isfinite(settled)]
            if bulk.size:
                panel.set_ylim(0.7 * np.quantile(bulk, 0.002), 1.4 * bulk.max())
            log_axis(panel, "y")
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        legend_above(figure, [key(colour, "-", 0.9) for colour in _RUN_COLOURS[: len(worst)]], labels)
    return figure


def worst_words(case: CaseFacts, filter: str) -> FigureWords:
    """Return the words of `worst_runs`."""
    item = case.filter(filter)
    rms = item.errors("rms", case.span, "r")
    runs = [f"run {item.runs[row]} with {significant(float(rms[row]))} m" for row in item.worst_rows(case.span, 3)]
    return FigureWords(
        f"{filter}: the runs to look at, those with the largest position RMS ({case.when}), before all others in grey. "
        "Below: their NEES. Where it is large too, the filter does not know of its error.",
        f"Two panels, position error and NEES against time of {filter}. Largest position RMS: {', '.join(runs)}.",
    )
