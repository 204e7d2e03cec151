"""`relnav report`: tables and figures of a result."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
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
        str, typer.Option("--format", help="What to write, separated by commas; figures come with each.")
    ] = "html,md,csv",
    axes: Annotated[
        ReportAxes,
        typer.Option(help="rtn: radial, along-track, normal; shi2025: along-track, minus normal, nadir."),
    ] = ReportAxes.RTN,
) -> None:
    """Write the report of a result: an HTML page, tables and figures."""
    from relnav_sim.report import FORMATS, write_report

    path = result if result is not None else newest_result(Path("results"))
    words = [word.strip() for word in formats.split(",") if word.strip()]
    unknown = [word for word in words if word not in FORMATS]
    if unknown or not words:
        raise UserError(f"--format takes {', '.join(FORMATS)}, not {(unknown or [formats])[0]!r}")
    with readable(path) as file:
        target = out if out is not None else path.with_suffix("")
        typer.echo(f"wrote {write_report(file, target, formats=words, axes=axes.value)}")
