"""`relnav export`: a result in formats that other programs read."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.exported_runs import writable
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import existing_result, target_file
from relnav_sim.cli.output import say
from relnav_sim.cli.source import readable


class Format(StrEnum):
    """File formats."""

    CSV = "csv"
    TDM = "tdm"
    OEM = "oem"


class Part(StrEnum):
    """What of a result is exported."""

    SUMMARY = "summary"
    SERIES = "series"
    READINGS = "readings"
    TRUTH = "truth"
    ESTIMATES = "estimates"


_ORBITS = (Part.TRUTH, Part.ESTIMATES)
_OTHER_PART = {Format.TDM: "--part readings", Format.OEM: "--part truth or --part estimates"}


def export(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="The result file.")],
    to: Annotated[Format, typer.Option("--to", case_sensitive=False, help="The format.")] = Format.CSV,
    part: Annotated[
        Part,
        typer.Option(
            case_sensitive=False,
            help="summary: a row for each case, filter and run; series: for each stored epoch too; readings: what the "
            "filters of a case were given in a run; truth: the orbits of both craft; estimates: the deputy's orbit by "
            "a filter, with covariance. The last three are simulated again, to the bit.",
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
            help="Of measurements, truth and estimates: the case, by number from 0, id, or label as printed.",
            show_default="the first",
        ),
    ] = None,
    run: Annotated[
        list[int] | None,
        typer.Option(
            metavar="RUN",
            help="Of the same: a run; may be given several times, each with files of its own.",
            show_default="the first",
        ),
    ] = None,
    filter: Annotated[
        str | None,
        typer.Option(metavar="FILTER", help="Of estimates: whose.", show_default="the only one"),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SENSOR",
            help="Of measurements: a sensor, by the name that its columns begin with; may be given several times.",
            show_default="all",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Write the numbers of a result to a file that other programs read.

    A TDM holds range, range rate and angles; what else the filters were given goes to a CSV file beside it. Orbits are
    written as CCSDS OEM, and need a truth.epoch.
    """
    from relnav_sim.results import open_results
    from relnav_sim.results.export import export_series, export_summary

    existing_result(result)
    if filter is not None and part is not Part.ESTIMATES:
        raise UserError("--filter chooses estimates; give --part estimates with it")
    if sensor and part is not Part.READINGS:
        raise UserError("--sensor chooses measurements; give --part readings with it")
    if part in _ORBITS:
        from relnav_sim.cli.export_orbits import export_orbits

        if to is not Format.OEM:
            raise UserError(f"{part.value} is written as an OEM; give --to oem with it")
        with readable(result) as file, open_results(file) as results:
            export_orbits(results, result, part.value, case, filter, run or [], out, overwrite)
        return
    if part is Part.READINGS:
        if to is Format.OEM:
            raise UserError(f"--to oem is no format of measurements; give {_OTHER_PART[to]} with it")
        from relnav_sim.cli.export_readings import export_readings
        from relnav_sim.recorded.readings import ReadingsError

        with readable(result) as file, open_results(file) as results:
            try:
                export_readings(results, result, case, run or [], sensor or [], to.value, out, overwrite)
            except ReadingsError as error:
                raise UserError(str(error)) from None
        return
    if case is not None or run:
        raise UserError("--case and --run choose a run; give --part readings, truth or estimates with them")
    if to is not Format.CSV:
        raise UserError(f"--to {to.value} is no format of {part.value}; give {_OTHER_PART[to]} with it")
    name = f"{result.stem}_{part.value}.{to.value}"
    path = target_file(out, name) if out is not None else result.with_name(name)
    writable(path, result, overwrite)
    write = export_series if part is Part.SERIES else export_summary
    with readable(result) as file, open_results(file) as results:
        write(results, path)
    say(f"wrote {path}")
