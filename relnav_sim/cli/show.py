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
    if what is What.FILTER:
        typer.echo("\nrelnav tune searches:")
        print_table(_tunable(name))


def _tunable(filter: str) -> list[tuple[str, str]]:
    """Return the numbers of a filter that `relnav tune` searches, with their ranges."""
    from relnav_sim.campaign.entries import FilterEntry
    from relnav_sim.campaign.problems import dotted
    from relnav_sim.filters.registry import filter_kinds
    from relnav_sim.tuning.scalars import marked

    rows = []
    for path, mark in (*marked(FilterEntry), *marked(filter_kinds()[filter].options_model)):
        words = f"{mark.low:g} to {mark.high:g}{', on a logarithmic scale' if mark.log else ''}"
        if mark.when is not None:
            words += f", where {mark.when[0]} is {mark.when[1]}"
        if mark.scales_noise:
            words += ", where the objective counts the covariance"
        rows.append((dotted(path), words))
    return rows
