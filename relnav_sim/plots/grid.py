"""The RMS error over a grid of two varied parameters, in colours and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.plots.data import Case, leading_filter, speed_unit
from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.plots.panels import say
from relnav_sim.plots.style import house_style, margins, new_figure, shown_name
from relnav_sim.plots.sweep_points import Leaf, grid_paths, varied_paths
from relnav_sim.plots.sweeps import Quantity, axis_label
from relnav_sim.plots.words import FigureWords

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_LOG_FROM_RATIO = 8.0
_MOST_NUMBERS = 13


def heat_map(
    results: Results,
    filter: str | None = None,
    along: Sequence[str] | None = None,
    quantity: Quantity = "position",
    cases: Sequence[Case] | None = None,
) -> Figure:
    """Draw the RMS error over a grid of two varied parameters, in colours and numbers.

    Args:
        results: An opened result.
        filter: The filter; default: the best one of each cell, whose name stands in it.
        along: The two paths, or their ends: horizontal, then vertical; default: the two with the most values. Of
            cases that differ in a third value the first counts.
        quantity: ``position`` or ``velocity``.
        cases: The cases; default: all.
    """
    from matplotlib.colors import LogNorm, Normalize

    across, up = grid_paths(results, along)
    varied = varied_paths(results)
    columns, rows = (_in_order(varied[path]) for path in (across, up))
    values = np.full((len(rows), len(columns)), np.nan)
    names = [[""] * len(columns) for _ in rows]
    for case in results.nominal if cases is None else cases:
        facts = case_facts(results, case)
        index = facts.index
        row, column = rows.index(varied[up][index]), columns.index(varied[across][index])
        if not facts.filters or np.isfinite(values[row, column]):
            continue
        name = filter or leading_filter(facts)
        if name not in facts.names:
            continue
        values[row, column] = facts.filter(name).mean_rms(facts.span, "r" if quantity == "position" else "v")
        names[row][column] = name
    factor, unit = (1.0, "m") if quantity == "position" else speed_unit(float(np.nanmax(values, initial=0.0)))
    values *= factor
    known = values[np.isfinite(values)]
    with house_style():
        figure = new_figure(max(1.6, 1.0 + 0.36 * len(rows)))
        panel = figure.subplots()
        if not known.size:
            say(panel, "no completed run")
            return figure
        norm = LogNorm if known.min() > 0 and known.max() > _LOG_FROM_RATIO * known.min() else Normalize
        low, high = float(known.min()), float(max(known.max(), known.min() * (1 + 1e-9)))
        colour_scale = norm(low, high)
        panel.imshow(values, origin="lower", aspect="auto", cmap="viridis", norm=colour_scale)
        for row, column in np.ndindex(values.shape) if values.size <= _MOST_NUMBERS**2 else ():
            if np.isfinite(values[row, column]):
                dark = float(colour_scale(float(values[row, column]))) < 0.55
                text = f"{values[row, column]:.3g}"
                text += f"\n{shown_name(names[row][column], 9)}" if filter is None and len(columns) <= 7 else ""
                panel.text(column, row, text, ha="center", va="center", fontsize=6, color="white" if dark else "black")
        panel.set_xticks(range(len(columns)), [_tick(value) for value in columns])
        panel.set_yticks(range(len(rows)), [_tick(value) for value in rows])
        panel.grid(visible=False)
        panel.set_xlabel(axis_label(across))
        panel.set_ylabel(axis_label(up))
        title = f"{'best filter' if filter is None else shown_name(filter)}, {quantity} RMS [{unit}]"
        panel.set_title(title, loc="left", pad=2.0, y=1.0)
        left = 0.42 + 0.055 * max(len(_tick(value)) for value in rows)
        margins(figure, left, 0.12, 0.2, 0.36, hspace=0.1, wspace=0.1)
    return figure


def heat_map_words(case: CaseFacts, along: Sequence[str]) -> FigureWords:
    """Return the words of `heat_map`."""
    return FigureWords(
        f"Position RMS ({case.when}) of the best filter of each cell over {along[0]} and {along[1]}.",
        f"Heat map of the smallest position RMS over {along[0]} and {along[1]}; the overview table has the values.",
    )


def _in_order(values: Sequence[Leaf]) -> list[Leaf]:
    found = list(dict.fromkeys(values))
    return sorted(found, key=float) if all(isinstance(value, float) for value in found) else found


def _tick(value: Leaf) -> str:
    return f"{value:g}" if isinstance(value, float) else shown_name(value, 12)
