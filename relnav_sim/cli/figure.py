"""`relnav figure`: one figure of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import existing_result, target_file
from relnav_sim.cli.output import new_file, print_table, say
from relnav_sim.cli.report import ReportAxes

_SUFFIXES = (".pdf", ".png", ".svg")


def figure(
    result: Annotated[Path | None, typer.Argument(metavar="RESULT", help="The result file.")] = None,
    kind: Annotated[
        str | None, typer.Argument(metavar="KIND", help="What to draw; without a result and a kind all are listed.")
    ] = None,
    case: Annotated[
        str | None, typer.Option(help="The case, by number from 0, id, or label as printed.", show_default="the first")
    ] = None,
    filters: Annotated[
        list[str] | None,
        typer.Option("--filter", help="A filter; repeat for several.", show_default="all, or the most accurate one"),
    ] = None,
    run: Annotated[int | None, typer.Option(help="The run.", show_default="the one with the median error")] = None,
    axes: Annotated[
        ReportAxes | None, typer.Option(case_sensitive=False, help="Axes of the panels.", show_default="rtn")
    ] = None,
    from_s: Annotated[float | None, typer.Option("--from", help="Start of the time axis, s.")] = None,
    until_s: Annotated[float | None, typer.Option("--until", help="End of the time axis, s.")] = None,
    at_s: Annotated[
        float | None, typer.Option("--at", help="Of ellipses: the epoch, s.", show_default="the last one")
    ] = None,
    sigma: Annotated[
        float | None, typer.Option(help="Of ellipses: their size in sigmas.", show_default="2.45, which holds 95 %")
    ] = None,
    along: Annotated[
        list[str] | None, typer.Option(help="What a sweep is drawn along, as alpha; twice for a heat map.")
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(
            metavar="PATH", help="The file: .pdf, .svg (vectors) or .png; or a folder for it.", show_default="KIND.pdf"
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Draw one figure of a result, for a paper or a closer look: relnav figure results/demo.h5 errors --filter ekf."""
    from relnav_sim.plots import FIGURE_KINDS, FigureError
    from relnav_sim.plots import figure as drawn

    if result is None or kind is None:
        if result is not None:
            say(f"which figure of {result}? There are:\n", err=True)
        print_table(
            [(each.name, each.shows, each.papers) for each in FIGURE_KINDS.values()], ("kind", "shows", "as in")
        )
        return
    existing_result(result)
    path = target_file(out if out is not None else Path(), f"{kind}.pdf")
    if path.suffix not in _SUFFIXES:
        raise UserError(f"--out takes a name that ends in {', '.join(_SUFFIXES)}, not {path.name!r}")
    options: dict[str, Any] = {"from_s": from_s, "until_s": until_s, "at_s": at_s, "sigma": sigma}
    if along:
        options["along"] = along if len(along) > 1 else along[0]
    try:
        picture = drawn(
            result,
            kind,
            case=case,
            filter=filters or None,
            run=run,
            axes=axes.value if axes is not None else None,
            **options,
        )
    except FigureError as error:
        raise UserError(str(error)) from None
    from relnav_sim.plots.style import write_figure

    write_figure(picture, new_file(path, overwrite))
    say(f"wrote {path}")
