"""Figures to files, and into the page as data URIs."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CSS_PIXELS_PER_INCH = 160


@dataclass(frozen=True)
class Picture:
    """A figure of the page: ``name`` is its file's, sizes are CSS pixels; without ``data_uri`` it is only linked.

    ``filter`` is the one filter it shows, empty where it shows several.
    """

    name: str
    caption: str
    alt: str
    width: int
    height: int
    data_uri: str
    filter: str = ""


def draw(folder: Path, name: str, figure: Figure, caption: str, alt: str, filter: str = "") -> Picture:
    """Write a figure as PNG and PDF, and return it for the page.

    The page gets the same pixels as lossless WebP, a quarter to two fifths smaller than the PNG. The SVG would be 4 to
    8 times as large (262 kB against 57 kB for six error panels), most of it coordinates and outlines of letters.
    """
    png = style.png(figure)
    (folder / f"{name}.png").write_bytes(png)
    (folder / f"{name}.pdf").write_bytes(style.pdf(figure))
    width, height = (round(size * _CSS_PIXELS_PER_INCH) for size in figure.get_size_inches())
    uri = f"data:image/webp;base64,{base64.b64encode(style.webp(png)).decode('ascii')}"
    return Picture(name, caption, alt, width, height, uri, filter)


def within(pictures: Iterable[Picture], most_bytes: int) -> tuple[tuple[Picture, ...], int]:
    """Return the pictures, the ones that no longer fit only linked, and how many bytes are left."""
    kept = []
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
