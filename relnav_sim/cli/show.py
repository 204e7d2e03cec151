"""`relnav show`: one filter, sensor, dynamics or noise, with every option."""

from __future__ import annotations

from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import print_table, say

KINDS = ("filter", "sensor", "dynamics", "noise")


def show(
    what: Annotated[str, typer.Argument(metavar="WHAT", help="filter, sensor, dynamics or noise; may be left out.")],
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Its name; `relnav list` shows the names.", show_default=False)
    ] = "",
) -> None:
    """Show what a filter, a sensor, dynamics or a noise is, where it comes from and its options."""
    from relnav_sim.campaign.problems import no_such
    from relnav_sim.cli.catalogue import entries

    kind = what if what in KINDS else what.removesuffix("s")
    if not name:
        kind, name = _found(what)
    if kind not in KINDS:
        raise UserError(f"{no_such('kind', what, KINDS)}; write for example: relnav show filter ekf")
    known = {entry.name: entry for entry in entries(kind)}
    if name not in known:
        raise UserError(no_such(kind, name, known))
    entry = known[name]
    say(f"{entry.name}: {entry.description}\n")
    print_table(
        [(key.name, key.takes.replace("`", ""), key.default, key.meaning.replace("`", "")) for key in entry.keys],
        headings=("key", "takes", "default", "meaning"),
    )
    if kind == "filter":
        say("\nrelnav tune searches:")
        print_table(_tunable(name))


def kinds_of(name: str) -> list[str]:
    """Return what has this name: filters, sensors, dynamics, noises."""
    from relnav_sim.cli.catalogue import entries

    return [kind for kind in KINDS if any(entry.name == name for entry in entries(kind))]


def _found(name: str) -> tuple[str, str]:
    """Return the kind and the name of the one thing that is called so."""
    from relnav_sim.campaign.problems import did_you_mean, listed
    from relnav_sim.cli.catalogue import entries

    names = {kind: [entry.name for entry in entries(kind)] for kind in KINDS}
    kinds = kinds_of(name)
    if len(kinds) == 1:
        return kinds[0], name
    if kinds:
        raise UserError(f"{name!r} is several things: {listed([f'relnav show {kind} {name}' for kind in kinds])}")
    if (kind := name if name in KINDS else name.removesuffix("s")) in KINDS:
        raise UserError(f"give a name too, as relnav show {kind} {names[kind][0]}; there are {', '.join(names[kind])}")
    everything = [one for kind in KINDS for one in names[kind]]
    raise UserError(f"nothing is named {name!r}{did_you_mean(name, everything) or '; relnav list filters shows names'}")


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
