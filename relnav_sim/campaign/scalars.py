"""Unquoted YAML values: what is a number, a boolean or nothing, and what is refused as a trap.

The rules are those of YAML 1.2's core schema, narrowed: spellings that YAML 1.1 tools read as another
number (``010`` as 8, ``1_000`` as 1000, ``12:30`` as 750) are refused with a sentence, so that no file
means one thing here and another elsewhere.
"""

from __future__ import annotations

import math
import re

Scalar = str | int | float | bool | None

_INTEGER = re.compile(r"[-+]?[0-9]+")
_REAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?")
_UNDERSCORES = re.compile(r"[-+]?[0-9][0-9_]*_[0-9_]*(\.[0-9_]*)?([eE][-+]?[0-9_]+)?")
_OTHER_BASE = re.compile(r"[-+]?0([xX]_*[0-9a-fA-F][0-9a-fA-F_]*|[oO]_*[0-7][0-7_]*|[bB]_*[01][01_]*)")
_SEXAGESIMAL = re.compile(r"[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9]*)?")
_COMMAS = re.compile(r"[-+]?[0-9]+(,[0-9]+)+(\.[0-9]*)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF|nan|NaN|NAN)")

_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
}

LONGEST_NUMBER = 40
"""Digits and signs in a number; more is a slip, and long integers would not fit a result file."""


class RefusedScalarError(ValueError):
    """An unquoted value that looks like a number to some readers and not to others."""


def resolve(text: str) -> Scalar:
    """Return the value of an unquoted YAML scalar.

    Args:
        text: The scalar as written, without surrounding space.

    Raises:
        RefusedScalarError: The value is ambiguous or not finite; the message is a sentence for people.
    """
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in "+-.0123456789":
        return text
    if len(text) > LONGEST_NUMBER:
        if _REAL.fullmatch(text):
            raise RefusedScalarError(
                f"the number {text[:12]}... has {len(text)} digits; at most {LONGEST_NUMBER} are read"
            )
        return text
    if _LEADING_ZERO.fullmatch(text):
        plain = text.lstrip("+-0") or "0"
        raise RefusedScalarError(
            f"{text} has a leading zero, which some readers take as octal; write {_sign(text)}{plain}{_or_quotes(text)}"
        )
    if _UNDERSCORES.fullmatch(text):
        raise RefusedScalarError(f"{text} has underscores; write {text.replace('_', '')}{_or_quotes(text)}")
    if _OTHER_BASE.fullmatch(text):
        raise RefusedScalarError(
            f"{text} is not a decimal number; write {int(text.replace('_', ''), 0)}{_or_quotes(text)}"
        )
    if _SEXAGESIMAL.fullmatch(text):
        raise RefusedScalarError(
            f"{text} is a base-60 number to some readers; write seconds or degrees as a plain number{_or_quotes(text)}"
        )
    if _COMMAS.fullmatch(text):
        raise RefusedScalarError(
            f"{text} has a comma; write a decimal point and no thousands separators{_or_quotes(text)}"
        )
    if _NOT_FINITE.fullmatch(text):
        raise RefusedScalarError(f"{text} is not a finite number; no key takes infinity or not-a-number")
    if _INTEGER.fullmatch(text):
        return int(text)
    if _REAL.fullmatch(text):
        value = float(text)
        if not math.isfinite(value):
            raise RefusedScalarError(f"{text} is larger than any double-precision number")
        return value
    return text


def _sign(text: str) -> str:
    return "-" if text.startswith("-") else ""


def _or_quotes(text: str) -> str:
    return f', or "{text}" in quotes for text'
