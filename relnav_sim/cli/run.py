"""`relnav run`: simulate a campaign."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import Exit, UserError
from relnav_sim.cli.output import count_in_words


class Backend(StrEnum):
    """Where the work is done."""

    LOKY = "loky"
    SEQUENTIAL = "sequential"


def run(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The campaign, a YAML file.")],
    out: Annotated[
        Path | None, typer.Option(help="The result file.", show_default="results/NAME.h5 in this folder")
    ] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="Runs of each case instead of the campaign's own.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Change a value, as clock.step_s=1; may be repeated."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes; the results do not depend on it.")] = 2,
    backend: Annotated[
        Backend, typer.Option(help="loky: in worker processes; sequential: in this process, for debugging.")
    ] = Backend.LOKY,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Start over: an existing result is moved aside, never deleted.")
    ] = False,
) -> None:
    """Simulate a campaign, run its filters and store the result.

    The same command continues a campaign that was interrupted.
    """
    from relnav_sim.campaign import load_campaign

    overrides = [*(changes or []), *([f"runs={runs}"] if runs is not None else [])]
    campaign = load_campaign(file, overrides)

    from relnav_sim.results import open_results
    from relnav_sim.results.block import ResultsError
    from relnav_sim.runner import run_campaign

    try:
        path = run_campaign(
            campaign,
            out,
            workers=workers,
            backend=backend.value,
            fresh=fresh,
            progress=True,
            say=lambda sentence: typer.echo(sentence, err=True),
        )
    except ResultsError as error:
        # A result that stands in the way is a matter of the arguments, not of the disk.
        raise UserError(str(error)) from None
    with open_results(path) as results:
        failed = len(results.failures())
    typer.echo(f"wrote {path}; next: relnav report {path}")
    if failed:
        typer.echo(
            f"{count_in_words(failed, 'run of a filter', 'runs of a filter')} failed; the report counts them, "
            f"relnav inspect {path} lists them",
            err=True,
        )
        raise typer.Exit(Exit.SOME_RUNS_FAILED)
