"""`relnav schema`: the JSON schema of campaign files."""

from __future__ import annotations

from typing import Annotated

import typer

from relnav_sim.cli.files import target_file
from relnav_sim.cli.output import new_file, say


def schema(
    out: Annotated[
        str | None, typer.Option(metavar="PATH", help="Write to this file, or schema.json in this folder, instead.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Print the JSON schema of campaign files, from which editors complete and check keys."""
    from relnav_sim.campaign.schema import schema_text

    text = schema_text()
    if out is None:
        say(text, nl=False)
    else:
        path = new_file(target_file(out, "schema.json"), overwrite)
        path.write_text(text, encoding="utf-8")
        say(f"wrote {path}")
