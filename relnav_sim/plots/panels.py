"""What the figures draw more than once: time axes, logarithmic axes with readable numbers, boxes over runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.style import FAINT, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel

MOST_DOTS = 60
_HOURS_FROM_S = 20_000.0
_LOG_FROM_RATIO = 12.0
_LINEAR_TO_RATIO = 4.0
_FEWEST_FOR_DENSITY = 5
_MANY_OUTLIERS = 400
_GOLDEN = 0.618034  # steps of the golden ratio spread dots evenly without a random number


def time_unit(times_s: Array) -> tuple[str, float]:
    """Return the unit of a time axis and its length in seconds."""
    return ("h", 3600.0) if times_s[-1] > _HOURS_FROM_S else ("s", 1.0)


def time_axis(panel: Panel, times: Array, unit: str) -> None:
    """Name the time axis and let it fit the data."""
    panel.set_xlabel(f"time [{unit}]")
    panel.ticklabel_format(axis="x", style="plain")  # a reader should not have to multiply times by 10^4
    panel.set_xlim(times[0], times[-1] if times[-1] > times[0] else times[0] + 1)


def heading(panel: Panel, words: str) -> None:
    """Put a heading over the left end of a panel, at a fixed place: matplotlib's search for one is slow."""
    panel.set_title(words, loc="left", pad=2.0, y=1.0)


