"""A figure that keeps the house style when the caller draws or saves it, long after it was made."""

from __future__ import annotations

from typing import Any

from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from relnav_sim.plots.style import house_style


class HouseFigure(Figure):
    """A figure on the Agg canvas. Ticks and their numbers are made while drawing, from the settings of that moment."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        FigureCanvasAgg(self)
        self.layout: tuple[str, int, int] | None = None
        """Its kind, rows and columns of panels, where it may be drawn over; see `spare_figures`."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw in the house style."""
        with house_style():
            super().draw(renderer)

    def savefig(self, *args: Any, **kwargs: Any) -> None:
        """Save in the house style; see ``matplotlib.figure.Figure.savefig``."""
        with house_style():
            super().savefig(*args, **kwargs)
