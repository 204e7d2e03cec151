"""`relnav merge`: parts of a campaign from several machines into one result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import Exit
from relnav_sim.cli.files import existing_result, regular, result_name
from relnav_sim.cli.output import command, count_in_words, print_table, say


def merge(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The result file to write.")],
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PARTS...", help="Result files of relnav run --shard, or their .shards folders."),
    ],
    missing: Annotated[
        bool, typer.Option("--missing", help="List the runs that no part has, and write nothing; exit code 6 if any.")
    ] = False,
) -> None:
    """Unite the parts of a campaign that several machines have computed.

    Runs that several parts hold count once if they agree; conflicts and missing runs are named.
    """
    from relnav_sim.results import open_results
    from relnav_sim.runner.merging import merge_results

    if missing:
        _list_missing([existing_result(part) for part in parts])
        return
    path = merge_results(result_name(regular(out)), [existing_result(part) for part in parts])
    with open_results(path) as results:
        failed = len(results.failures())
    say(f"wrote {path}; next: {command('relnav', 'report', path)}")
    if failed:
        say(f"{count_in_words(failed, 'run of a filter', 'runs of a filter')} failed", err=True)
        raise typer.Exit(Exit.SOME_RUNS_FAILED)


def _list_missing(parts: list[Path]) -> None:
    from relnav_sim.results.missing_runs import run_ranges
    from relnav_sim.runner.merging import missing_of_parts

    if not (found := missing_of_parts(parts)):
        say("no run is missing")
        return
    print_table([(one.case, one.filter, run_ranges(one.runs)) for one in found], headings=("case", "filter", "missing"))
    raise typer.Exit(Exit.UNFINISHED)
