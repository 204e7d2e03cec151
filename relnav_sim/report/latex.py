r"""A table as LaTeX that drops into an article: booktabs rules, captions and labels set, never wider than the text.

``\input{tables/overview.tex}`` in a document that has ``\usepackage{booktabs,graphicx}``.
"""

from __future__ import annotations

from collections.abc import Iterable

from relnav_sim.report.sentences import Sentence, plain
from relnav_sim.report.tables import Cell, Column, Number, Row, Table

_SIGNS = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": "$<$",
    ">": "$>$",
    "|": "$|$",
    '"': "''",
    "\N{MINUS SIGN}": "$-$",
    "\N{EN DASH}": "--",
    "\N{INFINITY}": r"$\infty$",
    "\N{GREATER-THAN OR EQUAL TO}": r"$\geq$",
    "\N{PLUS-MINUS SIGN}": r"$\pm$",
    "\N{MULTIPLICATION SIGN}": r"$\times$",
    "\N{MICRO SIGN}": r"\textmu{}",
    "\N{MIDDLE DOT}": r"$\cdot$",
    "\N{HORIZONTAL ELLIPSIS}": r"\ldots{}",
}


_FITTED = r"  \ifdim\wd0>\linewidth\resizebox{\linewidth}{!}{\usebox0}\else\usebox0\fi"
_LONGEST_ON_A_LINE = 60
"""Characters; a column with longer words gets a width and several lines."""


def latex(table: Table) -> str:
    """Return the table as a floating ``table`` with a ``tabular`` in booktabs style."""
    columns = "l" + "".join(_column(table, place) for place in range(len(table.columns)))
    lines = [
        r"% needs \usepackage{booktabs,graphicx}",
        r"\begin{table}",
        r"  \centering\footnotesize",
        f"  \\caption{{{escaped(table.title)}. {escaped(table.caption)}}}",
        f"  \\label{{tab:{table.name.replace('_', '-')}}}",
        f"  \\sbox0{{\\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"    \toprule",
        *(f"    {line}" for line in _heading(table)),
        r"    \midrule",
    ]
    for place, row in enumerate(table.rows):
        if row.opens_block and place:
            lines.append(r"    \midrule")
        lines.append(f"    {_row(row)}")
    return "\n".join([*lines, r"    \bottomrule", r"  \end{tabular}}%", _FITTED, r"\end{table}"]) + "\n"


def latex_sentences(sentences: Iterable[Sentence]) -> str:
    """Return sentences as an ``itemize``, each with references to the tables that hold its numbers."""
    lines = []
    for sentence in sentences:
        tables = dict.fromkeys(clause.table for clause in sentence if clause.table)
        references = ", ".join(rf"\ref{{tab:{name.replace('_', '-')}}}" for name in tables)
        lines.append(rf"  \item {escaped(plain(sentence))}" + (f" (Table~{references})" if references else ""))
    return "\n".join([r"\begin{itemize}", *lines, r"\end{itemize}"]) + "\n"


def _column(table: Table, place: int) -> str:
    if table.columns[place].numeric:
        return "r"
    # Cells that span columns are short.
    cells = [row.cells[place] for row in table.rows if all(cell.span == 1 for cell in row.cells)]
    longest = max((len(cell.text) for cell in cells if not isinstance(cell, Number)), default=0)
    return r"p{0.6\linewidth}" if longest > _LONGEST_ON_A_LINE else "l"


def escaped(text: str) -> str:
    """Return text that LaTeX sets as written."""
    return "".join(_SIGNS.get(sign, sign) for sign in " ".join(text.split()))


def _heading(table: Table) -> Iterable[str]:
    if table.groups:
        cells, rules, first = [""], [], 2
        for name, span in table.groups:
            cells.append(rf"\multicolumn{{{span}}}{{c}}{{{escaped(name)}}}")
            rules += [rf"\cmidrule(lr){{{first}-{first + span - 1}}}"] if name else []
            first += span
        yield " & ".join(cells) + r" \\"
        yield " ".join(rules)
    yield " & ".join([escaped(table.corner), *(_centred(column) for column in table.columns)]) + r" \\"


def _centred(column: Column) -> str:
    return rf"\multicolumn{{1}}{{c}}{{{escaped(column.label)}}}" if column.numeric else escaped(column.label)


def _row(row: Row) -> str:
    label = escaped(row.label) + (rf" / {escaped(row.unit)}" if row.unit else "")
    return " & ".join([label, *(_cell(cell) for cell in row.cells)]) + r" \\"


def _cell(cell: Cell) -> str:
    if isinstance(cell, Number):
        parts = [escaped(cell.shown)]
        if cell.has_interval:
            parts.append(rf"{{\scriptsize {escaped(cell.shown_interval)}}}")
        text = "~".join([*parts, *(escaped(more) for more in (cell.unit, cell.note) if more)])
    else:
        text = escaped(cell.text)
    if cell.mark == "best":
        text = rf"\textbf{{{text}}}"
    return text if cell.span == 1 else rf"\multicolumn{{{cell.span}}}{{c}}{{{text}}}"
