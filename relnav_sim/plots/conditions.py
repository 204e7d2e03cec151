"""Under which conditions errors grow: range to the other craft, and what happens in flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.plots.data import (
    Case,
    chosen_filters,
    errors_of,
    facts_of,
    sigmas_of,
    sizes,
    speed_unit,
    window,
)
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.manoeuvres import manoeuvre_times
from relnav_sim.plots.panels import heading, log_axis, say
from relnav_sim.plots.sensor_times import usual_gap
from relnav_sim.plots.style import (
    FORMAL,
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
from relnav_sim.plots.words import FigureWords

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_BINS = 14
_FEWEST_IN_BIN = 5
_SAME_RANGE = 1.02
_LOG_FROM_RATIO = 8.0
_KM_FROM_M = 5000.0
_GAP = 3.0  # a gap between measurements this many times the usual one is an outage
_MOST_EVENTS = 20_000
_MANOEUVRE = "manoeuvre"


def error_against_range(results: Results, case: Case = 0, filters: Sequence[str] | None = None) -> Figure:
    """Draw the size of the errors against the true range: RMS and 95 % quantile over epochs and runs, in bins of range.

    Settled epochs only. Solid: RMS; dashed, the same colour: the size that 95 % of the errors stay below.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
    """
    facts = facts_of(results, case)
    view = window(facts)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    rows = view.rows[view.settled]
    ranges = {item.name: results.distance(facts.index, item.name)[item.ok][:, rows] for item in items}
    everywhere = np.concatenate([np.zeros((0, len(rows))), *ranges.values()])
    low, high = (float(everywhere.min()), float(everywhere.max())) if everywhere.size else (1.0, 1.0)
    edges = (np.geomspace if high > _LOG_FROM_RATIO * low > 0 else np.linspace)(low, high * (1 + 1e-12), _BINS + 1)
    factor, unit = (1e-3, "km") if high > _KM_FROM_M else (1.0, "m")
    styles = line_styles(facts.all_filters)
    labels = [*(shown_name(item.name) for item in items), "95 % of errors"]
    with house_style():
        figure = new_figure(2.9 + legend_height(labels))
        panels = figure.subplots(2, 1, sharex=True)
        for panel, quantity, part in zip(panels, ("position", "velocity"), (slice(0, 3), slice(3, 6)), strict=True):
            drawn = [
                _binned(sizes(errors_of(results, facts, item, rows)[..., part]), ranges[item.name], edges)
                for item in items
            ]
            largest = max((float(np.nanmax(most, initial=0.0)) for _, _, most in drawn), default=0.0)
            scale, unit_of = (1.0, "m") if quantity == "position" else speed_unit(largest)
            for place, (item, (middle, rms, most)) in enumerate(zip(items, drawn, strict=True)):
                look, width = styles[item.name], nested_width(place, len(items), 2.0)
                panel.plot(factor * middle, scale * rms, color=look.colour, linestyle=look.dashes, linewidth=width)
                panel.plot(factor * middle, scale * most, color=look.colour, linestyle=(0, (4, 1.5)), linewidth=0.8)
            if not drawn:
                say(panel, "every run failed")
            elif high < _SAME_RANGE * low:
                panel.clear()
                say(panel, f"the range stays at {factor * (low + high) / 2:.4g} {unit}")
            else:
                panel.set_xlim(factor * low, factor * high)
                log_axis(panel, "y")
            panel.set_ylabel(f"{quantity} error [{unit_of}]")
        if high > _LOG_FROM_RATIO * low > 0:
            for panel in panels:
                log_axis(panel, "x")
        panels[-1].set_xlabel(f"true range [{unit}]")
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        handles = [key(styles[item.name].colour, styles[item.name].dashes, 1.2) for item in items]
        legend_above(figure, [*handles, key(FORMAL, (0, (4, 1.5)), 0.8)], labels)
    return figure


def range_words(case: CaseFacts) -> FigureWords:
    """Return the words of `error_against_range`."""
    return FigureWords(
        f"Size of the errors against the true range, {case.when}. Solid: RMS over epochs and runs; dashed: 95 %.",
        "Two panels, position and velocity error of every filter against the true range.",
    )


def error_around_events(
    results: Results, case: Case = 0, filters: Sequence[str] | None = None, around_s: float | None = None
) -> Figure:
    """Draw the RMS position error over runs and events against the time since the event, a panel per kind.

    Kinds: measurements are missing (outage), they begin or come back (acquisition), of each sensor by itself where a
    filter has several; a manoeuvre. The first two are read off the stored series: an outage shorter than the storage
    interval is not seen. Manoeuvres are those of the campaign.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        around_s: How far to look before and after an event, s; default: a tenth of the run.
    """
    facts = facts_of(results, case)
    items = [item for item in chosen_filters(facts, filters) if item.completed]
    times = facts.times_s
    span = (times[-1] - times[0]) / 10 if around_s is None else around_s
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    offsets = np.arange(-round(span / step), round(span / step) + 1)
    found = {item.name: events_of(results, facts, item) for item in items}
    found_kinds = dict.fromkeys(kind for each in found.values() for kind, rows in each.items() if len(rows))
    kinds = sorted(found_kinds, key=lambda kind: kind == _MANOEUVRE)
    styles = line_styles(facts.all_filters)
    labels = [*(shown_name(item.name) for item in items), "formal"]
    with house_style():
        figure = new_figure(0.55 + 1.2 * max(1, len(kinds)) + legend_height(labels))
        panels = figure.subplots(max(1, len(kinds)), 1, sharex=True, squeeze=False)[:, 0]
        for panel, kind in zip(panels, kinds, strict=False):
            for place, item in enumerate(items):
                at = found[item.name].get(kind, np.empty((0, 2), dtype=np.int64))
                for read, dashes, width in (
                    (errors_of, styles[item.name].dashes, nested_width(place, len(items), 2.0)),
                    (sigmas_of, ":", 0.9),
                ):
                    squares = np.sum(read(results, facts, item, np.arange(len(times)))[..., :3] ** 2, axis=-1)
                    panel.plot(
                        offsets * step, _aligned(squares, at, offsets), color=styles[item.name].colour,
                        linestyle=dashes, linewidth=width,
                    )  # fmt: skip
            count = max(len(each.get(kind, ())) for each in found.values())
            panel.axvline(0.0, color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
            heading(panel, f"{kind} ({count} in all runs)")
            log_axis(panel, "y")
        for panel in panels:
            panel.set_ylabel("RMS [m]")
        if not kinds:
            say(panels[0], "no outage, acquisition or manoeuvre")
        panels[-1].set_xlabel("time since the event [s]")
        panels[-1].set_xlim(offsets[0] * step, offsets[-1] * step)
        margins(figure, 0.55, 0.16, 0.18 + legend_height(labels), 0.36, hspace=0.24, wspace=0.1)
        handles = [key(styles[item.name].colour, styles[item.name].dashes, 1.2) for item in items]
        legend_above(figure, [*handles, key(FORMAL, ":", 0.9)], labels)
    return figure


def events_words(case: CaseFacts) -> FigureWords:
    """Return the words of `error_around_events`."""
    return FigureWords(
        "RMS position error over runs and events against the time since the event. Dotted: formal sigma. Outages "
        "and acquisitions are those that show at the stored epochs.",
        "Position RMS of every filter before and after outages, acquisitions and manoeuvres, a panel for each kind.",
    )


def events_of(results: Results, case: CaseFacts, item: FilterFacts) -> dict[str, Integers]:
    """Return the events of a filter's completed runs by kind: rows of (run, stored epoch), at most 20 000 of a kind."""
    events: dict[str, list[tuple[int, int]]] = {}
    if item.by_sensor is not None and len(item.sensors) > 1:
        for place, sensor in enumerate(item.sensors):
            read = item.by_sensor.readings[item.ok][..., place] > 0
            lost, begun = _lost_and_begun(read, item.stored_between.get(sensor, 1))
            events |= {f"outage of {shown_name(sensor)}": lost, f"acquisition of {shown_name(sensor)}": begun}
    else:
        period = max(item.stored_between.values(), default=1)
        lost, begun = _lost_and_begun(np.isfinite(results.nis(case.index, item.name)[item.ok]), period)
        events |= {"outage": lost, "acquisition": begun}
    events[_MANOEUVRE] = [
        (run, int(np.searchsorted(case.times_s, time)))
        for time in manoeuvre_times(results, case.index, case.times_s)
        for run in range(item.completed)
    ]
    return {kind: np.array(rows[:_MOST_EVENTS], dtype=np.int64).reshape(-1, 2) for kind, rows in events.items()}


