"""`relnav report`: tables and figures of a result."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import Exit, UserError
from relnav_sim.cli.output import print_table, say
from relnav_sim.cli.source import newest_result, readable


class ReportAxes(StrEnum):
    """Axes of the relative position in reports."""

    RTN = "rtn"
    SHI2025 = "shi2025"


def report(
    result: Annotated[
        Path | None,
        typer.Argument(metavar="RESULT", help="The result file.", show_default="the newest in results/"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The folder to write to.", show_default="beside the result, with its name")
    ] = None,
    formats: Annotated[
        str,
        typer.Option(
            "--format",
            help="What to write, separated by commas, of html, md, csv and latex. Figures come with each as PNG, "
            "with latex also as PDF.",
        ),
    ] = "html,md,csv",
    case: Annotated[
        list[str] | None,
        typer.Option(
            "--case",
            metavar="CASE",
            help="A case to show closely, with its tables and figures, by number from 0, id, or label as printed; may "
            "be repeated.",
            show_default="all, of more than 50 the first",
        ),
    ] = None,
    axes: Annotated[
        ReportAxes,
        typer.Option(
            case_sensitive=False, help="rtn: radial, along-track, normal; shi2025: along-track, minus normal, nadir."
        ),
    ] = ReportAxes.RTN,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Say also whether the campaign's requirements are met: exit code 0 if they are, 4 if one is missed, "
            "5 if one is undecided.",
        ),
    ] = False,
) -> None:
    """Write the report of a result: an HTML page, tables and figures."""
    from relnav_sim.report import FORMATS, write_report

    path = result if result is not None else newest_result(Path("results"))
    words = [word.strip().lower() for word in formats.split(",") if word.strip()]
    unknown = [word for word in words if word not in FORMATS]
    if unknown or not words:
        raise UserError(f"--format takes {', '.join(FORMATS)}, not {(unknown or [formats])[0]!r}")
    with readable(path) as file:
        target = out if out is not None else path.with_suffix("")
        if target.exists() and not target.is_dir():
            raise UserError(f"{target} is a file; give --out the name of a folder")
        verdict, concerned = _checked(file) if check else (None, "")
        decision: list[str] = []
        page = write_report(
            file,
            target,
            formats=words,
            axes=axes.value,
            cases=case or None,
            say=lambda words: say(words, err=True),
            tell=decision.append,
        )
        say(f"wrote {page}")
        for sentence in decision:
            say(sentence)
    if verdict is not None:
        say(f"requirements: {verdict}{concerned}")
    if verdict == "fail":
        raise typer.Exit(Exit.REQUIREMENT_MISSED)
    if verdict == "undecided":
        raise typer.Exit(Exit.REQUIREMENT_UNDECIDED)


def _checked(path: Path) -> tuple[str, str]:
    """Print what became of each requirement; return the verdict on all, and whom it is about."""
    from relnav_sim.report.requirements import concerned, judgements, requirements_table
    from relnav_sim.results import open_results
    from relnav_sim.statistics.requirements import overall

    with open_results(path) as results:
        judged = judgements(results)
        if not judged:
            raise UserError(f"the campaign of {path} has no requirements; add 'requirements:' to it and run it again")
        table = requirements_table(results, judged)
    rows = [[row.record, *(cell.text for cell in row.cells)] for row in table.rows]
    print_table(rows, headings=[table.corner, *(column.label for column in table.columns)])
    verdict = overall([item.verdict for item in judged])
    return verdict, "" if verdict == "pass" else f" ({concerned(judged, verdict)})"
