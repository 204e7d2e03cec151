"""`relnav list`: what campaigns can name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.library import campaigns_of, library_summaries
from relnav_sim.cli.output import print_table, say

LISTS = {
    "filters": "kinds of filters, with what an epoch costs",
    "sensors": "kinds of sensors",
    "dynamics": "models of relative motion",
    "noise": "kinds of sensor noise",
    "figures": "what relnav figure draws",
    "campaigns": "campaigns of this folder and of the library",
    "templates": "campaigns of the library, for relnav new --from NAME",
}


def list_names(
    what: Annotated[
        str | None,
        typer.Argument(metavar="WHAT", help=f"{', '.join(LISTS)}.", show_default="(what can be listed)"),
    ] = None,
) -> None:
    """List filters, sensors, dynamics, noise, figures, or campaigns: of this folder and the library (templates)."""
    if what is None:
        print_table([(f"relnav list {name}", words) for name, words in LISTS.items()])
        return
    what = f"{what}s" if f"{what}s" in LISTS else what
    if what not in LISTS:
        from relnav_sim.campaign.problems import no_such

        raise UserError(no_such("list", what, list(LISTS)))
    if what == "campaigns":
        _campaigns(campaigns_of(Path()))
    elif what == "figures":
        from relnav_sim.plots import FIGURE_KINDS

        print_table([(name, kind.shows) for name, kind in FIGURE_KINDS.items()])
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
