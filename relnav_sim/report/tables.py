"""A table as frozen data, and its Markdown and CSV forms (the HTML form is in the page's template).

A figure of a table is a ``Number``: the value, its interval and how many decimals it deserves. Everything
that shows a table reads the same object, so the forms cannot disagree.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from relnav_sim.results.csv_cells import csv_cell
from relnav_sim.wording import MOST_DECIMALS, shown_end, shown_number


@dataclass(frozen=True)
class Number:
    """One figure: its value, its interval (NaN where there is none) and the decimals to show."""

    value: float
    low: float = math.nan
    high: float = math.nan
    decimals: int = 3
    span: int = 1
    note: str = ""
    mark: str = ""
    unit: str = ""

    @property
    def has_interval(self) -> bool:
        """Whether both ends of the interval are known."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    @property
    def shown(self) -> str:
        """The value as text, without its interval."""
        return shown_number(self.value, self.decimals)

    @property
    def shown_interval(self) -> str:
        """The interval as text, or nothing."""
        if not self.has_interval:
            return ""
        return f"[{shown_end(self.low, self.decimals)}, {shown_end(self.high, self.decimals)}]"

    @property
    def text(self) -> str:
        """Value, interval, unit and note on one line."""
        return " ".join(part for part in (self.shown, self.shown_interval, self.unit, self.note) if part)

    @property
    def order(self) -> float:
        """What a sort of the column goes by; missing figures go last."""
        return self.value if math.isfinite(self.value) else math.inf


@dataclass(frozen=True)
class Words:
    """A cell that is text; ``order`` is what a sort goes by, where that is not the text itself.

    ``mark`` (here and in ``Number``) is how the page colours it: ``best``, ``failed`` or nothing.
    """

    text: str
    order: float | None = None
    span: int = 1
    mark: str = ""


Cell = Number | Words


@dataclass(frozen=True)
class Column:
    """A column: the group it stands under (a filter, or nothing) and its own heading."""

    label: str
    group: str = ""
    numeric: bool = True
    opens_group: bool = False

    @property
    def full_label(self) -> str:
        """The heading with its group, for forms that have one heading line."""
        return f"{self.group} {self.label}".strip()


@dataclass(frozen=True)
class Row:
    """A row: its heading, its unit and its cells, which together span the table's columns.

    ``key`` is the case the row belongs to, ``order`` what a sort by heading goes by, ``opens_block`` asks
    for a line above the row. ``record`` is the heading in CSV, where every row must stand for itself; empty: the label.
    ``anchor`` is the row's id in the page, for what links to it.
    """

    label: str
    cells: tuple[Cell, ...]
    unit: str = ""
    key: str = ""
    order: float | None = None
    opens_block: bool = False
    record: str = ""
    anchor: str = ""


@dataclass(frozen=True)
class Table:
    """A table: ``name`` is its file's name, ``corner`` heads the column of row headings.

    On a narrow screen a table that ``stacks`` shows each row as a list of its cells with the columns' headings.
    """

    name: str
    title: str
    caption: str
    corner: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    sortable: bool = False
    stacks: bool = False

    def __post_init__(self) -> None:
        """Refuse a row that does not fill the columns."""
        for row in self.rows:
            if sum(cell.span for cell in row.cells) != len(self.columns):
                raise ValueError(f"table {self.name}: row {row.label} does not span the columns")

    @property
    def groups(self) -> tuple[tuple[str, int], ...]:
        """The group headings with the number of columns under each; empty where no column has one."""
        groups: list[tuple[str, int]] = []
        for column in self.columns:
            if groups and groups[-1][0] == column.group:
                groups[-1] = (column.group, groups[-1][1] + 1)
            else:
                groups.append((column.group, 1))
        return tuple(groups) if any(name for name, _ in groups) else ()


def decimals_for(values: Iterable[float], half_widths: Iterable[float]) -> int:
    """Return how many decimals a row of figures deserves.

    The narrower intervals of the row show one digit of their half width, two where the first is a 1 or a 2;
    without intervals the figures show three digits. One number of decimals for a row lets the eye compare.
    """
    widths = sorted(width for width in half_widths if math.isfinite(width) and width > 0)
    if widths:
        return _clipped(-math.floor(math.log10(widths[(len(widths) - 1) // 4] / 3)))
    sizes = sorted(abs(value) for value in values if math.isfinite(value) and value != 0)
    if not sizes:
        return 0
    return _clipped(2 - math.floor(math.log10(sizes[len(sizes) // 2])))


def markdown(table: Table) -> str:
    """Return the table as a Markdown section: title, pipe table, caption."""
    unit = any(row.unit for row in table.rows)
    heads = [table.corner, *(["unit"] if unit else []), *(column.full_label for column in table.columns)]
    rule = [":--", *([":--"] if unit else []), *("--:" if column.numeric else ":--" for column in table.columns)]
    lines = [_pipes(heads), "|" + "|".join(rule) + "|"]
    for row in table.rows:
        lines.append(_pipes([row.label, *([row.unit] if unit else []), *_filled(row.cells)]))
    return f"### {plain_markdown(table.title)}\n\n" + "\n".join(lines) + f"\n\n{plain_markdown(table.caption)}\n"


def comma_separated(table: Table) -> str:
    """Return the table as CSV: one heading line, full precision, the interval in columns of its own."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    heads = [table.corner, "unit"]
    for column in table.columns:
        heads.append(column.full_label)
        if column.numeric:
            heads += [f"{column.full_label} low 95", f"{column.full_label} high 95"]
    writer.writerow(map(csv_cell, heads))
    for row in table.rows:
        fields: list[str] = [csv_cell(row.record or row.label), csv_cell(row.unit)]
        for column, cell in zip(table.columns, _spread(row.cells), strict=True):
            fields += _fields(cell, column.numeric)
        writer.writerow(fields)
    return file.getvalue()


def plain_markdown(text: str) -> str:
    """Return text so that Markdown and the HTML inside it show it as written."""
    for sign in "\\`*_{}[]<>#|$":
        text = text.replace(sign, "\\" + sign if sign not in "<>" else {"<": "&lt;", ">": "&gt;"}[sign])
    return " ".join(text.split())


def _pipes(cells: Sequence[str]) -> str:
    return "| " + " | ".join(plain_markdown(cell) for cell in cells) + " |"


def _spread(cells: Iterable[Cell]) -> list[Cell | None]:
    spread: list[Cell | None] = []
    for cell in cells:
        spread += [cell, *([None] * (cell.span - 1))]
    return spread


def _filled(cells: Iterable[Cell]) -> list[str]:
    return ["" if cell is None else cell.text for cell in _spread(cells)]


def _fields(cell: Cell | None, numeric: bool) -> list[str]:
    if isinstance(cell, Number):
        figures = [cell.value, cell.low, cell.high] if numeric else [cell.value]
        return ["" if math.isnan(figure) else repr(float(figure)) for figure in figures]
    text = "" if cell is None else csv_cell(cell.text)
    return [text, "", ""] if numeric else [text]


def _clipped(decimals: int) -> int:
    return max(0, min(MOST_DECIMALS, decimals))
