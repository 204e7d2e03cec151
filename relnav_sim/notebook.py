"""How objects show themselves: in a line where text is printed, as a small table in a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

MOST_ROWS = 20


def table_html(caption: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML; of many rows the first, and how many more there are.

    Args:
        caption: What stands above it.
        headings: One for each column.
        rows: The cells.

    Examples:
        >>> table_html("two & three", ["a"], [["1 < 2"]])
        '<table><caption>two &amp; three</caption><tr><th>a</th></tr><tr><td>1 &lt; 2</td></tr></table>'
    """
    lines = [_row("th", headings), *(_row("td", row) for row in rows[:MOST_ROWS])]
    if len(rows) > MOST_ROWS:
        lines.append(_row("td", [f"and {len(rows) - MOST_ROWS} more"]))
    return f"<table><caption>{escape(caption)}</caption>{''.join(lines)}</table>"


def _row(cell: str, words: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(word)}</{cell}>' for word in words)}</tr>"
