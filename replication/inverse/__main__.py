"""`python -m replication.inverse`: which unreported settings give a paper's printed numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import UserError, guarded
from relnav_sim.cli.group import Command, Group
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.output import say

if TYPE_CHECKING:
    from replication.inverse.bank import Paper


PAPERS = ("alpha_kf", "mf_upf", "mf_upf_learned", "two_step_kf")
"""Names of papers.yaml; mf_upf_learned is the second bank of mf_upf."""
PaperArgument = Annotated[str, typer.Argument(metavar="PAPER", help=f"{{{'|'.join(PAPERS)}}}.")]
OutOption = Annotated[Path, typer.Option(metavar="FOLDER", help="The folder with the banks.")]
FindingsOption = Annotated[Path, typer.Option(metavar="FILE", help="The file of findings.")]
OUT, FILE = Path("results/inverse"), Path("replication/inverse/findings.json")


app = typer.Typer(cls=Group, add_completion=False, pretty_exceptions_enable=False)


def bank(
    paper: PaperArgument,
    out: OutOption = OUT,
    size: Annotated[int, typer.Option(metavar="N", help="Number of settings, in whole blocks.", min=1)] = 20_000,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of settings and noise.", min=0)] = 20251130,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes that fill it.", min=1)] = 1,
) -> None:
    """Draw settings from the prior and fly each once; the same command goes on where it was interrupted."""
    from replication.inverse.bank import fill

    with ending_promptly("interrupted; finished blocks are kept, and the same command continues"):
        made = fill(_paper(paper), out / paper, size, seed, workers, _say)
    say(
        f"{len(made.numbers)} settings in {out / paper}, {made.cpu_s / 3600:.2f} hours of processor time, {made.digest}"
    )


def infer(
    paper: PaperArgument,
    out: OutOption = OUT,
    size: Annotated[
        int | None, typer.Option(metavar="N", help="Settings of the bank to use.", show_default="all")
    ] = None,
    batches: Annotated[
        int, typer.Option(metavar="N", help="Batches of starts that a search for a best setting has at most.", min=1)
    ] = 3,
    findings: FindingsOption = FILE,
) -> None:
    """Judge claims and sentences by the bank, and search the setting that comes nearest to all printed numbers."""
    from replication.inverse.bank import read
    from replication.inverse.findings import add_findings
    from replication.inverse.judging import judged_paper

    made = _paper(paper)
    add_findings(paper, judged_paper(made, read(made, out / paper, size), batches, _say), findings)
    say(f"wrote {findings}")


def check(
    paper: PaperArgument,
    out: OutOption = OUT,
    size: Annotated[
        int | None, typer.Option(metavar="N", help="Settings of the bank to use.", show_default="all")
    ] = None,
    rounds: Annotated[
        int, typer.Option(metavar="N", help="Rounds of the search for papers like the printed one.", min=1)
    ] = 2,
    each: Annotated[int, typer.Option(metavar="N", help="Papers flown in a round.", min=50)] = 2500,
    findings: FindingsOption = FILE,
) -> None:
    """Check the inference on synthetic papers: coverage of their settings, and power against a forged column."""
    from replication.inverse.bank import read
    from replication.inverse.findings import add_findings
    from replication.inverse.study import studied

    made = _paper(paper)
    add_findings(paper, studied(made, read(made, out / paper, size), rounds, each, _say), findings)
    say(f"wrote {findings}")


def page(
    docs: Annotated[Path, typer.Option(metavar="FOLDER", help="The folder of the page and its files.")] = Path("docs"),
    findings: FindingsOption = FILE,
) -> None:
    """Write the page of settings, replication-settings.md, and the two CSV files beside it from the findings."""
    from replication.inverse.findings import read_findings
    from replication.inverse.page import PAGE, page_of
    from replication.inverse.page_files import files_of

    found = read_findings(findings)
    for name, text in {PAGE: page_of(found), **files_of(found)}.items():
        (docs / name).write_text(text, encoding="utf-8")
        say(f"wrote {docs / name}")


def _say(line: str) -> None:
    say(line, err=True)


def _paper(name: str) -> Paper:
    from replication.inverse.alpha_kf import AlphaKf
    from replication.inverse.mf_upf import MfUpf
    from replication.inverse.mf_upf_learned import MfUpfLearned
    from replication.inverse.two_step import TwoStep

    made: list[Paper] = [AlphaKf(), MfUpf(), MfUpfLearned(), TwoStep()]
    found = next((paper for paper in made if paper.name == name), None)
    if found is None:
        raise UserError(f"there is no paper {name!r}; give one of {', '.join(PAPERS)}")
    return found


@app.callback()
def inverse() -> None:
    """Which unreported settings give a paper's printed numbers, or that none do."""


for command in (bank, infer, check, page):
    app.command(cls=Command)(guarded(command))

if __name__ == "__main__":
    app(prog_name="python -m replication.inverse")
