"""`relnav list`: what campaigns can name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.library import campaigns_of, library_summaries
from relnav_sim.cli.output import print_table, say

LISTS = ("filters", "sensors", "dynamics", "noise", "campaigns", "templates")


def list_names(
    what: Annotated[
        str, typer.Argument(metavar="WHAT", help="filters, sensors, dynamics, noise, campaigns or templates.")
    ],
) -> None:
    """List filters, sensors, dynamics, noise, or campaigns: those of this folder and of the library (templates)."""
    what = f"{what}s" if f"{what}s" in LISTS else what
    if what not in LISTS:
        from relnav_sim.campaign.problems import no_such

        raise UserError(no_such("list", what, LISTS))
    if what == "campaigns":
        _campaigns(campaigns_of(Path()))
    elif what == "templates":
        print_table(library_summaries())
    else:
        from relnav_sim.cli.catalogue import entries

        found = [(entry.name, *entry.cost, entry.summary) for entry in entries(what)]
        print_table(found, ("filter", "operations", "bytes", "what it is") if what == "filters" else ())
        if what == "filters":
            say("\nOperations and bytes of one epoch of one run with 6 states and 3 channels, by formula.")


def _campaigns(here: Sequence[tuple[Path, str]]) -> None:
    """Print the campaigns of this folder and those of the library."""
    if here:
        say("In this folder:\n")
        print_table([(str(path), words) for path, words in here])
        say("")
    say("In the library; to have one: relnav new my.yaml --from NAME\n")
    print_table(library_summaries())
