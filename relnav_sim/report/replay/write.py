"""A replay to files: the page, its tables and figures, and what the filters said."""

from __future__ import annotations

from pathlib import Path

from relnav_sim.printable import visible
from relnav_sim.report.drawing import FigureFolder, Picture
from relnav_sim.report.html import render_replay
from relnav_sim.report.replay.figures_of_filters import FilterFigures
from relnav_sim.report.replay.page import ReplayPage, replay_page
from relnav_sim.report.replay.series import write_estimates, write_residuals
from relnav_sim.report.tables import comma_separated, markdown, plain_markdown
from relnav_sim.results.atomic import written_whole
from relnav_sim.simulation.replayed import Replay

PAGE = "index.html"


def write_replay(replay: Replay, filters: list[FilterFigures], folder: Path) -> Path:
    """Write the page of a replay and all that belongs to it; return the page.

    ``index.html`` opens from disk and asks for nothing from anywhere; ``replay.md`` and ``tables/*.csv`` hold the same
    tables, ``figures/`` the figures as PNG and PDF, ``estimates.csv`` and ``residuals.csv`` every epoch.

    Args:
        replay: The replay.
        filters: Its figures, from `figures_of`.
        folder: The folder; it is made.

    Raises:
        OSError: A file can't be written.
    """
    from relnav_sim import __version__

    for name in ("figures", "tables"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    page = replay_page(replay, filters, FigureFolder(folder / "figures", vectors=True), __version__)
    _write(folder / "replay.md", _markdown(page))
    for table in (*page.tables, *(section.table for section in page.sections)):
        _write(folder / "tables" / f"{table.name}.csv", comma_separated(table))
    write_estimates(replay, filters, folder / "estimates.csv")
    write_residuals(replay, filters, folder / "residuals.csv")
    _write(folder / PAGE, render_replay(page))
    return folder / PAGE


def _markdown(page: ReplayPage) -> str:
    parts = [f"# {plain_markdown(page.name)}: replay", plain_markdown(" · ".join(page.facts))]
    parts.append("\n".join(f"- {plain_markdown(sentence)}" for sentence in page.verdicts))
    parts.append(plain_markdown(page.scored))
    parts += [plain_markdown(f"Warning: {sentence}") for sentence in page.warnings]
    parts += [markdown(table) for table in page.tables]
    for section in page.sections:
        parts += [f"## {plain_markdown(section.name)}", plain_markdown(section.verdict), markdown(section.table)]
        parts += [_picture(picture) for picture in section.pictures]
    parts.append("## Measurements")
    parts.append("\n".join(f"- {plain_markdown(path)}: SHA-256 {digest}" for path, digest in page.files))
    parts.append("## How to read it")
    parts.append("\n".join(f"- {plain_markdown(sentence)}" for sentence in page.reading))
    return "\n\n".join(part.strip("\n") for part in [*parts, plain_markdown(page.footer)]) + "\n"


def _picture(picture: Picture) -> str:
    if picture.missing:
        return plain_markdown(picture.missing)
    image = f"![{plain_markdown(picture.alt)}](figures/{picture.name}.png)"
    return f"{image}\n\n{plain_markdown(picture.caption)}"


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(visible(text), encoding="utf-8", newline="\n")
