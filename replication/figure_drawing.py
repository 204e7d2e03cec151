"""The papers' figures, ours: one run as they show it, and the spread of all runs that they don't."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.axes import turned_sigmas, turned_states
from relnav_sim.plots.style import PALETTE, house_style, legend_above, legend_height, margins, new_figure
from replication.measured import Measured

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDE = 7.0
_AXES = ("x", "y", "z")


def error_curves(
    measured: Measured,
    campaign: str,
    filters: Mapping[str, str],
    velocity: bool,
    reach: Sequence[float] | None = None,
) -> Figure:
    """Return the errors of run 0 and the 95 % spread of all runs, an axis a row, in the paper's axes.

    Args:
        measured: What the campaigns found.
        campaign: Name of the campaign.
        filters: Label of the figure by filter of the campaign.
        velocity: Velocity errors; else position errors.
        reach: Half heights of the panels; default: what holds the spread of the steady state.
    """
    time, curves = measured.curves(campaign, 0, "errors")
    columns = slice(3, 6) if velocity else slice(0, 3)
    unit = "m/s" if velocity else "m"
    with house_style():
        figure = new_figure(4.2 + legend_height(list(filters.values())), _WIDE)
        panels = figure.subplots(3, len(filters), sharex=True, sharey="row", squeeze=False)
        for column, (filter, label) in enumerate(filters.items()):
            first, one, other = (
                turned_states(curves[filter][key], "shi2025")[:, columns] for key in ("first", "low", "high")
            )
            low, high = np.minimum(one, other), np.maximum(one, other)  # an axis that is turned round swaps them
            for row in range(3):
                panel = panels[row][column]
                panel.fill_between(time, low[:, row], high[:, row], color="#c9ccd1", linewidth=0)
                panel.plot(time, first[:, row], color=PALETTE[0], linewidth=0.5)
                if column == 0:
                    panel.set_ylabel(f"{'v' if velocity else ''}{_AXES[row]} error [{unit}]")
                if row == 0:
                    panel.set_title(label)
                settled = slice(len(low) // 10, None)
                half = reach[row] if reach else 1.25 * float(np.abs([low[settled, row], high[settled, row]]).max())
                bottom, top = panel.get_ylim() if column else (-half, half)
                panel.set_ylim(min(bottom, -half), max(top, half))
        for panel in panels[-1]:
            panel.set_xlabel("time [s]")
        margins(figure, left=0.55, right=0.1, top=0.25, bottom=0.4, hspace=0.12, wspace=0.15)
    return figure


def sigma_curves(measured: Measured, campaign: str, filters: Mapping[str, str]) -> Figure:
    """Return the formal standard deviations (roots of P's diagonal), position left, velocity right."""
    time, curves = measured.curves(campaign, 0, "sigmas")
    with house_style():
        names = [f"{label}, {axis}" for axis in _AXES for label in filters.values()]
        figure = new_figure(2.4 + legend_height(names), _WIDE)
        panels = figure.subplots(1, 2)
        for index, (filter, label) in enumerate(filters.items()):
            sigma = turned_sigmas(curves[filter]["sigma"], "shi2025")
            for panel, columns in zip(panels, (slice(0, 3), slice(3, 6)), strict=True):
                for axis, dashes in zip(range(3), ("-", (0, (5, 1.5)), (0, (1, 1))), strict=True):
                    panel.semilogy(
                        time,
                        sigma[:, columns][:, axis],
                        color=PALETTE[index],
                        linestyle=dashes,
                        linewidth=0.9,
                        label=f"{label}, {_AXES[axis]}",
                    )
        panels[0].set_ylabel("position sigma [m]")
        panels[1].set_ylabel("velocity sigma [m/s]")
        handles, labels = panels[0].get_legend_handles_labels()
        legend_above(figure, handles, labels)
        for panel in panels:
            panel.set_xlabel("time [s]")
        margins(figure, 0.55, 0.1, 0.1 + legend_height(names), 0.4, 0.1, 0.55)
    return figure


def alpha_boxes(measured: Measured, campaign: str, filters: Mapping[str, str], paper: Mapping[str, Any]) -> Figure:
    """Return box plots over time and runs of position and velocity error, by alpha, with the published means.

    Whiskers reach the last values within 1.5 interquartile ranges of the box; dots are outliers, thinned out evenly.
    """
    _, curves = measured.curves(campaign, 0, "boxes")
    with house_style():
        figure = new_figure(2.8, _WIDE)
        panels = figure.subplots(1, 2)
        for panel, key, quantity, unit in ((panels[0], "r", "position", "m"), (panels[1], "v", "velocity", "m/s")):
            boxes = []
            for filter in filters:
                least, low, middle, high, most = curves[filter][key]
                boxes.append(
                    {
                        "whislo": least,
                        "q1": low,
                        "med": middle,
                        "q3": high,
                        "whishi": most,
                        "fliers": curves[filter][f"{key}_outliers"],
                    }
                )
            panel.bxp(
                boxes,
                widths=0.55,
                medianprops={"color": PALETTE[1]},
                boxprops={"color": PALETTE[0]},
                whiskerprops={"linewidth": 0.6},
                flierprops={"marker": ".", "markersize": 2, "markeredgecolor": PALETTE[3]},
            )
            places = np.arange(1, len(filters) + 1)
            panel.plot(places, paper[quantity], "k^", markersize=3.5, label="mean in the paper's Table 4")
            panel.set_xticks(places, list(filters.values()))
            panel.set_xlabel("alpha")
            panel.set_ylabel(f"{quantity} error [{unit}]")
            panel.set_ylim(bottom=0)
        panels[0].legend(loc="upper right")
        margins(figure, left=0.5, right=0.1, top=0.1, bottom=0.4, hspace=0.1, wspace=0.5)
    return figure


def alpha_trend(curves: Sequence[Mapping[str, Any]]) -> Figure:
    """Return mean and standard deviation against alpha: position and velocity, the paper's beside ours.

    Args:
        curves: For each line ``label``, ``alpha`` (k,), and by panel name (``r mean`` and so on) the values (k,) with
            optional ``low`` and ``high`` (dicts of the same names).
    """
    names = ("r mean", "r std", "v mean", "v std")
    with house_style():
        labels = [curve["label"] for curve in curves]
        figure = new_figure(3.9 + legend_height(labels), _WIDE)
        panels = figure.subplots(2, 2, sharex=True)
        handles: list[Any] = []
        for index, curve in enumerate(curves):
            for panel, name in zip(panels.flat, names, strict=True):
                (line,) = panel.semilogx(
                    curve["alpha"],
                    curve[name],
                    color="#000000" if index == 0 else PALETTE[index - 1],
                    marker="^" if index == 0 else "o",
                    markersize=3,
                )
                if "low" in curve:
                    panel.fill_between(
                        curve["alpha"], curve["low"][name], curve["high"][name], color=line.get_color(), alpha=0.2
                    )
            handles.append(line)
        for panel, name in zip(panels.flat, names, strict=True):
            panel.set_ylabel(f"{name} [{'m' if name[0] == 'r' else 'm/s'}]")
            panel.set_ylim(0, 1.15 * max(np.nanmax(curve[name]) for curve in curves))
        for panel in panels[-1]:
            panel.set_xlabel("alpha")
        legend_above(figure, handles, labels)
        margins(figure, 0.55, 0.1, 0.1 + legend_height(labels), 0.4, 0.15, 0.6)
    return figure


def error_norms(
    places: Sequence[tuple[str, Array, Mapping[str, Array]]],
    velocity: bool,
    level: float | None = None,
) -> Figure:
    """Return |error| over time, median over runs with the 90 % spread, on a logarithmic axis.

    Args:
        places: For each line its label, epochs (K,) and curves, as `Measured.curves` has them.
        velocity: Velocity error; else position error.
        level: The published level, drawn as a line.
    """
    key = "v" if velocity else "r"
    with house_style():
        labels = [label for label, _, _ in places]
        figure = new_figure(2.6 + legend_height(labels), _WIDE)
        panel = figure.subplots()
        handles: list[Any] = []
        for index, (_, time, curve) in enumerate(places):
            colour = PALETTE[index % len(PALETTE)]
            panel.fill_between(time, curve[f"{key}_low"], curve[f"{key}_high"], color=colour, alpha=0.15, linewidth=0)
            handles += panel.semilogy(time, curve[f"{key}_median"], color=colour, linewidth=0.9)
        if level is not None:
            handles.append(panel.axhline(level, color="k", linestyle="--", linewidth=0.8))
            labels = [*labels, "published"]
        panel.set_yscale("log")
        panel.set_xlabel("time [s]")
        panel.set_ylabel("velocity error [m/s]" if velocity else "position error [m]")
        legend_above(figure, handles, labels)
        margins(figure, 0.6, 0.1, 0.1 + legend_height(labels), 0.4, 0.1, 0.1)
    return figure


def orbit_plane(measured: Measured, campaign: str, filters: Mapping[str, str]) -> Figure:
    """Return the relative path in the orbit plane (run 0), whole and magnified about its last tenth."""
    _, curves = measured.curves(campaign, 0, "plane")
    with house_style():
        labels = ["truth", *filters.values()]
        figure = new_figure(2.9 + legend_height(labels), _WIDE)
        panels = figure.subplots(1, 2)
        handles: list[Any] = []
        for index, filter in enumerate(filters):
            truth, track = curves[filter]["truth"], curves[filter]["estimate"]
            for panel in panels:
                (line,) = panel.plot(track[:, 1], track[:, 0], color=PALETTE[index % len(PALETTE)], linewidth=0.8)
            handles.append(line)
        for panel in panels:
            (line,) = panel.plot(truth[:, 1], truth[:, 0], color="k", linewidth=0.8, linestyle="--")
            panel.set_xlabel("along-track y [m]")
        centre = truth[-len(truth) // 10]
        panels[1].set_xlim(centre[1] - 2, centre[1] + 2)
        panels[1].set_ylim(centre[0] - 2, centre[0] + 2)
        panels[1].locator_params(nbins=5)
        panels[0].set_ylabel("radial x [m]")
        legend_above(figure, [line, *handles], labels)
        margins(figure, 0.6, 0.1, 0.1 + legend_height(labels), 0.4, 0.1, 0.6)
    return figure
