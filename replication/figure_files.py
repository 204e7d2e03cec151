"""Figures of a replication to files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.plots.style import png

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save(folder: Path, name: str, figure: Figure) -> str:
    """Write a figure as PNG; return its name."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.png").write_bytes(png(figure))
    return name
