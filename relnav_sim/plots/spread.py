"""How the runs of each filter spread: box plots and violins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.data import Case, chosen_filters, facts_of, speed_unit
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.panels import boxes, violins
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.style import INK, house_style, line_styles, margins, shown_name
from relnav_sim.plots.words import FigureWords, left_out
from relnav_sim.wording import counted, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_Paint = Callable[["Panel", Sequence[Array], Sequence[str]], None]


def box_plots(results: Results, case: Case = 0, filters: Sequence[str] | None = None) -> Figure:
    """Draw how the runs of each filter spread: position and velocity RMS, ANEES and convergence time.

    Boxes hold the middle half of the runs with the median as a line, whiskers reach 1.5 box lengths; up to
    60 runs also show as dots.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
    """
    return _spread(facts_of(results, case), filters, boxes)


def boxes_words(case: CaseFacts) -> FigureWords:
    """Return the words of `box_plots`."""
    text = (
        f"Spread over runs, one value per run (RMS and ANEES: {case.when}). Box: middle half of the runs; line: "
        "median; whiskers: up to 1.5 box lengths; dots: single runs. Dashed: ANEES of a consistent filter."
    )
    never = [f"{item.name} {item.never_converged} of {item.completed}" for item in case.filters if item.never_converged]
    parts = [f"Never converged, not drawn: {', '.join(never)}."] if never else []
    parts = parts if case.shows_convergence else [case.not_judged]
    medians = [
        f"{item.name} {significant(float(np.median(item.errors('rms', case.span, 'r')[item.ok])))} m"
        for item in case.by_accuracy
    ]
    return FigureWords(
        " ".join([text, *parts, *left_out(case.filters)]),
        "Box plots over runs of position RMS, velocity RMS, ANEES and convergence time for "
        f"{counted(len(medians), 'filter')}. Median position RMS: {', '.join(medians)}.",
    )


def violin_plots(results: Results, case: Case = 0, filters: Sequence[str] | None = None) -> Figure:
    """Draw the figures of `box_plots` as densities over runs (Gaussian kernel, Scott's width) with their quartiles.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
    """
    return _spread(facts_of(results, case), filters, violins)


def _spread(facts: CaseFacts, filters: Sequence[str] | None, paint: _Paint) -> Figure:
    items = chosen_filters(facts, filters)
    speeds = [np.where(item.ok, item.errors("rms", facts.span, "v"), np.nan) for item in items]
    factor, unit = speed_unit(float(np.nanmax(np.concatenate([*speeds, np.zeros(1)]))))
    columns = (
        ("position RMS [m]", [item.errors("rms", facts.span, "r") for item in items]),
        (f"velocity RMS [{unit}]", [factor * values for values in speeds]),
        ("ANEES [-]", [item.consistency("anees", facts.span) for item in items]),
        ("convergence time [s]", [item.convergence_s for item in items]),
    )
    styles = line_styles(facts.all_filters)
    names = [shown_name(item.name, 14) for item in items]
    with house_style():
        figure, panels = figure_with_panels("spread", 1.1 + 2 * max(0.45, 0.2 * len(names)), 2, 2, sharey=True)
        for panel, (label, values) in zip(panels.flat, columns, strict=True):
            finite = [found[item.ok & np.isfinite(found)] for item, found in zip(items, values, strict=True)]
            if label.startswith("ANEES"):
                panel.axvline(1.0, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
            paint(panel, finite, [styles[item.name].colour for item in items])
            panel.set_xlabel(label)
        panels[0, 0].set_yticks(range(len(names)), names)
        panels[0, 0].set_ylim(len(names) - 0.5, -0.5)
        left = 0.2 + 0.06 * max((len(name) for name in names), default=0)
        margins(figure, left, 0.14, 0.08, 0.36, hspace=0.52, wspace=0.16)
    return figure
