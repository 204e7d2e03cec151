"""`python -m replication`: three papers replicated, claim by claim."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.backend import BackendName, BackendOption, LocalClusterOption, SchedulerOption, WorkersOption, where
from relnav_sim.cli.failures import UserError, guarded
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.output import print_table, say
from relnav_sim.cli.watched import TimeoutOption, check_timeout

if TYPE_CHECKING:
    from replication.plan import Size
    from replication.summary import Summary


def reproduce(
    full: Annotated[
        bool,
        typer.Option(
            "--full",
            help="At the papers' own sizes with 100 runs of each case: hours, the longest campaigns last. Interrupt it "
            "when you have to: what is complete serves --docs, and the same command goes on.",
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
        typer.Option(help="Also write replication.md, its data and its figures into this folder.", show_default="no"),
    ] = None,
    in_full: Annotated[
        Path | None,
        typer.Option(
            help="With --docs: every campaign that is complete at full size in this folder takes the place of the "
            "usual one on that page, which says so.",
            show_default="results/reproduce-full",
        ),
    ] = None,
    workers: WorkersOption = None,
    backend: BackendOption = BackendName.LOKY,
    scheduler: SchedulerOption = None,
    local_cluster: LocalClusterOption = None,
    timeout_s: TimeoutOption = None,
) -> None:
    """Replicate three papers: run their campaigns, judge every claim, write tables and figures beside theirs.

    The same command continues where an earlier one was interrupted.
    """
    if full and trial:
        raise UserError("--full and --trial exclude each other")
    if in_full is not None and (full or trial or docs is None):
        raise UserError("--in-full goes with --docs, and with neither --full nor --trial")
    if in_full is not None and not (in_full / "campaigns").is_dir():
        raise UserError(f"{in_full} is no folder that make reproduce-full has written: it has no folder campaigns")
    if not campaigns.is_dir():
        raise UserError(f"there is no folder {campaigns}; run this where relnav's campaigns/ is, or give --campaigns")
    place = where(backend, workers, scheduler, local_cluster)
    check_timeout(timeout_s, backend)
    size: Size = "full" if full else "trial" if trial else "usual"
    folder = out or Path("results") / ("reproduce" if size == "usual" else f"reproduce-{size}")
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder} is a file; give --out the name of a folder")
    with ending_promptly("interrupted; what is finished is kept, and the same command continues"):
        from replication.pages import verdict_lines
        from replication.reproduce import SUMMARY_FILE, reproduce

        larger = (in_full or Path("results/reproduce-full")) if size == "usual" else None
        summary = reproduce(
            size, campaigns, folder, place.workers, docs, larger, True, _say, place.backend, place.scheduler, timeout_s
        )
        print_table(verdict_lines(summary), ("claim", "verdict", "what the main readings show"))
        say(f"wrote {folder / 'index.html'} and {folder / SUMMARY_FILE}{_beside_the_committed(summary)}")


def _beside_the_committed(summary: Summary) -> str:
    """Return how the summary compares with the one that docs/replication.md was made of, where that is at hand."""
    from replication.summary import fingerprint, read_summary, written

    path = Path("docs/replication.json")
    if not path.exists():
        return ""
    committed = read_summary(path)
    if committed.size == "mixed" and summary.size == "usual":
        same = committed.usual_sha256 == fingerprint(summary)
        return f"; the summary is {'' if same else 'not '}the one that {path} was made with"
    if committed.size != summary.size:
        return ""
    same = path.read_bytes() == written(summary).encode("utf-8")
    return f"; the summary {'is' if same else 'differs from'} {path}{', byte for byte' if same else ''}"


def _say(sentence: str) -> None:
    say(sentence, err=True)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command()(guarded(reproduce))

if __name__ == "__main__":
    app(prog_name="python -m replication")
