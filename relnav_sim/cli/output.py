"""How the commands print: tables as wide as the terminal, plain text where there is none."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import regular
from relnav_sim.printable import visible

_PIPED_WIDTH = 120
_MOST_WRAPPED = 500
"""Rows of a table that is broken to fit; of longer ones, which nobody reads on a screen, each row is a line."""


def print_table(rows: Iterable[Sequence[str]], headings: Sequence[str] = ()) -> None:
    """Print rows in aligned columns, broken to fit the width; each in one line where there are very many."""
    rows = [list(row) for row in rows]
    if len(rows) > _MOST_WRAPPED:
        _print_lines([list(headings), *rows] if headings else rows)
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    rows = [[escape(visible(cell)) for cell in row] for row in rows]
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


def _print_lines(rows: Sequence[Sequence[str]]) -> None:
    from rich.cells import cell_len

    cells = [[visible(cell) for cell in row] for row in rows]
    lengths = [[cell_len(cell) for cell in row] for row in cells]
    widths = [max(column) for column in zip(*lengths, strict=True)]
    lines = []
    for row, taken in zip(cells, lengths, strict=True):
        padded = (cell + " " * (width - length) for cell, width, length in zip(row, widths, taken, strict=True))
        lines.append("  ".join(padded).rstrip())
    typer.echo("\n".join(lines))


def say(text: str, err: bool = False, nl: bool = True) -> None:
    """Print text on the terminal, what is no sign in it escaped: it may come from a file or an exception.

    Args:
        text: The text.
        err: To standard error instead of standard output.
        nl: End with a new line.
    """
    typer.echo(visible(text), err=err, nl=nl)


def command(*words: object) -> str:
    """Return a command as a shell takes it: names with spaces in quotes."""
    return shlex.join(map(str, words))


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
    if regular(path).exists() and not overwrite:
        raise UserError(f"{path} exists already; give another name, or --overwrite to replace it")
    return path
