"""What tuning tried, as a table (CSV) and as a figure."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.plots.style import (
    FAINT,
    LineStyle,
    house_style,
    legend_above,
    legend_height,
    line_styles,
    margins,
    new_figure,
    shown_name,
)
from relnav_sim.tuning.objective import Figures, mean_log
from relnav_sim.tuning.result import FilterTuning, Tuning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL_INCH = 3.0, 1.7
HEADROOM = 4.0
"""Worse than this many times the start or the best is off the figure, where the detail would drown in it."""


def curve_csv(tuning: Tuning) -> str:
    """Return every candidate as a row: its numbers, the objective and the figures, each with its 95 % interval."""
    names = list(dict.fromkeys(scalar.name for found in tuning.filters.values() for scalar in found.scalars))
    file = io.StringIO()
    rows = csv.writer(file, lineterminator="\n")
    figures = [f"{name}{end}" for name in _QUANTITIES for end in ("", "_low", "_high")]
    objective = ["objective", "objective_low", "objective_high"]
    rows.writerow(["filter", "candidate", "round", *names, *objective, *figures, "failed_runs", "chosen"])
    for found in tuning.filters.values():
        for number, tried in enumerate(found.evaluations):
            values = dict(zip((scalar.name for scalar in found.scalars), tried.values, strict=True))
            interval = tried.score.interval
            cells = [tried.score.value, interval.low, interval.high]
            for quantity in _QUANTITIES.values():
                cells += quantity.interval(tried.figures)
            rows.writerow(
                [found.name, number, tried.round, *(_cell(values.get(name, math.nan)) for name in names)]
                + [_cell(value) for value in cells]
                + [int(tried.figures.broken.sum()), int(found.found and tried is found.best)]
            )
    return file.getvalue()


def curve_figure(tuning: Tuning) -> Figure:
    """Return the figure: what the objective is made of against each free number, every filter in its colour.

    Dots are candidates; the line runs through those that share their other numbers with the start. A ring is the
    campaign's own value, a star the chosen one with its 95 % interval over runs.
    """
    filters = {name: found for name, found in tuning.filters.items() if found.found}
    names = list(dict.fromkeys(scalar.name for found in filters.values() for scalar in found.scalars))
    quantities = [_QUANTITIES[name] for name in _SHOWN[tuning.options.objective]]
    styles = line_styles(list(tuning.filters))
    labels = [shown_name(name) for name in filters]
    rows, columns = len(names), len(quantities)
    width = 0.55 + columns * PANEL_INCH[0] + (columns - 1) * 0.5
    top = legend_height(labels) + 0.08
    height = top + rows * PANEL_INCH[1] + 0.42 + (rows - 1) * 0.5
    with house_style():
        figure = new_figure(height, width)
        panels = figure.subplots(max(rows, 1), columns, squeeze=False)
        for row, name in zip(panels, names, strict=False):
            for panel, quantity in zip(row, quantities, strict=True):
                for found in filters.values():
                    _draw(panel, found, name, quantity, styles[found.name])
                panel.set_xlabel(_axis_name(name))
                panel.set_ylabel(quantity.label)
                _set_scales(panel, list(filters.values()), name, quantity)
        handles = [panels[0, 0].plot([], [], color=styles[name].colour, ls=styles[name].dashes)[0] for name in filters]
        if handles:
            legend_above(figure, handles, labels)
        margins(figure, left=0.5, right=0.08, top=top, bottom=0.38, hspace=0.5, wspace=0.55)
    return figure


@dataclass(frozen=True)
class _Quantity:
    """A figure of a candidate, geometric mean over cases of the mean over runs."""

    label: str
    of: Callable[[Figures], Any]

    def interval(self, figures: Figures) -> list[float]:
        """Return the figure and its 95 % interval; NaN where a run failed."""
        if not figures.sound:
            return [math.nan] * 3
        interval = mean_log(self.of(figures)).interval
        return [math.exp(value) for value in (interval.estimate, interval.low, interval.high)]


_QUANTITIES = {
    "position_rms_m": _Quantity("position RMS, m", lambda figures: figures.position),
    "velocity_rms_m_s": _Quantity("velocity RMS, m/s", lambda figures: figures.velocity),
    "anees": _Quantity("ANEES", lambda figures: figures.anees),
}
_SHOWN = {
    "position": ("position_rms_m",),
    "velocity": ("velocity_rms_m_s",),
    "consistency": ("anees",),
    "in_band": ("position_rms_m", "anees"),
    "both": ("position_rms_m", "anees"),
}


def _draw(panel: Any, found: FilterTuning, name: str, quantity: _Quantity, style: LineStyle) -> None:
    place = next((place for place, scalar in enumerate(found.scalars) if scalar.name == name), None)
    if place is None:
        return
    sound = [tried for tried in found.evaluations if tried.figures.sound]
    points = [(tried.values[place], quantity.interval(tried.figures)[0]) for tried in sound]

    def others(values: tuple[float, ...]) -> tuple[float, ...]:
        return values[:place] + values[place + 1 :]

    on_line = [p for p, tried in zip(points, sound, strict=True) if others(tried.values) == others(found.start.values)]
    panel.plot(*zip(*points, strict=True), ls="", marker=".", ms=2.5, color=style.colour, alpha=0.6)
    if on_line:
        panel.plot(*zip(*sorted(on_line), strict=True), ls=style.dashes, color=style.colour, lw=0.8)
    if found.start.figures.sound:
        start = quantity.interval(found.start.figures)[0]
        panel.plot(found.start.values[place], start, marker="o", ms=4.5, mfc="white", mec=style.colour, ls="", zorder=4)
    x, (y, low, high) = found.best.values[place], quantity.interval(found.best.figures)
    bar = [[max(y - low, 0.0)], [max(high - y, 0.0)]]
    panel.errorbar(x, y, yerr=bar, marker="*", ms=6, color=style.colour, lw=0.8, capsize=1.5, zorder=5)


def _set_scales(panel: Any, filters: list[FilterTuning], name: str, quantity: _Quantity) -> None:
    scalars = [scalar for found in filters for scalar in found.scalars if scalar.name == name]
    if all(scalar.log for scalar in scalars):
        place = [value for found in filters for value in _values_of(found, name)]
        _set_log(panel, "x", min(place), max(place))
    tried = [(found, e) for found in filters for e in found.evaluations if e.figures.sound]
    values = np.array([quantity.interval(e.figures)[0] for _, e in tried])
    kept = np.array([quantity.interval(e.figures)[0] for found, e in tried if e in (found.best, found.start)])
    bars = np.array([quantity.interval(found.best.figures)[1:] for found in filters])
    low, high = min(values.min(), bars.min()), max(min(values.max(), HEADROOM * kept.max()), bars.max())
    if quantity.label == "ANEES":
        low = max(low, kept.min() / HEADROOM)
        panel.axhline(1.0, color=FAINT, lw=0.6)
        low, high = min(low, 0.9), max(high, 1.1)
    if high > 3 * low:
        _set_log(panel, "y", low, high)
    panel.set_ylim(low / 1.1, high * 1.1)


def _values_of(found: FilterTuning, name: str) -> list[float]:
    places = [place for place, scalar in enumerate(found.scalars) if scalar.name == name]
    return [tried.values[place] for place in places for tried in found.evaluations]


def _set_log(panel: Any, axis: str, low: float, high: float) -> None:
    """Give an axis a logarithmic scale, with plain numbers where it is short."""
    from matplotlib.ticker import LogLocator, NullFormatter

    panel.set(**{f"{axis}scale": "log"})
    if low > 0 and high < 1e4 * low:
        ticks = getattr(panel, f"{axis}axis")
        ticks.set_major_locator(LogLocator(subs=(1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 5, 7)))
        ticks.set_major_formatter("{x:g}")
        ticks.set_minor_formatter(NullFormatter())


def _axis_name(name: str) -> str:
    """Return a scalar's name with its unit as on an axis."""
    if name.endswith("acceleration_psd_m2_s3"):
        return "acceleration PSD of the process noise, m$^2$/s$^3$"
    return name.replace("_", " ").replace(".", ", ")


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.9g}"
