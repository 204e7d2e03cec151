"""`relnav compare`: two results, or two filters across results, run by run."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import print_table, say
from relnav_sim.cli.source import readable
from relnav_sim.wording import first_of


class Form(StrEnum):
    """How a comparison is printed."""

    TEXT = "text"
    MD = "md"
    CSV = "csv"
    LATEX = "latex"


def compare(
    first: Annotated[str, typer.Argument(metavar="A[:FILTER]", help="A result file, and a filter of it.")],
    second: Annotated[str, typer.Argument(metavar="B[:FILTER]", help="Another, or the same for two filters of it.")],
    filter: Annotated[
        str | None, typer.Option(help="The filter of both.", show_default="every filter that both have")
    ] = None,
    form: Annotated[Form, typer.Option("--format", case_sensitive=False, help="How to print.")] = Form.TEXT,
) -> None:
    """Compare two results, or two filters across results, on the runs that they have in common.

    Runs are paired where case, seed and run number are the same: they then share their random numbers.
    """
    from relnav_sim.report.compare import Side
    from relnav_sim.report.compare import compare as compared
    from relnav_sim.results import open_results

    (path, one), (other_path, other) = _parts(first), _parts(second)
    if filter is not None and (one or other):
        raise UserError("give --filter, or the filters behind the files, as A.h5:ekf B.h5:ukf; not both")
    with (
        readable(path) as file,
        readable(other_path) as other_file,
        open_results(file) as a,
        open_results(other_file) as b,
    ):
        for results, wanted, shown in ((a, one or filter, path), (b, other or filter, other_path)):
            if wanted is not None and wanted not in results.filters:
                raise UserError(f"{shown} has no filter {wanted!r}; there are {first_of(results.filters)}")
        names = _names(path, other_path, one, other)
        found = compared(Side(a, names[0], one or filter), Side(b, names[1], other or filter))
    for sentence in (*found.notes, *found.reasons):
        say(sentence, err=True)
    if found.table is None:
        raise UserError("nothing can be compared run by run")
    if form is Form.TEXT:
        rows = []
        for row in found.table.rows:
            filters, figure, one_mean, other_mean, difference, percent, verdict, _, runs = row.cells
            words = (filters.text, f"{figure.text} [{row.unit}]", one_mean.text, other_mean.text, difference.text)
            rows.append((row.label, *words, percent.text.partition(" ")[0], verdict.text, runs.text))
        headings = [found.table.corner, *(column.label for column in found.table.columns if column.label != "p")]
        print_table(rows, headings)
        say(found.table.caption)
        return
    from relnav_sim.report.latex import latex
    from relnav_sim.report.tables import comma_separated, markdown

    made = {Form.MD: markdown, Form.CSV: comma_separated, Form.LATEX: latex}[form]
    say(made(found.table), nl=False)


def _parts(text: str) -> tuple[Path, str | None]:
    """Return file and filter; a file whose own name has a colon is one that is there."""
    path, _, filter = text.rpartition(":")
    if Path(text).exists() or not path:
        return Path(text), None
    return Path(path), filter


def _names(path: Path, other: Path, one: str | None, second: str | None) -> tuple[str, str]:
    """Return what the two sides are called: as short as tells them apart."""
    if path == other:
        return f"{path.stem} {one or ''}".strip(), f"{other.stem} {second or ''}".strip()
    return (path.stem, other.stem) if path.stem != other.stem else (str(path), str(other))
