"""Which sensor gave measurements when, and when it did not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.plots.data import Case, FigureError, chosen_filters, facts_of, window
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import heading, time_axis
from relnav_sim.plots.sensor_times import usual_gap
from relnav_sim.plots.spare_figures import figure_with_panels
from relnav_sim.plots.style import INK, OUTAGE, house_style, margins, shown_name
from relnav_sim.plots.words import FigureWords, thinned
from relnav_sim.wording import significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_OUT_BELOW = 0.5
_PANEL_INCH = 0.42


def availability_over_time(
    results: Results,
    case: Case = 0,
    filters: Sequence[str] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
) -> Figure:
    """Draw over time the share of the runs in which each sensor gave measurements, a panel each; outages shaded.

    Args:
        results: An opened result.
        case: The case.
        filters: The filters whose sensors are drawn; default: all.
        from_s: Start of the time axis, s.
        until_s: Its end, s.

    Raises:
        FigureError: The result does not tell sensors apart.
    """
    facts = facts_of(results, case)
    view = window(facts, from_s, until_s)
    shares = availability(chosen_filters(facts, filters))
    if not shares:
        raise FigureError("the result does not distinguish sensors; relnav 0.1 did not")
    with house_style():
        height = 0.45 + (_PANEL_INCH + 0.24) * len(shares)
        figure, grid = figure_with_panels("availability", height, len(shares), sharex=True)
        panels = grid[:, 0]
        for panel, (sensor, share) in zip(panels, shares.items(), strict=True):
            percent = 100 * share[view.rows]
            for begin, end in _spells(percent < 100 * _OUT_BELOW):
                panel.axvspan(view.times[max(begin - 1, 0)], view.times[end], color=OUTAGE, linewidth=0)
            panel.fill_between(view.times, 0, percent, color=f"{INK}55", linewidth=0, step="pre")
            panel.plot(view.times, percent, color=INK, linewidth=0.8, drawstyle="steps-pre")
            panel.set_ylim(0, 105)
            panel.set_yticks([0, 50, 100])
            heading(panel, shown_name(sensor))
        panels[len(panels) // 2].set_ylabel("runs [%]")
        time_axis(panels[-1], view.times, view.unit)
        margins(figure, 0.46, 0.16, 0.18, 0.36, hspace=0.24, wspace=0.1)
    return figure


def availability(items: Sequence[FilterFacts]) -> dict[str, Array]:
    """Return for each sensor of some filters the share of runs with measurements of it, at the stored epochs (K,).

    A sensor gives measurements at a stored epoch if there is one within its period, or its usual time between
    measurements where that is longer, and at the least one since the stored epoch before. The measurements are the
    sensor's: a filter that has failed does not end them.
    """
    shares: dict[str, Array] = {}
    for item in items:
        for place, sensor in enumerate(item.sensors if item.by_sensor is not None else ()):
            if sensor not in shares and item.by_sensor is not None:
                read = item.by_sensor.readings[..., place] > 0
                shares[sensor] = _share(read, item.stored_between.get(sensor, 1))
    return shares


def has_outage(case: CaseFacts) -> bool:
    """Return whether some sensor of a case gives no measurements for a while in half of the runs or more."""
    return any(bool((share < _OUT_BELOW).any()) for share in availability(case.filters).values())


def _spells(flags: Mask) -> list[tuple[int, int]]:
    """Return first and last places of each row of true flags."""
    edges = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def _share(read: Mask, period: int) -> Array:
    """Return the share over runs of (runs, K), whether anything was read since the stored epoch before.

    Args:
        read: Whether there was a measurement since the stored epoch before.
        period: How many stored epochs the sensor's period spans.
    """
    usual = int(np.ceil(usual_gap(read, period)))
    total = np.concatenate([np.zeros((len(read), 1), dtype=int), np.cumsum(read, axis=1)], axis=1)
    last = np.arange(1, total.shape[1])
    share = (total[:, last] > total[:, np.maximum(last - usual, 0)]).mean(axis=0)
    share[: usual + 1] = share[min(usual, len(share) - 1)]  # the start has no update of its own: filters begin there
    return np.asarray(share)


def availability_words(case: CaseFacts) -> FigureWords:
    """Return the words of `availability_over_time`."""
    shares = availability(case.filters)
    told = ", ".join(f"{sensor} {significant(100 * float(share.mean()))} %" for sensor, share in shares.items())
    caption = (
        "Share of the runs in which each sensor gives measurements: one within its period. "
        "Shaded: outages, where fewer than half of the runs have any."
    )
    return FigureWords(
        " ".join([caption, *thinned(case)]),
        f"A panel per sensor, the share of runs with measurements against time. Mean over time: {told}.",
    )
