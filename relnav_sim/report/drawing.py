"""Figures to files, and into the page as data URIs."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.plots import style
from relnav_sim.plots.spare_figures import draw_over
from relnav_sim.report.attempts import attempted
from relnav_sim.results.atomic import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CSS_PIXELS_PER_INCH = 160
_MARKUP = 400  # bytes of a figure in the page but for its pixels and words, definitions of terms included


@dataclass(frozen=True)
class FigureFolder:
    """Where the figures' files go, an existing folder, and whether each is written as PDF too."""

    path: Path
    vectors: bool


@dataclass(frozen=True)
class Picture:
    """A figure of the page: ``name`` is its files', sizes are CSS pixels; without ``data_uri`` it is only linked.

    ``forms`` are the endings of its files. ``filter`` is the one filter it shows, empty where it shows several;
    ``missing`` says why there is no figure.
    """

    name: str
    caption: str
    alt: str
    width: int
    height: int
    data_uri: str
    forms: tuple[str, ...]
    filter: str = ""
    missing: str = ""


@dataclass(frozen=True)
class Drawing:
    """A figure with its words."""

    figure: Figure
    caption: str
    alt: str


def draw(folder: FigureFolder, name: str, make: Callable[[], Drawing | None], filter: str = "") -> Picture | None:
    """Draw a figure, write it as PNG, and as PDF where that is wanted, and return it for the page.

    The page gets the same bytes. As lossless WebP they would be an eighth fewer, for a tenth of the time that a figure
    takes; as SVG 4 to 8 times as many, most of them coordinates and outlines of letters.

    Args:
        folder: Where the files go; those of an earlier report that are not written again are removed.
        name: Their name without its ending.
        make: Makes the figure; None: there is nothing to show.
        filter: The one filter it shows.

    Returns:
        None where there is nothing to show; where the figure can't be drawn, a picture that says why.
    """

    def picture() -> Picture | None:
        with style.house_style():
            drawing = make()
            if drawing is None:
                return None
            png = style.png(drawing.figure)
            _write(files["png"], png)
            if folder.vectors:
                _write(files["pdf"], style.pdf(drawing.figure))
            else:
                files["pdf"].unlink(missing_ok=True)
        width, height = (round(size * _CSS_PIXELS_PER_INCH) for size in drawing.figure.get_size_inches())
        draw_over(drawing.figure)
        uri = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
        return Picture(name, drawing.caption, drawing.alt, width, height, uri, forms, filter)

    files = {form: folder.path / f"{name}.{form}" for form in ("png", "pdf")}
    forms = ("png", "pdf") if folder.vectors else ("png",)
    missing: list[str] = []
    made = attempted(f"The figure {name}", picture, missing)
    if not missing:
        return made
    for file in files.values():
        file.unlink(missing_ok=True)  # an earlier report's would pass for this one's
    return Picture(name, "", "", 0, 0, "", (), filter, missing[0])


def _write(file: Path, content: bytes) -> None:
    with written_whole(file, synced=False) as temporary:
        temporary.write_bytes(content)


def within(pictures: Iterable[Picture], most_bytes: int) -> tuple[tuple[Picture, ...], int]:
    """Return the pictures, the ones that no longer fit only linked, and how many bytes are left."""
    pictures, kept = list(pictures), []
    most_bytes -= sum(len(picture.caption.encode()) + len(picture.alt.encode()) + _MARKUP for picture in pictures)
    for picture in pictures:
        if len(picture.data_uri) > most_bytes:
            kept.append(replace(picture, data_uri=""))
        else:
            most_bytes -= len(picture.data_uri)
            kept.append(picture)
    return tuple(kept), most_bytes


def file_name(text: str, number: int) -> str:
    """Return a name as part of a file's name; ``number`` keeps names apart that had to be changed."""
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", text)[:60]
    return safe if safe == text else f"{safe}_{number}"
