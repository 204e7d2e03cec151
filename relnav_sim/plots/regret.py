"""Figure of regret: each filter's RMS over the smallest one, in the nominal case and under every stress."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.plots.data import Case, FigureError, facts_of
from relnav_sim.plots.panels import log_axis, say
from relnav_sim.plots.style import (
    FAINT,
    house_style,
    legend_above,
    legend_height,
    line_styles,
    margins,
    marker,
    new_figure,
    shown_name,
)
from relnav_sim.plots.words import FigureWords
from relnav_sim.results.block import RefusedError
from relnav_sim.statistics.regret import Regret, regret
from relnav_sim.wording import significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_ROOM_ABOVE = 1.15
_LONGEST_END = 10.0
"""Intervals are drawn up to so many times the largest value: those of a few runs would leave nothing else to see."""


def regret_by_case(results: Results, case: Case = 0) -> Figure:
    """Draw 1 + regret of every filter in a case and under each of its stresses, with simultaneous intervals.

    Args:
        results: An opened result.
        case: A case without a stress.

    Raises:
        FigureError: The result holds no stressed cases of it.
    """
    try:
        found = regret(results, facts_of(results, case).index)
    except RefusedError as error:
        raise FigureError(str(error)) from None
    return drawn_regret(found, results.filters)


def drawn_regret(found: Regret, all_filters: Sequence[str]) -> Figure:
    """Draw regret that is known already; see `regret_by_case`.

    A triangle at the upper edge is an infinite regret; a case in which no filter completed every run stays empty.

    Args:
        found: The regret.
        all_filters: The filters of all cases, which set the colours.
    """
    styles = line_styles(all_filters)
    places = np.arange(len(found.cases), dtype=float)
    ratio, low, high = (1 + part for part in (found.regret, found.low, found.high))
    with house_style():
        labels = [shown_name(name) for name in found.filters]
        longest = max(len(shown_name(name, 16)) for name in found.cases)
        figure = new_figure(2.0 + legend_height(labels) + 0.03 * longest)
        panel = figure.subplots()
        handles: list[Any] = []
        largest = float(ratio[np.isfinite(ratio)].max(initial=1.0))
        top = float(high[np.isfinite(high)].max(initial=largest))
        top = min(top, _LONGEST_END * largest)
        edge = 1 + (top - 1) * _ROOM_ABOVE if top > 1 else _ROOM_ABOVE
        for row, name in enumerate(found.filters):
            at = places + (row - (len(found.filters) - 1) / 2) * 0.7 / len(found.filters)
            colour, shape = styles[name].colour, marker(all_filters, name)
            value = np.where(np.isfinite(ratio[row]), ratio[row], np.nan)
            known = np.isfinite(value) & np.isfinite(high[row])
            ends = [np.where(known, value - low[row], 0.0), np.where(known, high[row] - value, 0.0)]
            style: dict[str, Any] = {"color": colour, "markersize": 3.6, "linestyle": "none"}
            handles.append(panel.errorbar(at, value, yerr=ends, marker=shape, elinewidth=0.9, **style))
            lost = np.isinf(ratio[row])
            panel.plot(at[lost], np.full(lost.sum(), edge), marker="^", clip_on=False, **style)
        if not np.isfinite(ratio).any():
            say(panel, "no filter completed every run")
        panel.axhline(1.0, color=FAINT, linewidth=0.6, zorder=0)
        panel.set_ylim(1 - 0.04 * (edge - 1), edge)
        log_axis(panel, "y")
        panel.set_ylabel("position RMS / smallest [-]")
        panel.set_xlim(-0.6, len(places) - 0.4)
        panel.set_xticks(places, [shown_name(name, 16) for name in found.cases], rotation=30, ha="right")
        panel.grid(visible=False, axis="x")
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.2 + 0.03 * longest, hspace=0.1, wspace=0.1)
        legend_above(figure, handles, labels)
    return figure


def regret_words(found: Regret) -> FigureWords:
    """Return the words of `drawn_regret`."""
    worst = ", ".join(
        f"{name} {significant(100 * one.estimate, 2)} %" for name, one in zip(found.filters, found.worst, strict=True)
    )
    return FigureWords(
        "Position RMS of each filter over the smallest of any filter in the same case, 1 + regret, with intervals that "
        "hold together at 95 %. Filters are told of the nominal case only. A triangle at the upper edge: a run failed. "
        "A line that meets the upper edge goes on beyond it.",
        f"RMS of each filter over the smallest in the nominal case and under each stress. Worst regret: {worst}.",
    )
