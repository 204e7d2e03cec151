"""`python -m replication.inverse`: which unreported settings give a paper's printed numbers."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import UserError, guarded
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.output import say

if TYPE_CHECKING:
    from replication.inverse.bank import Paper


class PaperName(StrEnum):
    """The papers, by their names in papers.yaml."""

    ALPHA_KF = "alpha_kf"


PaperArgument = Annotated[PaperName, typer.Argument(help="The paper.")]
OutOption = Annotated[Path, typer.Option(help="The folder with the banks.")]
OUT = Path("results/inverse")
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def bank(
    paper: PaperArgument,
    out: OutOption = OUT,
    size: Annotated[int, typer.Option(help="Number of settings, in blocks of 100.", min=100)] = 20_000,
    seed: Annotated[int, typer.Option(help="Seed of settings and noise.", min=0)] = 20251130,
    workers: Annotated[int, typer.Option(help="Processes that fill it.", min=1)] = 1,
) -> None:
    """Draw settings from the prior and fly each once; the same command goes on where it was interrupted."""
    from replication.inverse.bank import fill

    if size % 100:
        raise UserError(f"--size is {size}; give a multiple of 100")
    with ending_promptly("interrupted; finished blocks are kept, and the same command continues"):
        made = fill(_paper(paper), out / paper, size, seed, workers, lambda line: say(line, err=True))
    say(f"{len(made.numbers)} settings in {out / paper}, {made.cpu_s / 3600:.2f} hours of processor time, {made.digest}")


def _paper(name: PaperName) -> Paper:
    from replication.inverse.alpha_kf import AlphaKf

    return {PaperName.ALPHA_KF: AlphaKf}[name]()


@app.callback()
def inverse() -> None:
    """Which unreported settings give a paper's printed numbers, or that none do."""


app.command()(guarded(bank))

if __name__ == "__main__":
    app(prog_name="python -m replication.inverse")
