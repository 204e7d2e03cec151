"""`relnav export`: a result in formats that other programs read."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import RESULTS, existing, target_file
from relnav_sim.cli.output import new_file, say
from relnav_sim.cli.source import readable


class Format(StrEnum):
    """File formats."""

    CSV = "csv"
    TDM = "tdm"


class Part(StrEnum):
    """What of a result is exported."""

    SUMMARY = "summary"
    SERIES = "series"
    READINGS = "readings"


def export(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="The result file.")],
    to: Annotated[Format, typer.Option("--to", case_sensitive=False, help="The format.")] = Format.CSV,
    part: Annotated[
        Part,
        typer.Option(
            case_sensitive=False,
            help="summary: a row for each case, filter and run; series: for each stored epoch too; readings: what the "
            "filters of a case were given in a run, simulated again, to the bit.",
        ),
    ] = Part.SUMMARY,
    out: Annotated[
        str | None,
        typer.Option(
            metavar="PATH", help="The file, or a folder for it.", show_default="beside the result, NAME_PART.csv"
        ),
    ] = None,
    case: Annotated[
        str | None,
        typer.Option(
            metavar="CASE",
            help="Of --part readings: number, label or id of the case.",
            show_default="the first",
        ),
    ] = None,
    run: Annotated[
        list[int] | None,
        typer.Option(
            metavar="RUN",
            help="Of --part readings: a run; may be given several times, each with files of its own.",
            show_default="the first",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Write the numbers of a result to a file that other programs read.

    A TDM holds range, range rate and angles; what else the filters were given goes to a CSV file beside it.
    """
    from relnav_sim.results import open_results
    from relnav_sim.results.export import export_series, export_summary

    existing(result, RESULTS)
    if part is Part.READINGS:
        from relnav_sim.cli.export_readings import export_readings
        from relnav_sim.recorded.readings import ReadingsError

        with readable(result) as file, open_results(file) as results:
            try:
                export_readings(results, result, case, run or [], to.value, out, overwrite)
            except ReadingsError as error:
                raise UserError(str(error)) from None
        return
    if case is not None or run:
        raise UserError("--case and --run choose readings; give --part readings with them")
    if to is not Format.CSV:
        raise UserError(f"--to {to.value} is a format of readings; give --part readings with it")
    name = f"{result.stem}_{part.value}.{to.value}"
    path = target_file(out, name) if out is not None else result.with_name(name)
    if path.exists() and result.exists() and path.samefile(result):
        raise UserError(f"{path} is the result itself; give another --out")
    new_file(path, overwrite)
    write = export_series if part is Part.SERIES else export_summary
    with readable(result) as file, open_results(file) as results:
        write(results, path)
    say(f"wrote {path}")
