"""The commands, as a group that says what a mistyped or guessed one probably means, and how their help reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from relnav_sim.cli.failures import Exit
from relnav_sim.cli.output import command, say
from relnav_sim.cli.usage import UsageError, asks_for_help, usage_in_words

# What other programs call it.
_ELSEWHERE = {
    "simulate": "run", "start": "run", "resume": "run", "continue": "run", "plot": "figure", "draw": "figure",
    "check": "validate", "lint": "validate", "init": "new", "create": "new", "diff": "compare", "info": "inspect",
    "ls": "list", "describe": "show", "csv": "export", "help": "--help", "version": "--version",
}  # fmt: skip


class Command(TyperCommand):
    """A command: a mistake in its arguments is a sentence; its help names no type for a flag, which takes no value."""

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """Return the context of the arguments."""
        with _in_a_sentence():
            return super().make_context(*args, **extra)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, that of help with them."""
        return flags_unlabelled(super().get_params(ctx))


class Group(TyperGroup):
    """Commands; a mistake in the arguments of one, or a command that is not there, is a sentence."""

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """Return the context of the options before the command."""
        with _in_a_sentence():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: Any) -> Any:
        """Read the arguments of the command and run it."""
        with _in_a_sentence():
            return super().invoke(ctx)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, that of help with them."""
        return flags_unlabelled(super().get_params(ctx))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command; for one that is not there say which was probably meant, and end."""
        word = args[0] if args else ""
        if word and not word.startswith("-") and self.get_command(ctx, word) is None:
            meant = self.meant(word, ctx)
            hint = f"did you mean {meant}?" if meant else f"{ctx.command_path} --help lists the commands"
            say(f"relnav: no command is named {word!r}; {hint}", err=True)
            raise typer.Exit(Exit.BAD_INPUT)
        return super().resolve_command(ctx, args)

    def meant(self, word: str, ctx: Any) -> str:
        """Return the whole command that a word probably stands for, or nothing."""
        from relnav_sim.near_names import nearest

        near = nearest(word, self.list_commands(ctx))
        return f"{ctx.command_path} {near}" if near else ""


class Commands(Group):
    """The commands of relnav, which know what other programs call them."""

    def meant(self, word: str, ctx: Any) -> str:
        """Return the whole command that a word probably stands for, or nothing."""
        return _meant(word, self.list_commands(ctx))


@contextmanager
def _in_a_sentence() -> Iterator[None]:
    try:
        yield
    except UsageError as error:
        if asks_for_help(error):
            raise
        say(usage_in_words(error), err=True)
        raise typer.Exit(Exit.BAD_INPUT) from None


def flags_unlabelled(params: list[Any]) -> list[Any]:
    """Return parameters whose help names no type for flags, which take no value."""
    for param in params:
        if getattr(param, "is_flag", False) and param.metavar is None:
            param.metavar = ""
    return params


def _meant(word: str, commands: list[str]) -> str:
    """Return the whole command that a word stands for, or nothing."""
    from relnav_sim.cli.listing import LISTS
    from relnav_sim.near_names import nearest

    plain = word.casefold()
    if plain in _ELSEWHERE:
        return f"relnav {_ELSEWHERE[plain]}"
    if plain in LISTS or f"{plain}s" in LISTS:
        return f"relnav list {plain if plain in LISTS else f'{plain}s'}"
    path = Path(word)
    if path.suffix in (".yaml", ".yml", ".h5") and path.exists():
        return command("relnav", "report" if path.suffix == ".h5" else "run", word)
    near = nearest(word, [*commands, *LISTS])
    if near is not None:
        return f"relnav {near}" if near in commands else f"relnav list {near}"
    from relnav_sim.cli.show import kinds_of

    kinds = kinds_of(plain)
    return f"relnav show {kinds[0]} {plain}" if kinds else ""
