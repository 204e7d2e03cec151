"""`relnav new`: a campaign to start from."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import command, say

TEMPLATES = {
    "demo": "two filters and a radar in low orbit, with every section explained",
    "leo": "a deputy that trails by 5 km; air by altitude, its density uncertain",
    "sso": "a safety ellipse seen by differential GNSS, under a real gravity field",
    "geo": "around a geostationary client: crosslink and camera, Sun, Moon and sunlight",
    "eccentric": "an eccentric orbit, with dynamics that know of it and some that do not",
    "angles-only": "a camera alone, with and without a known manoeuvre",
    "rendezvous": "from one hold point on V-bar to the next",
}
"""Campaigns to start from, in the order of a reader's way; each a file in `campaign/templates`."""

TEMPLATES_HELP = "\n\n".join(["Templates:", *(f"{name}: {words}" for name, words in TEMPLATES.items())])


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write, for example my.yaml.")],
    template: Annotated[
        str, typer.Option("--from", metavar="TEMPLATE", help=f"What to start from: {', '.join(TEMPLATES)}.")
    ] = "demo",
) -> None:
    """Write a small commented campaign to start from, with a schema beside it for editors."""
    from relnav_sim.campaign.problems import no_such
    from relnav_sim.campaign.schema import schema_text
    from relnav_sim.campaign.template import template_text

    if template not in TEMPLATES:
        raise UserError(no_such("template", template, TEMPLATES))
    if file.name in ("", ".", "..") or file.is_dir():
        raise UserError(f"'{file}' names no file; give one to write, for example my.yaml")
    schema = file.with_name("schema.json")
    try:
        with open(file, "x", encoding="utf-8") as stream:
            stream.write(template_text(_name_of(file), template))
    except FileExistsError:
        raise UserError(f"{file} exists already; nothing was written") from None
    if not schema.exists():
        schema.write_text(schema_text(), encoding="utf-8")
    say(f"wrote {file}; next: {command('relnav', 'validate', file)}, then: {command('relnav', 'run', file)}")


def _name_of(file: Path) -> str:
    """Return a campaign's name from its file's name."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", file.stem).lstrip("_.-")[:64] or "campaign"
