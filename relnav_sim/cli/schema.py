"""`relnav schema`: the JSON schema of campaign files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.output import new_file


def schema(
    out: Annotated[Path | None, typer.Option(help="Write to this file instead of the terminal.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Print the JSON schema of campaign files, from which editors complete and check keys."""
    from relnav_sim.campaign.schema import schema_text

    text = schema_text()
    if out is None:
        typer.echo(text, nl=False)
    else:
        new_file(out, overwrite).write_text(text, encoding="utf-8")
        typer.echo(f"wrote {out}")