def _lost_and_begun(known: Mask, period: int) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return where measurements are lost and where they begin or come back, from the epochs with one (runs, K).

    Args:
        known: Whether there was a measurement since the stored epoch before.
        period: How many stored epochs the sensor's period spans.
    """
    usual = usual_gap(known, period)
    # The start has no measurement of its own, as filters begin there; a period may pass before the first.
    known[:, 0] |= known[:, : period + 1].any(axis=1)
    lost, begun = [], []
    for run, row in enumerate(known):
        seen = np.flatnonzero(row)
        if not seen.size:
            continue
        gaps = np.flatnonzero(np.diff(seen) >= max(2.0, _GAP * usual if usual > 1 else 2.0))
        lost += [(run, seen[place] + 1) for place in gaps]
        begun += [(run, seen[place + 1]) for place in gaps]
        begun += [(run, seen[0])] if seen[0] > 0 else []
        lost += [(run, seen[-1] + 1)] if len(row) - 1 - seen[-1] >= max(2.0, _GAP * usual) else []
    return lost, begun


def _aligned(squares: Array, events: Integers, offsets: Integers) -> Array:
    """Return the RMS over events at each offset; NaN where the run has no such epoch for any of them."""
    if not len(events):
        return np.full(len(offsets), np.nan)
    epochs = events[:, 1:] + offsets
    inside = (epochs >= 0) & (epochs < squares.shape[1])
    values = squares[events[:, :1], np.clip(epochs, 0, squares.shape[1] - 1)]
    inside &= np.isfinite(values)
    count = inside.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.where(inside, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan))


def _binned(errors: Array, ranges: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Return the middle of each bin, and the RMS and the 95 % quantile of the errors in it; NaN where there are few."""
    which = np.clip(np.searchsorted(edges, ranges, side="right") - 1, 0, len(edges) - 2)
    middle = np.sqrt(edges[:-1] * edges[1:]) if edges[0] > 0 else (edges[:-1] + edges[1:]) / 2
    rms, most = np.full(len(middle), np.nan), np.full(len(middle), np.nan)
    for place in range(len(middle)):
        inside = errors[(which == place) & np.isfinite(errors)]
        if inside.size >= _FEWEST_IN_BIN:
            rms[place], most[place] = np.sqrt(np.mean(inside**2)), np.quantile(inside, 0.95)
    return middle, rms, most
