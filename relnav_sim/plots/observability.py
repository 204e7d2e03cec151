"""Observability over time: the share of the start's sigma that measurements leave in the least observable direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from relnav_sim.plots.data import Case, FigureError, chosen_filters, facts_of, window
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import log_axis, time_axis
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.style import (
    FORMAL,
    INK,
    house_style,
    key,
    legend_above,
    legend_height,
    line_styles,
    margins,
    shown_name,
)
from relnav_sim.plots.words import FigureWords
from relnav_sim.results.observability import NOT_OBSERVABLE, Observability
from relnav_sim.wording import listed, significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_MOST_NAMED = 3


def observability_over_time(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw posterior over prior sigma in the weakest direction against time, a line for each set of sensors and model.

    From the information of measurements so far without the start's own, scaled by the start's sigmas.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters; default: all.
        from_s: Start of the time axis, s.
        until_s: Its end, s.

    Raises:
        FigureError: The result does not say what the filters can observe.
    """
    facts = facts_of(results, case)
    view = window(facts, from_s, until_s)
    groups = alike(chosen_filters(facts, filters))
    if not groups:
        raise FigureError("the result does not say what the filters can observe: its campaign has bound: false")
    styles = line_styles(facts.all_filters)
    with house_style():
        labels = [shown_name(", ".join(names), 30) for names, _ in groups]
        figure, ((panel,),) = figure_with_panels("observability", 1.9 + legend_height(labels))
        handles = []
        for names, found in groups:
            look = styles[names[0]]
            (line,) = panel.plot(
                view.times, found.ratio[view.rows], color=look.colour, linestyle=look.dashes, linewidth=1.2
            )
            handles.append(line)
        panel.axhline(NOT_OBSERVABLE, color=FORMAL, linewidth=0.8, linestyle=(0, (1, 2)))
        panel.axhline(1.0, color=INK, linewidth=0.5)
        panel.set_ylabel("posterior / prior sigma [-]")
        log_axis(panel, "y")
        panel.set_ylim(top=1.25)
        time_axis(panel, view.times, view.unit)
        margins(figure, 0.5, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.1, wspace=0.1)
        legend_above(figure, [*handles, key(FORMAL, (0, (1, 2)), 0.8)], [*labels, f"{NOT_OBSERVABLE:g}"])
    return figure


def observability_words(case: CaseFacts) -> FigureWords:
    """Return the words of `observability_over_time`."""
    told = [
        f"{listed(names)} {significant(float(found.ratio[-1]))} ({found.weakest_at(case.times_s[-1]) or found.weakest})"
        for names, found in alike(case.filters)[:_MOST_NAMED]
    ]
    return FigureWords(
        "Posterior over prior sigma in the direction of which the measurements so far tell least, without what "
        "the start "
        f"knew. 1: nothing is told; above the dotted line at {NOT_OBSERVABLE:g} a direction is not observable. "
        f"At the end: {'; '.join(told)}.",
        f"Ratio of sigmas in the weakest direction against time, logarithmic. At the end: {'; '.join(told)}.",
    )


def alike(items: Sequence[FilterFacts]) -> list[tuple[list[str], Observability]]:
    """Return the filters of which something is known, those together of which the same is."""
    groups: list[tuple[list[str], Observability]] = []
    for item in items:
        found = item.observability
        if found is None:
            continue
        same = next((names for names, other in groups if other.agrees(found)), None)
        if same is None:
            groups.append(([item.name], found))
        else:
            same.append(item.name)
    return groups
