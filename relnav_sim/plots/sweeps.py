"""Figures over cases and over what a campaign varies: every case, trends, boxes along a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.data import (
    PERFECT_BOUND,
    Case,
    FigureError,
    bound_of,
    errors_of,
    largest,
    leading_filter,
    sizes,
    speed_unit,
)
from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.plots.panels import log_axis, say, upright_boxes
from relnav_sim.plots.run_figures import Statistic
from relnav_sim.plots.style import (
    BOUND,
    FORMAL,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    marker,
    nested_width,
    new_figure,
    shown_name,
)
from relnav_sim.plots.sweep_points import Point, Trend, trends
from relnav_sim.plots.words import BOUND_NOTE, FigureWords
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval, mean_interval
from relnav_sim.wording import short_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

Quantity = Literal["position", "velocity"]
_NORM = {"position": "r", "velocity": "v"}
_LOG_FROM_RATIO = 8.0
_MOST_TICKS = 16
_LETTERS_ACROSS = 44  # that fit beside one another below a figure


def accuracy_by_case(
    results: Results, cases: Sequence[Case] | None = None, filters: Sequence[str] | None = None
) -> Figure:
    """Draw the position RMS of every filter in every case, with its 95 % interval over runs, and the bound.

    Cases stand on the horizontal axis by number and name; of many cases every second one, third one and so on is named.

    Args:
        results: An opened result.
        cases: The cases; default: all but stressed ones.
        filters: The filters; default: all.
    """
    facts = [case_facts(results, case) for case in (results.nominal if cases is None else cases)]
    names = tuple(results.filters if filters is None else filters)
    styles = line_styles(results.filters)
    numbers = np.arange(len(facts), dtype=float)
    limits = np.array([settled_bound(results, case, "position") for case in facts])
    with house_style():
        labels = [shown_name(name) for name in names] + ([PERFECT_BOUND] if np.isfinite(limits).any() else [])
        figure = new_figure(2.3 + legend_height(labels))
        panel = figure.subplots()
        handles: list[Any] = []
        for index, name in enumerate(names):
            found = [_over_runs(Point(0.0, case, name), "rms", "position") for case in facts]
            shift = (index - (len(names) - 1) / 2) * 0.7 / len(names)
            handles.append(
                _with_intervals(
                    panel, numbers + shift, found, styles[name].colour, marker(results.filters, name),
                    size=max(1.8, 3.6 - 0.03 * len(facts)), linestyle="none",
                )
            )  # fmt: skip
        if np.isfinite(limits).any():
            panel.hlines(limits, numbers - 0.42, numbers + 0.42, color=BOUND, linewidth=1.0, linestyle="-.")
            handles.append(key(BOUND, "-.", 1.0))
        if any(item.completed for case in facts for item in case.filters):
            log_axis(panel, "y")
        else:
            say(panel, "no completed run")
        panel.set_ylabel("position RMS [m]")
        panel.set_xlim(numbers.min() - 0.6, numbers.max() + 0.6)
        panel.grid(visible=False, axis="x")
        below = _case_axis(panel, facts)
        figure.set_figheight(2.0 + legend_height(labels) + below)
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), below, hspace=0.1, wspace=0.1)
        legend_above(figure, handles, labels)
    return figure


def _case_axis(panel: Panel, facts: Sequence[CaseFacts]) -> float:
    """Write number and name of the cases below the axis and return the room that these take, inches."""
    varied, names = _keys_apart(short_labels([case.label for case in facts]))
    every = -(-len(facts) // _MOST_TICKS)
    ticks = [f"{case.index}: {shown_name(name, 26)}" for case, name in zip(facts, names, strict=True)][::every]
    longest = max(map(len, ticks))
    upright = longest * len(ticks) > _LETTERS_ACROSS
    panel.set_xticks(range(0, len(facts), every), ticks, rotation=90 if upright else 0)
    panel.set_xlabel(f"case: {shown_name(varied, 50)}" if varied else "case")
    return 0.42 + 0.05 * longest if upright else 0.36


def _keys_apart(labels: Sequence[str]) -> tuple[str, list[str]]:
    """Return what labels of one form vary, and its values: ``a=1, b=2`` and ``a=3, b=2`` are 1 and 3 of a.

    Labels of several forms, such as names of values, stay as they are.
    """
    pairs = [[part.partition("=") for part in label.split(", ")] for label in labels]
    keys = [[key for key, _, _ in row] for row in pairs]
    if len(labels) < 2 or any(row != keys[0] for row in keys) or not all(sign for row in pairs for _, sign, _ in row):
        return "", list(labels)
    places = [place for place in range(len(keys[0])) if len({row[place] for row in pairs}) > 1]
    return ", ".join(keys[0][place] for place in places), [
        ", ".join(row[place][2] for place in places) for row in pairs
    ]


def accuracy_words(cases: Sequence[CaseFacts]) -> FigureWords:
    """Return the words of `accuracy_by_case`."""
    best = [f"case {case.index} {case.by_accuracy[0].name}" for case in cases if case.by_accuracy]
    return FigureWords(
        f"RMS of the position error ({cases[0].when}) in every case: mean over runs with its 95 % interval. "
        f"{BOUND_NOTE}",
        f"Position RMS per case and filter with intervals. Smallest: {', '.join(best)}.",
    )


def sweep_trend(
    results: Results,
    case: Case | None = None,
    filters: Sequence[str] | None = None,
    along: str | None = None,
    statistics: Sequence[Statistic] = ("rms",),
    known: Sequence[CaseFacts] = (),
) -> Figure:
    """Draw position and velocity errors against what the campaign varies, with 95 % intervals over runs.

    The horizontal axis is logarithmic where the values span much. Over cases there is a line per filter and, where
    it is stored, the bound; over a filter's option (``alpha`` of several filters) one line.

    Args:
        results: An opened result.
        case: The case at which other varied values are held; default: the first.
        filters: The filters; default: all.
        along: The varied path, or its end; default: the number with the most values.
        statistics: What is taken over the time of each run: ``rms``, or ``mean`` and ``std`` of the error's size.
        known: Cases whose facts have been read already.
    """
    held = None if case is None else case_facts(results, case)
    path, lines = trends(results, held, along, filters, known)
    styles = line_styles(results.filters)
    many = len(statistics) > 1
    with house_style():
        labels = [shown_name(line.label) for line in lines if line.label]
        labels += list(statistics) if many else []
        bounded = [_trend_bound(results, lines, quantity) for quantity in ("position", "velocity")]
        labels += [PERFECT_BOUND] if bounded[0] is not None and not many else []
        figure = new_figure(3.0 + legend_height(labels))
        panels = figure.subplots(2, 1, sharex=True)
        handles: list[Any] = []
        for panel, quantity, limit in zip(panels, ("position", "velocity"), bounded, strict=True):
            found = {
                (line.label, statistic): [_over_runs(point, statistic, quantity) for point in line.points]
                for line in lines
                for statistic in statistics
            }
            fastest = largest(np.array([figure.estimate for group in found.values() for figure in group]))
            factor, unit = (1.0, "m") if quantity == "position" else speed_unit(fastest)
            drawn = []
            for order, line in enumerate(lines):
                for place, statistic in enumerate(statistics):
                    drawn.append(
                        _with_intervals(
                            panel,
                            [float(point.value) for point in line.points],
                            [_scaled(one, factor) for one in found[line.label, statistic]],
                            styles[line.filter].colour,
                            marker(results.filters, line.filter),
                            size=1.8 * nested_width(order, len(lines), 2.6),
                            linestyle="-" if not place else (0, (4, 1.5)),
                            hollow=place > 0,
                        )
                    )
            if limit is not None and not many:
                panel.plot(limit[0], factor * limit[1], color=BOUND, linestyle="-.", linewidth=1.0)
            handles = drawn[:: len(statistics)] if lines and lines[0].label else []
            panel.set_ylabel(f"{quantity} {'error' if many else statistics[0].upper()} [{unit}]")
            log_axis(panel, "y")
        _value_axis(panels, lines)
        panels[-1].set_xlabel(axis_label(path))
        if many:
            handles += [key(FORMAL, "-" if not place else (0, (4, 1.5)), 1.0) for place in range(len(statistics))]
        if bounded[0] is not None and not many:
            handles.append(key(BOUND, "-.", 1.0))
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        if handles:
            legend_above(figure, handles, labels)
    return figure


def sweep_words(case: CaseFacts, along: str) -> FigureWords:
    """Return the words of `sweep_trend`."""
    return FigureWords(
        f"Position and velocity RMS ({case.when}) against {along}, mean over runs with 95 % intervals. Other varied "
        f"values are those of case {case.index}. {BOUND_NOTE}",
        f"Two panels, position and velocity RMS of every filter against {along}; the overview table has the values.",
    )


def sweep_boxes(
    results: Results,
    case: Case | None = None,
    filter: str | None = None,
    along: str | None = None,
    quantity: Quantity = "position",
    of: Literal["runs", "epochs"] = "epochs",
) -> Figure:
    """Draw a box of the error's size at each value of what the campaign varies.

    Box: middle half; line: median; whiskers: to the last value within 1.5 box lengths; dots: what lies beyond.

    Args:
        results: An opened result.
        case: The case at which other varied values are held; default: the first.
        filter: The filter, where cases are swept; default: the one with the smallest RMS in that case.
        along: The varied path, or its end; default: the number with the most values.
        quantity: ``position`` or ``velocity``.
        of: ``epochs``: all stored epochs after settling of all completed runs, as published box plots of one long
            run show; ``runs``: the RMS of each run.
    """
    held = None if case is None else case_facts(results, case)
    path, lines = trends(results, held, along, None if filter is None else _with_its_kind(results, filter))
    line = _one_of(lines, filter)
    values = [_sizes(results, point, quantity, of) for point in line.points]
    styles = line_styles(results.filters)
    factor, unit = (1.0, "m")
    if quantity == "velocity":
        factor, unit = speed_unit(max((float(np.quantile(part, 0.75)) for part in values if part.size), default=0.0))
    with house_style():
        figure = new_figure(2.4)
        panel = figure.subplots()
        upright_boxes(panel, [factor * part for part in values], [styles[point.filter].colour for point in line.points])
        panel.set_xticks(range(len(values)), [f"{point.value:g}" for point in line.points])
        panel.set_xlabel(axis_label(path))
        panel.set_ylabel(f"{quantity} {'error' if of == 'epochs' else 'RMS'} [{unit}]")
        if line.label:
            panel.set_title(shown_name(line.label), loc="right", pad=2.0, y=1.0)
        margins(figure, 0.5, 0.12, 0.2, 0.36, hspace=0.1, wspace=0.1)
    return figure


def axis_label(path: str) -> str:
    """Return the label of an axis of varied values: the last two parts of the path, the unit in brackets."""
    name = ".".join(path.split(" ")[-1].split(".")[-2:])
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return f"{name.removesuffix(ending)} [{unit}]".replace("_", " ")
    return f"{name} [-]".replace("_", " ")


_UNITS = {
    "_arcsec": "arcsec", "_m2_s3": "m²/s³", "_kg_m3": "kg/m³", "_m_s2": "m/s²", "_m_s": "m/s", "_km": "km",
    "_deg": "deg", "_rad": "rad", "_kg": "kg", "_m2": "m²", "_m": "m", "_s": "s", "_per_hour": "1/h",
}  # fmt: skip


def _over_runs(point: Point, statistic: Statistic, quantity: str) -> Interval:
    if point.filter not in point.case.names:
        return NO_INTERVAL
    item = point.case.filter(point.filter)
    return mean_interval(item.errors(statistic, point.case.span, _NORM[quantity])[item.ok])


def _scaled(found: Interval, factor: float) -> Interval:
    return Interval(factor * found.estimate, factor * found.low, factor * found.high, found.level, found.runs)


def _with_intervals(
    panel: Panel, at: Any, found: Sequence[Interval], colour: str, shape: str, size: float, linestyle: Any,
    hollow: bool = False,
) -> Any:  # fmt: skip
    value, low, high = np.array([[one.estimate, one.low, one.high] for one in found]).reshape(-1, 3).T
    return panel.errorbar(
        at,
        value,
        yerr=[np.nan_to_num(value - low), np.nan_to_num(high - value)],
        color=colour,
        marker=shape,
        markersize=size,
        markerfacecolor="white" if hollow else colour,
        linestyle=linestyle,
        elinewidth=0.9,
    )


def settled_bound(results: Results, case: CaseFacts, quantity: str) -> float:
    """Return the RMS over time of the bound on the headline span; NaN where none is stored."""
    if not case.filters:
        return np.nan
    rows = np.flatnonzero(case.times_s >= case.settle_s) if case.span == "settled" else np.arange(len(case.times_s))
    bound = bound_of(results, case, rows)
    if bound is None:
        return np.nan
    known = bound[:, 6 + (quantity == "velocity")]
    known = known[np.isfinite(known)]  # there is none before the first epoch at which a run could start
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan


def _trend_bound(results: Results, lines: Sequence[Trend], quantity: str) -> tuple[Array, Array] | None:
    if not lines or not lines[0].label:
        return None
    values = np.array([float(point.value) for point in lines[0].points])
    limits = np.array([settled_bound(results, point.case, quantity) for point in lines[0].points])
    return (values, limits) if np.isfinite(limits).any() else None


def _value_axis(panels: Sequence[Panel], lines: Sequence[Trend]) -> None:
    values = np.array([float(point.value) for line in lines for point in line.points])
    if values.size and values.min() > 0 and values.max() >= _LOG_FROM_RATIO * values.min():
        for panel in panels:
            panel.set_xlim(values.min() / 1.25, values.max() * 1.25)
            log_axis(panel, "x")


def _sizes(results: Results, point: Point, quantity: str, of: str) -> Array:
    item = point.case.filter(point.filter)
    if of == "runs":
        found = item.errors("rms", point.case.span, _NORM[quantity])[item.ok]
    else:
        rows = np.flatnonzero(point.case.times_s >= point.case.settle_s)
        rows = rows if rows.size else np.arange(len(point.case.times_s))
        part = slice(3, 6) if quantity == "velocity" else slice(0, 3)
        found = sizes(errors_of(results, point.case, item, rows)[..., part]).ravel()
    return found[np.isfinite(found)]


def _with_its_kind(results: Results, filter: str) -> list[str]:
    entries = results.campaign_content.get("filters", {})
    kind = entries.get(filter, {}).get("kind")
    return [name for name in results.filters if name == filter or entries.get(name, {}).get("kind") == kind]


def _one_of(lines: Sequence[Trend], filter: str | None) -> Trend:
    """Return the line of a filter, of the most accurate one by default; the only line where filters are its points."""
    if not lines:
        raise FigureError("no run has been computed yet")
    wanted = filter or leading_filter(lines[0].points[0].case)
    return next((line for line in lines if line.filter == wanted), lines[0])
