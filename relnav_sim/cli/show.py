"""`relnav show`: one filter, sensor, dynamics or noise, with every option."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import print_table


class What(StrEnum):
    """What can be shown."""

    FILTER = "filter"
    SENSOR = "sensor"
    DYNAMICS = "dynamics"
    NOISE = "noise"


def show(
    what: Annotated[What, typer.Argument(help="filter, sensor, dynamics or noise.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its name; `relnav list` shows the names.")],
) -> None:
    """Show what a filter, a sensor, dynamics or a noise is, where it comes from and its options."""
    from relnav_sim.campaign.problems import did_you_mean
    from relnav_sim.cli.catalogue import entries

    known = {entry.name: entry for entry in entries(what.value)}
    if name not in known:
        hint = did_you_mean(name, known) or f"; there are {', '.join(known)}"
        raise UserError(f"there is no {what.value} {name!r}{hint}")
    entry = known[name]
    typer.echo(f"{entry.name}: {entry.description}\n")
    print_table(
        [(key.name, key.takes.replace("`", ""), key.default, key.meaning.replace("`", "")) for key in entry.keys],
        headings=("key", "takes", "default", "meaning"),
    )
