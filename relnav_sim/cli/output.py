"""How the commands print: tables as wide as the terminal, plain text where there is none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import typer

from relnav_sim.cli.failures import UserError

_PIPED_WIDTH = 120


def print_table(rows: Iterable[Sequence[str]], headings: Sequence[str] = ()) -> None:
    """Print rows in aligned columns; the last column wraps."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    rows = [[escape(cell) for cell in row] for row in rows]
    table = Table(box=None, show_header=bool(headings), header_style="bold", padding=(0, 2, 0, 0), pad_edge=False)
    for position, heading in enumerate(headings or [""] * max(map(len, rows), default=0)):
        table.add_column(heading, overflow="fold", no_wrap=position == 0)
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    if console.is_terminal:
        console.print(table)
        return
    console = Console(highlight=False, width=_PIPED_WIDTH)
    with console.capture() as text:
        console.print(table)
    for line in text.get().splitlines():
        typer.echo(line.rstrip())


def in_words(seconds: float) -> str:
    """Return a duration in words."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def size_in_words(size: float) -> str:
    """Return a number of bytes in words."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(size / 1e6, 0.1):.1f} MB"


def count_in_words(count: int, singular: str, plural: str | None = None) -> str:
    """Return ``1 run`` or ``2 runs``."""
    return f"{count} {singular if count == 1 else plural or singular + 's'}"


def new_file(path: Path, overwrite: bool) -> Path:
    """Return a path that may be written to.

    Raises:
        UserError: Something stands there already and may not be replaced, or the path names no file.
    """
    if path.name in ("", ".", ".."):
        raise UserError(f"'{path}' names no file")
    if path.exists() and not path.is_file():
        raise UserError(f"{path} is no regular file; give another name")
    if path.exists() and not overwrite:
        raise UserError(f"{path} exists already; give another name, or --overwrite to replace it")
    return path
