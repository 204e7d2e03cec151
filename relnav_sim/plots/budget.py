"""The error budget over time: total, formal and actual sigma, and the share of each source as stacked areas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.data import drawn_step
from relnav_sim.plots.panels import log_axis, time_axis, time_unit
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.style import (
    FAINT,
    FORMAL,
    INK,
    PALETTE,
    house_style,
    key,
    legend_above,
    legend_height,
    margins,
    shown_name,
)
from relnav_sim.plots.words import FigureWords
from relnav_sim.wording import significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_AREAS = len(PALETTE)
"""Sources with an area of their own; the others share one."""
_ACTUAL = PALETTE[1]


@dataclass(frozen=True)
class BudgetCurves:
    """The position's variances of an error budget, over time.

    Attributes:
        filter: The filter's name.
        times_s: Epochs (T,), s.
        areas: Variance by source, (T,) each, m^2; none is negative, and they add up to the total.
        formal: What the filter states, (T,), m^2.
        actual: Times and RMS error of a Monte Carlo, (K,) s and m; None: there is none.
        ends_s: Where phases end, s.
    """

    filter: str
    times_s: Array
    areas: Mapping[str, Array]
    formal: Array
    actual: tuple[Array, Array] | None = None
    ends_s: Sequence[float] = ()

    @property
    def total(self) -> Array:
        """The sum of the areas, (T,)."""
        return np.sum(list(self.areas.values()), axis=0)

    @property
    def shares(self) -> dict[str, float]:
        """The share of each source in the variance, on average over time, the largest first."""
        total = np.maximum(self.total, np.finfo(float).tiny)
        found = {name: float((part / total).mean()) for name, part in self.areas.items()}
        return dict(sorted(found.items(), key=lambda item: -item[1]))


def error_budget_over_time(curves: BudgetCurves) -> Figure:
    """Draw an error budget against time: sigmas above, and below the share of each source in the variance.

    The largest sources have an area each, the others one together. Thin lines are the ends of phases.

    Args:
        curves: The budget.
    """
    rows = slice(None, None, drawn_step(len(curves.times_s)))
    unit, length = time_unit(curves.times_s)
    times, total = curves.times_s[rows] / length, np.maximum(curves.total[rows], np.finfo(float).tiny)
    largest = list(curves.shares)
    names = largest if len(largest) <= MOST_AREAS else largest[: MOST_AREAS - 1]
    parts = [curves.areas[name][rows] / total for name in names]
    labels, colours = [shown_name(name, 38) for name in names], list(PALETTE[: len(names)])
    if len(names) < len(largest):
        parts.append(1 - np.sum(parts, axis=0))
        labels, colours = [*labels, f"{len(largest) - len(names)} others"], [*colours, FAINT]
    lines = ["budget", "formal"] + ["actual"] * (curves.actual is not None)
    keys: list[Any] = [key(INK, "-", 1.4), key(FORMAL, ":", 1.2), key(_ACTUAL, (0, (5, 1.5)), 1.0)][: len(lines)]
    with house_style():
        height = 2.9 + legend_height([*lines, *labels])
        figure, ((sigma,), (share,)) = figure_with_panels("budget", height, 2, sharex=True)
        sigma.plot(times, np.sqrt(total), color=INK, linewidth=1.4)
        sigma.plot(times, np.sqrt(curves.formal[rows]), color=FORMAL, linestyle=":", linewidth=1.2)
        if curves.actual is not None:
            at, rms = curves.actual
            sigma.plot(at / length, rms, color=_ACTUAL, linestyle=(0, (5, 1.5)), linewidth=1.0)
        log_axis(sigma, "y")
        sigma.set_ylabel("position sigma [m]")
        share.stackplot(times, 100 * np.array(parts), colors=colours, linewidth=0)
        share.set_ylim(0, 100)
        share.set_ylabel("variance [%]")
        for end in curves.ends_s:
            for panel in (sigma, share):
                panel.axvline(end / length, color=INK, linewidth=0.4, linestyle=(0, (2, 2)))
        time_axis(share, times, unit)
        margins(figure, 0.55, 0.16, 0.08 + legend_height([*lines, *labels]), 0.36, hspace=0.12, wspace=0.1)
        keys += [key(colour, "-", 4.0) for colour in colours]
        legend_above(figure, keys, [*lines, *labels])
    return figure


def error_budget_words(curves: BudgetCurves) -> FigureWords:
    """Return the words of `error_budget_over_time`."""
    largest = ", ".join(f"{name} {significant(100 * share)} %" for name, share in list(curves.shares.items())[:4])
    actual = "; actual: RMS error over the runs" if curves.actual is not None else ""
    return FigureWords(
        f"Error budget of {curves.filter}. Above: position sigma of the budget; formal: of the filter itself{actual}. "
        "Below: share of each source in the variance of the budget; errors that are the same in every run are one "
        "source. Thin lines: ends of phases.",
        f"Two panels against time, sigmas on a logarithmic axis and stacked shares. On average over time: {largest}.",
    )
