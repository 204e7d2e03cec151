"""`relnav list`: what campaigns can name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.new import TEMPLATES
from relnav_sim.cli.output import print_table, say

LISTS = ("filters", "sensors", "dynamics", "noise", "campaigns", "templates")


def list_names(
    what: Annotated[
        str, typer.Argument(metavar="WHAT", help="filters, sensors, dynamics, noise, campaigns or templates.")
    ],
) -> None:
    """List the filters, sensors, dynamics, kinds of noise, the campaigns of this folder, or what `new` starts from."""
    what = f"{what}s" if f"{what}s" in LISTS else what
    if what not in LISTS:
        from relnav_sim.campaign.problems import no_such

        raise UserError(no_such("list", what, LISTS))
    rows: list[tuple[str, ...]]
    headings: tuple[str, ...] = ()
    if what == "campaigns":
        rows = [(str(path), _first_words(path)) for path in campaign_files(Path())]
    elif what == "templates":
        rows = list(TEMPLATES.items())
    else:
        from relnav_sim.cli.catalogue import entries

        found = entries(what)
        rows = [(entry.name, *entry.cost, entry.summary) for entry in found]
        if what == "filters":
            headings = ("filter", "operations", "bytes", "what it is")
    if rows:
        print_table(rows, headings)
        if headings:
            say("\nOperations and bytes of one epoch of one run with 6 states and 3 channels, by formula.")
    else:
        say("there are none here; write one with: relnav new FILE")


def campaign_files(folder: Path) -> list[Path]:
    """Return the YAML files in a folder and in its `campaigns/`."""
    found = (path for pattern in ("*.yaml", "campaigns/*.yaml") for path in folder.glob(pattern))
    return sorted(path for path in found if not path.name.startswith("."))


def _first_words(path: Path) -> str:
    """Return the first comment of a campaign file, which says what it is for."""
    with open(path, encoding="utf-8", errors="replace") as file:
        for line, _ in zip(file, range(20), strict=False):
            words = line.removeprefix("#").strip()
            if line.startswith("#") and words and not words.startswith("yaml-language-server"):
                return words
    return ""
