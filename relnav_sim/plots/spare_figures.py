"""Panels of figures that are no longer needed, drawn over: panels and ticks take half the time of a new figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

_spare: dict[tuple[str, int, int], Figure] = {}


def figure_with_panels(
    kind: str, height_inch: float, rows: int = 1, columns: int = 1, sharex: bool = False, sharey: bool = False
) -> tuple[Figure, NDArray[Any]]:
    """Return a figure with its empty panels (rows, columns): a spare one of the same kind, or a new one.

    Call inside ``house_style``.

    Args:
        kind: What the figure shows; figures of a kind give their panels the same ticks and headings.
        height_inch: Its height.
        rows: Rows of panels.
        columns: Columns of panels.
        sharex: Whether all panels share their time axis.
        sharey: Whether all panels share their other axis.
    """
    layout = (kind, rows, columns)
    figure = _spare.pop(layout, None)
    if figure is None:
        figure = new_figure(height_inch)
        figure.layout = layout
        return figure, figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False)
    figure.set_figheight(height_inch)
    for drawn in [*figure.legends, *figure.texts]:
        drawn.remove()
    for panel in figure.axes:
        _empty(panel)
    return figure, np.array(figure.axes, dtype=object).reshape(rows, columns)


def draw_over(figure: Figure) -> None:
    """Say that nobody needs a figure any more: the next of its kind is drawn over it."""
    from relnav_sim.plots.house_figure import HouseFigure  # with it comes Matplotlib, and only as `isolated` starts it

    if isinstance(figure, HouseFigure) and figure.layout is not None:
        _spare[figure.layout] = figure


def _empty(panel: Panel) -> None:
    """Make a panel as a new one is, but for its ticks and headings."""
    from matplotlib.transforms import Bbox

    for group in panel.containers.copy():
        group.remove()
    for drawn in [*panel.lines, *panel.collections, *panel.patches, *panel.texts]:
        drawn.remove()
    for axis, scale, set_scale in (
        (panel.xaxis, panel.get_xscale(), panel.set_xscale),
        (panel.yaxis, panel.get_yscale(), panel.set_yscale),
    ):
        if scale != "linear" or not axis.isDefault_majloc:
            set_scale("linear")
    panel.grid(visible=True)
    panel.margins(0.05)  # before the limits, which they would stretch
    panel.set(xlim=(0, 1), ylim=(0, 1), xlabel="", ylabel="")
    panel.dataLim.set(Bbox.null())
    panel.ignore_existing_data_limits = True
    panel.set_autoscale_on(True)
