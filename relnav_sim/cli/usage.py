"""A mistake in the arguments of a command as one sentence, in the style of every other mistake."""

from __future__ import annotations

from typing import Any

import typer

UsageError: type[Exception] = typer.BadParameter.__bases__[0]
"""What the parser of the command line raises; `typer` has it under no name of its own."""

_BOUNDS = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
_TYPES = {"int_parsing": "a whole number", "int_from_float": "a whole number", "float_parsing": "a number"}


def asks_for_help(error: Exception) -> bool:
    """Return whether the error is no mistake: a group without a command shows its help."""
    return type(error).__name__ == "NoArgsIsHelpError"


def usage_in_words(error: Any) -> str:
    """Return what is wrong with the arguments, and where the right ones are listed."""
    context = error.ctx
    command = context.command_path if context is not None else "relnav"
    wrong = _wrong(error)
    if wrong.endswith("?"):
        return f"relnav: {wrong}"
    lists = "lists the commands" if wrong == "missing command" else "lists its options"
    return f"relnav: {wrong}; {command} --help {lists}"


def _wrong(error: Any) -> str:
    from pydantic import ValidationError  # not before help, which needs none of it

    cause = error.__cause__
    option = getattr(error, "param", None)
    if isinstance(cause, ValidationError) and option is not None:
        detail = cause.errors()[0]
        name = max(option.opts, key=len) if option.param_type_name == "option" else option.human_readable_name
        if expected := _expected(dict(detail)):
            return f"{name} must be {expected}, not {detail['input']!r}"
        return f"{name}: {detail['msg'].removeprefix('Value error, ').rstrip('.')}"
    if near := getattr(error, "possibilities", None):
        return f"no option is named {error.option_name}; did you mean {' or '.join(sorted(near))}?"
    message = str(error.format_message()).rstrip(".")
    return message[:1].lower() + message[1:]


def _expected(detail: dict[str, Any]) -> str:
    """Return what a value must be, empty where only the parser's own words say it."""
    if detail["type"] in _BOUNDS:
        words, limit = _BOUNDS[detail["type"]]
        return f"{words} {detail['ctx'][limit]}"
    return _TYPES.get(detail["type"], "")