def log_axis(panel: Panel, which: Literal["x", "y"]) -> None:
    """Make an axis logarithmic, with plain numbers and enough of them to read a value.

    An axis that spans less than a factor of 4 stays linear: it would show a single power of ten. A panel without
    anything above zero says so.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = panel.get_xlim() if which == "x" else panel.get_ylim()
    if low > 0 and high < _LINEAR_TO_RATIO * low:
        return
    (panel.set_xscale if which == "x" else panel.set_yscale)("log")
    low, high = panel.get_xlim() if which == "x" else panel.get_ylim()
    axis = panel.xaxis if which == "x" else panel.yaxis
    if not 0 < low < high < np.inf:
        (panel.set_xscale if which == "x" else panel.set_yscale)("linear")
        say(panel, "no value above zero is known")
        return
    decades = np.log10(high) - np.log10(low)
    subs = (1.0,) if decades > 2.5 else (1.0, 3.0) if decades > 1.3 else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs, numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def boxes(panel: Panel, values: Sequence[Array], colours: Sequence[str]) -> None:
    """Draw one horizontal box per row over the figures of its runs; few runs show as dots, many as outliers only.

    The box holds the middle half of the runs, its line is the median, the whiskers reach the last run within
    1.5 box lengths (Tukey 1977). Drawn here because matplotlib's own box plot loads pyplot and a window system.
    """
    everything = np.concatenate(values) if values else np.empty(0)
    if not everything.size:
        say(panel, "no run has one")
        return
    crowded = max(figures.size for figures in values) > MOST_DOTS
    rows = np.array([row for row, figures in enumerate(values) if figures.size])
    first, median, third, low, high = np.array([_box(values[row]) for row in rows]).T
    fill, edge = [f"{colours[row]}66" for row in rows], [colours[row] for row in rows]
    # All boxes at once: one object a kind of line is drawn many times faster than one a line.
    panel.barh(rows, third - first, left=first, height=0.6, color=fill, edgecolor=edge, linewidth=0.8)
    panel.hlines(np.tile(rows, 2), np.append(low, third), np.append(first, high), color=INK, linewidth=0.7)
    across = np.tile(rows, 2)
    panel.vlines(np.append(low, high), across - 0.18, across + 0.18, color=INK, linewidth=0.7)
    panel.vlines(median, rows - 0.3, rows + 0.3, color=INK, linewidth=1.2)
    dots, places = [], []
    for row, lowest, highest in zip(rows, low, high, strict=True):
        figures = values[row]
        shown = figures[(figures < lowest) | (figures > highest)] if crowded else figures
        shift = 0.0 if crowded else 0.4 * (np.modf(np.arange(shown.size) * _GOLDEN)[0] - 0.5)
        dots.append(shown)
        places.append(np.full(shown.size, row) + shift)
    panel.plot(np.concatenate(dots), np.concatenate(places), ".", color=INK, markersize=2.2, mew=0, alpha=0.55)
    if everything.min() > 0 and everything.max() > _LOG_FROM_RATIO * everything.min():
        log_axis(panel, "x")
    panel.grid(visible=False, axis="y")


def violins(panel: Panel, values: Sequence[Array], colours: Sequence[str]) -> None:
    """Draw one horizontal violin per row: a Gaussian kernel density over runs with Scott's width, and the quartiles.

    Densities are of the logarithm where the axis is logarithmic. Fewer than five runs, or equal ones, show as dots.
    """
    everything = np.concatenate(values) if values else np.empty(0)
    if not everything.size:
        say(panel, "no run has one")
        return
    logarithmic = everything.min() > 0 and everything.max() > _LOG_FROM_RATIO * everything.min()
    for row, (figures, colour) in enumerate(zip(values, colours, strict=True)):
        scaled = np.log(figures) if logarithmic else figures
        width = scaled.std(ddof=1) * len(scaled) ** -0.2 if len(scaled) > 1 else 0.0
        if len(figures) < _FEWEST_FOR_DENSITY or width <= 1e-9 * np.abs(scaled).max(initial=1e-300):
            panel.plot(figures, np.full(figures.size, row), ".", color=colour, markersize=3)
            continue
        at = np.linspace(scaled.min() - 2 * width, scaled.max() + 2 * width, 121)
        density = np.exp(-0.5 * ((at[:, None] - scaled) / width) ** 2).sum(axis=1)
        half = 0.4 * density / density.max()
        at = np.exp(at) if logarithmic else at
        panel.fill_between(at, row - half, row + half, color=colour, alpha=0.45, linewidth=0)
        first, median, third = np.quantile(figures, [0.25, 0.5, 0.75])
        panel.plot([first, third], [row, row], color=INK, linewidth=2.2, solid_capstyle="butt")
        panel.plot(median, row, "o", color=INK, mfc="white", markersize=3.2, mew=0.8)
    if logarithmic:
        log_axis(panel, "x")
    panel.grid(visible=False, axis="y")


def upright_boxes(panel: Panel, values: Sequence[Array], colours: Sequence[str]) -> None:
    """Draw one upright box per column with its outliers, rasterised where there are very many; log axis if wide."""
    everything = np.concatenate(values) if values else np.empty(0)
    if not everything.size:
        say(panel, "no completed run")
        return
    for column, (figures, colour) in enumerate(zip(values, colours, strict=True)):
        if not figures.size:
            continue
        first, median, third, low, high = _box(figures)
        far = figures[(figures < low) | (figures > high)]
        panel.vlines([column, column], [low, third], [first, high], color=INK, linewidth=0.8)
        panel.hlines([low, high], column - 0.14, column + 0.14, color=INK, linewidth=0.8)
        panel.bar(column, third - first, 0.55, bottom=first, color=colour, alpha=0.55, edgecolor=colour, linewidth=0.8,
                  zorder=2)  # fmt: skip
        panel.hlines(median, column - 0.275, column + 0.275, color=INK, linewidth=1.2, zorder=3)
        panel.plot(
            np.full(far.size, column), far, ".", color=colour, markersize=1.8, mew=0, alpha=0.5,
            rasterized=far.size > _MANY_OUTLIERS,
        )  # fmt: skip
    positive = everything[everything > 0]
    if positive.size == everything.size and everything.max() > _LOG_FROM_RATIO * np.quantile(everything, 0.25):
        panel.set_ylim(0.8 * float(np.quantile(everything, 0.001)), 1.25 * everything.max())
        log_axis(panel, "y")
    else:
        panel.set_ylim(0.0, 1.05 * everything.max())
    panel.set_xlim(-0.6, len(values) - 0.4)
    panel.grid(visible=False, axis="x")


def _box(figures: Array) -> tuple[float, float, float, float, float]:
    """Return quartiles and median, and the ends of the whiskers: the last figures within 1.5 box lengths."""
    first, median, third = np.quantile(figures, [0.25, 0.5, 0.75])
    reach = 1.5 * (third - first)
    near = figures[(figures >= first - reach) & (figures <= third + reach)]
    return float(first), float(median), float(third), float(near.min()), float(near.max())


def say(panel: Panel, words: str) -> None:
    """Write into a panel that has nothing to show why that is so."""
    panel.text(0.5, 0.5, words, transform=panel.transAxes, ha="center", va="center", color=FAINT)
