"""`relnav inspect`: what a result file holds and where it came from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.output import count_in_words, in_words, print_table

FAILURES_SHOWN = 20


def inspect(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="The result file.")],
) -> None:
    """Show what a result holds: campaign, cases, filters, runs, failures and where it came from."""
    from relnav_sim.results import open_results

    with open_results(result) as results:
        provenance = results.provenance
        source = provenance.git_commit[:12] + (", with changes" if provenance.git_dirty == 1 else "")
        missing = {run for runs in results.missing().values() for run in runs}
        held = f"{len(results.runs)} of {results.planned_runs}" + (
            f"; not finished: {count_in_words(len(missing), 'run')} to do" if missing else ""
        )
        failures = results.failures()
        print_table(
            [
                ("campaign", results.campaign_name),
                ("hash", results.campaign_hash[:12]),
                ("seed", str(results.seed)),
                ("runs", held),
                ("cases", "\n".join(f"{header.id}  {header.label}" for header in results.headers)),
                ("filters", ", ".join(results.filters)),
                ("failed", count_in_words(len(failures), "run of a filter", "runs of a filter")),
                ("began", f"{provenance.started}, took {in_words(provenance.wall_time_s)}"),
                ("command", provenance.command_line),
                ("source", source or "not known"),
                ("versions", ", ".join(f"{name} {version}" for name, version in provenance.versions.items())),
                ("machine", ", ".join(f"{name} {value}" for name, value in provenance.machine.items())),
            ]
        )
        if failures:
            typer.echo()
            shown = [
                (label, str(failure.run), failure.filter or "all", str(failure.epoch), failure.reason)
                for label, failure in failures[:FAILURES_SHOWN]
            ]
            print_table(shown, headings=("case", "run", "filter", "epoch", "reason"))
        if len(failures) > FAILURES_SHOWN:
            typer.echo(f"and {len(failures) - FAILURES_SHOWN} more; relnav export RESULT has them all")
