"""`python -m replication`: three papers replicated, claim by claim."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.backend import BackendName, BackendOption, LocalClusterOption, SchedulerOption, WorkersOption, where
from relnav_sim.cli.failures import UserError, guarded
from relnav_sim.cli.group import Command
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.output import print_table, say
from relnav_sim.cli.watched import TimeoutOption, check_timeout

if TYPE_CHECKING:
    from replication.plan import Size


def reproduce(
    full: Annotated[
        bool,
        typer.Option(
            "--full",
            help="Every campaign at full size, hours; renews the summaries in replication/full. Interrupt it when you "
            "have to: the same command goes on, and --docs takes what is complete.",
        ),
    ] = False,
    trial: Annotated[
        bool, typer.Option("--trial", help="Three shortened runs of each case, to see that all works: minutes.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="The folder to write to.", show_default="results/reproduce, with -full or -trial added"),
    ] = None,
    campaigns: Annotated[Path, typer.Option(help="The folder with the campaign files.")] = Path("campaigns"),
    docs: Annotated[
        Path | None,
        typer.Option(
            help="Run nothing: write the two pages and their figures into this folder, from the summaries in "
            "replication/full.",
            show_default="no",
        ),
    ] = None,
    in_full: Annotated[
        Path | None,
        typer.Option(
            help="With --docs: the folder of a --full replication; first renews the summaries of the campaigns that "
            "are complete there.",
            show_default="results/reproduce-full",
        ),
    ] = None,
    workers: WorkersOption = None,
    backend: BackendOption = BackendName.LOKY,
    scheduler: SchedulerOption = None,
    local_cluster: LocalClusterOption = None,
    timeout_s: TimeoutOption = None,
) -> None:
    """Replicate three papers: compute some of the runs again, compare them with the committed summaries, judge claims.

    The same command continues where an earlier one was interrupted.
    """
    if full and trial:
        raise UserError("--full and --trial exclude each other")
    if docs is not None and (full or trial or out is not None):
        raise UserError("--docs runs nothing: give it without --full, --trial and --out")
    if in_full is not None and docs is None:
        raise UserError("--in-full goes with --docs")
    if in_full is not None and not (in_full / "campaigns").is_dir():
        raise UserError(f"{in_full} is no folder that make reproduce-full has written: it has no folder campaigns")
    if not campaigns.is_dir():
        raise UserError(f"there is no folder {campaigns}; run this where relnav's campaigns/ is, or give --campaigns")
    place = where(backend, workers, scheduler, local_cluster)
    check_timeout(timeout_s, backend)
    size: Size = "full" if full else "trial" if trial else "subset"
    folder = out or Path("results") / ("reproduce" if size == "subset" else f"reproduce-{size}")
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder} is a file; give --out the name of a folder")
    with ending_promptly("interrupted; what is finished is kept, and the same command continues"):
        from replication.pages import verdict_lines
        from replication.reproduce import SUMMARY_FILE, write_docs
        from replication.reproduce import reproduce as replicate

        if docs is not None:
            write_docs(campaigns, docs, in_full or Path("results/reproduce-full"), _say)
            say(f"wrote {docs / 'replication.md'} and {docs / 'replication-evidence.md'}")
            return
        summary = replicate(
            size, campaigns, folder, place.workers, True, _say, place.backend, place.scheduler, timeout_s
        )
        print_table(verdict_lines(summary), ("claim", "verdict", "what the main interpretations show"))
        say(f"wrote {folder / 'index.html'} and {folder / SUMMARY_FILE}")


def _say(sentence: str) -> None:
    say(sentence, err=True)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command(cls=Command)(guarded(reproduce))

if __name__ == "__main__":
    app(prog_name="python -m replication")
