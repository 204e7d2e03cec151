"""`relnav new`: a campaign to start from."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.library import FIRST, library_names, library_summaries, library_text
from relnav_sim.cli.output import command, say

LIBRARY_HELP = "\n\n".join(["The library:", *(f"{name}: {words}" for name, words in library_summaries())])


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write, for example my.yaml.")],
    template: Annotated[
        str, typer.Option("--from", metavar="NAME", help=f"What to start from: {', '.join(library_names())}.")
    ] = FIRST,
) -> None:
    """Write a small commented campaign of the library to start from, with a schema beside it for editors."""
    if template not in library_names():
        from relnav_sim.campaign.problems import no_such

        raise UserError(no_such("template", template, library_names()))
    if file.name in ("", ".", "..") or file.is_dir():
        raise UserError(f"'{file}' names no file; give one to write, for example my.yaml")
    from relnav_sim.campaign.schema import schema_text

    schema = file.with_name("schema.json")
    try:
        with open(file, "x", encoding="utf-8") as stream:
            stream.write(library_text(template, _name_of(file)))
    except FileExistsError:
        raise UserError(f"{file} exists already; nothing was written") from None
    beside = ""
    if not schema.exists():
        schema.write_text(schema_text(), encoding="utf-8")
        beside = f" and {schema} (for completion in editors; relnav does not need it)"
    say(f"wrote {file}{beside}; next: {command('relnav', 'validate', file)}, then: {command('relnav', 'run', file)}")


def _name_of(file: Path) -> str:
    """Return a campaign's name from its file's name."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", file.stem).lstrip("_.-")[:64] or "campaign"
