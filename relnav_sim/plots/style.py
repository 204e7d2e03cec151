"""One look for every figure: sizes, fonts, colours, and how a figure becomes a file.

A figure is as wide as one column of a two-column page (89 mm), with 7 to 8 pt type at that size, so that
it drops into an article or half a page of a review unscaled and is still readable on a telephone. Figures
are ``matplotlib.figure.Figure`` objects on the Agg canvas: no window, no pyplot state.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relnav_sim.plots.isolation import isolated
from relnav_sim.printable import visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.plots.house_figure import HouseFigure

WIDTH_INCH = 3.5
PNG_DPI = 200
_PNG_COLOURS = 64
_LABEL_INCH = 0.16  # height of an axis label and its distance from the figure's edge

# Okabe and Ito (2008), without its yellow, too pale on white paper, and its black, which is the bound's; the last
# is the indigo of Tol (2021).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#332288")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)))
_MARKERS = "os^Dv<>"
_MARKS = 7  # shapes on a line over time
INK = "#222222"
FAINT = "#8a8a8a"
BAND = "#c9ccd1"  # spread over runs, chi-square bands
OUTAGE = "#f6d9cf"  # times without measurements
FORMAL = "#555555"  # formal sigma, where a filter's own colour is taken by its errors
BOUND = "#000000"
PERFECT_DASHES, OWN_DASHES = "-.", ":"  # of the bound of a perfect model, of the filter's own

_SETTINGS: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 7.5,
    "axes.labelsize": 7.5,
    "axes.labelpad": 2.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.useoffset": False,
    "grid.linewidth": 0.4,
    "grid.color": "#dddddd",
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.0,
    "lines.linewidth": 1.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 1.5,
    "ytick.minor.size": 1.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "path.simplify_threshold": 0.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "relnav",
}


@dataclass(frozen=True)
class LineStyle:
    """How the lines and boxes of one filter are drawn."""

    colour: str
    dashes: Any


def line_styles(filters: Sequence[str]) -> dict[str, LineStyle]:
    """Return one style per filter, the same in every figure; colours repeat with other dashes."""
    return {
        name: LineStyle(PALETTE[index % len(PALETTE)], _DASHES[index // len(PALETTE) % len(_DASHES)])
        for index, name in enumerate(filters)
    }


def marker(filters: Sequence[str], name: str) -> str:
    """Return the shape of one filter's points, the same in every figure; no two have the same in the same colour."""
    index = filters.index(name)
    return _MARKERS[(index + index // len(PALETTE)) % len(_MARKERS)]


def marks(filters: Sequence[str], name: str, points: int) -> dict[str, Any]:
    """Return the options that put a filter's shape on its line here and there, so that it is known without colours.

    Each filter's shapes stand at epochs of their own: on lines that coincide all of them show.

    Args:
        filters: All filters, in the order of the result.
        name: The filter.
        points: How many points its line has.
    """
    every = max(1, points // _MARKS)
    start = every * (2 * filters.index(name) + 1) // (2 * len(filters))
    return {"marker": marker(filters, name), "markevery": (start, every), "markersize": 3.2, "markeredgewidth": 0}


def filter_key(filters: Sequence[str], name: str) -> Any:
    """Return the line of a filter for a legend, with its colour, dashes and shape."""
    look = line_styles(filters)[name]
    handle = key(look.colour, look.dashes, 1.2)
    handle.set(marker=marker(filters, name), markersize=3.2, markeredgewidth=0)
    return handle


def nested_width(place: int, count: int, widest: float = 2.4) -> float:
    """Return a line width: lines that coincide stay visible where each is thinner than the one below it."""
    return widest - (widest - 0.9) * place / max(1, count - 1)


def key(colour: str, dashes: Any, width: float) -> Any:
    """Return a line for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, linestyle=dashes, linewidth=width)


def house_style(more: Mapping[str, Any] | None = None) -> AbstractContextManager[None]:
    """Draw and save in the house style whatever the caller's matplotlib settings say, and leave those as they were.

    Args:
        more: Further ``rcParams``.
    """
    return isolated({**_SETTINGS, **(more or {})})


def new_figure(height_inch: float, width_inch: float = WIDTH_INCH) -> HouseFigure:
    """Return an empty figure on the Agg canvas; call inside ``house_style``."""
    from relnav_sim.plots.house_figure import HouseFigure

    return HouseFigure(figsize=(width_inch, height_inch), facecolor="white")


def margins(figure: Figure, left: float, right: float, top: float, bottom: float, hspace: float, wspace: float) -> None:
    """Set the margins, the gaps between panels and the places of the labels, in inches.

    Far quicker than a layout engine, and panels of different figures line up.
    """
    width, height = figure.get_size_inches()
    rows = columns = 1
    if figure.axes and (grid := figure.axes[0].get_gridspec()) is not None:
        rows, columns = grid.nrows, grid.ncols
    panel_width = (width - left - right - (columns - 1) * wspace) / columns
    panel_height = (height - top - bottom - (rows - 1) * hspace) / rows
    figure.subplots_adjust(
        left=left / width,
        right=1 - right / width,
        top=1 - top / height,
        bottom=bottom / height,
        hspace=hspace / panel_height,
        wspace=wspace / panel_width,
    )
    # Labels at fixed places stand in line without the layout passes that find such places.
    for panel in figure.axes:
        panel.yaxis.set_label_coords((_LABEL_INCH - left) / panel_width, 0.5)
        panel.xaxis.set_label_coords(0.5, (_LABEL_INCH - bottom) / panel_height)


def legend_above(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Put the legend over the panels, where no data are."""
    top = 1.0 - 0.03 / float(figure.get_size_inches()[1])
    figure.legend(handles, labels, loc="upper center", ncols=legend_columns(labels), bbox_to_anchor=(0.5, top))


def legend_columns(labels: Sequence[str]) -> int:
    """Return how many of the labels fit side by side over a figure."""
    room = WIDTH_INCH - 0.1
    for columns in range(len(labels), 1, -1):
        widths = [max(map(len, labels[start::columns])) * 0.053 + 0.4 for start in range(columns)]
        if sum(widths) <= room:
            return columns
    return 1


def legend_height(labels: Sequence[str]) -> float:
    """Return the height in inches that ``legend_above`` takes."""
    rows = -(-len(labels) // legend_columns(labels))
    return 0.06 + 0.145 * rows


def shown_name(name: str, longest: int = 22) -> str:
    """Return a name as figure text: shortened, all signs visible, and a dollar sign is no formula."""
    name = visible(name)
    short = name if len(name) <= longest else name[: longest - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return short.replace("$", r"\$")


def png(figure: Figure) -> bytes:
    """Return the figure as PNG, reduced to a small palette: half the size, no visible loss."""
    from PIL import Image

    canvas: Any = figure.canvas  # Agg, see new_figure; its methods have no annotations
    with house_style():
        figure.set_dpi(PNG_DPI)
        canvas.draw()
    picture = Image.frombytes("RGB", canvas.get_width_height(), canvas.buffer_rgba(), "raw", "RGBX")
    file = io.BytesIO()
    reduced = picture.quantize(_PNG_COLOURS, method=Image.Quantize.FASTOCTREE)
    reduced.save(file, format="png", dpi=(PNG_DPI, PNG_DPI))
    return file.getvalue()


def pdf(figure: Figure) -> bytes:
    """Return the figure as vector PDF, without a date: the same result gives the same bytes."""
    return _saved(figure, "pdf", {"CreationDate": None})


def svg(figure: Figure) -> bytes:
    """Return the figure as SVG with letters as text, without a date."""
    return _saved(figure, "svg", {"Date": None})


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure to a file; the name's ending says whether PDF, SVG or PNG.

    A PDF gets TrueType letters, which publishers ask for; cutting them out of the font takes half a second, so that
    the many figures of a report have Type 3 letters instead.
    """
    from relnav_sim.results.atomic import written_whole

    with house_style({"pdf.fonttype": 42}):
        data = {".pdf": pdf, ".svg": svg, ".png": png}[path.suffix](figure)
    with written_whole(path) as temporary:
        temporary.write_bytes(data)


def _saved(figure: Figure, form: str, metadata: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    with house_style():
        figure.savefig(file, format=form, metadata=metadata, dpi=PNG_DPI)
    return file.getvalue()
