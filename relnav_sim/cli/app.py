"""`relnav`: the commands in one place. Each loads what it needs when it runs, so that help comes at once."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Annotated

import typer

from relnav_sim.cli.budget import budget
from relnav_sim.cli.compare import compare
from relnav_sim.cli.export import export
from relnav_sim.cli.failures import EXIT_CODES, guarded
from relnav_sim.cli.figure import figure
from relnav_sim.cli.group import Command, Commands
from relnav_sim.cli.inspect import inspect
from relnav_sim.cli.listing import list_names
from relnav_sim.cli.merge import merge
from relnav_sim.cli.new import LIBRARY_HELP, new
from relnav_sim.cli.replay import replay
from relnav_sim.cli.report import report
from relnav_sim.cli.run import run
from relnav_sim.cli.schema import schema
from relnav_sim.cli.show import show
from relnav_sim.cli.status import status
from relnav_sim.cli.tune import tune
from relnav_sim.cli.validate import validate

_CODES_HELP = "\n\n".join(["Exit codes:", *(f"{code}: {meaning}" for code, meaning in EXIT_CODES.items())])

app = typer.Typer(
    name="relnav",
    cls=Commands,
    help="Monte Carlo campaigns that tell which relative-navigation filter to fly.",
    epilog=f"Start with: relnav new my.yaml, relnav run my.yaml, relnav report\n\n{_CODES_HELP}",
    no_args_is_help=True,
    context_settings={"help_option_names": ["--help", "-h"]},
    pretty_exceptions_enable=False,
)

COMMANDS: dict[str, Callable[..., None]] = {
    "run": run,
    "report": report,
    "figure": figure,
    "validate": validate,
    "budget": budget,
    "tune": tune,
    "replay": replay,
    "list": list_names,
    "show": show,
    "new": new,
    "schema": schema,
    "inspect": inspect,
    "status": status,
    "compare": compare,
    "merge": merge,
    "export": export,
}
ANSWERS = ("validate", "budget", "list", "show", "schema", "inspect", "status", "compare")
"""Commands that print what they find out; the others write files or have another purpose."""

_EPILOGS = {"run": _CODES_HELP, "new": LIBRARY_HELP}

for name, command in COMMANDS.items():
    app.command(name, cls=Command, epilog=_EPILOGS.get(name))(guarded(command, answers=name in ANSWERS))


def _print_version(wanted: bool) -> None:
    if wanted:
        from relnav_sim import __version__

        typer.echo(f"relnav {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Monte Carlo campaigns that tell which relative-navigation filter to fly."""


def main() -> None:
    """Run the command line."""
    warnings.formatwarning = _in_a_line
    app()


def _in_a_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """Return a warning to the user as a sentence without the line of the source."""
    if category is not UserWarning:
        return _FORMAT(message, category, filename, lineno, line)
    return f"relnav: {message}\n"


_FORMAT = warnings.formatwarning
