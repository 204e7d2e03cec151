"""Numbers as files of measurements have them: finite decimals, and nothing that only Python takes for a number."""

from __future__ import annotations

import math
import re

_FORM = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?", re.ASCII)


def number(text: str) -> float:
    """Return the number that a text is.

    Raises:
        ValueError: It is none, or not finite; the message goes on after the text: ``is no number``.
    """
    if _FORM.fullmatch(text) is None:
        if text.casefold().lstrip("+-") in {"nan", "inf", "infinity", "na", "null", "none", "n/a", "-"}:
            raise ValueError("is no number; leave a missing measurement out")
        if re.fullmatch(r"[+-]?\d+,\d+", text):
            raise ValueError("has a decimal comma; write a decimal point")
        raise ValueError("is no number")
    value = float(text.replace("D", "e").replace("d", "e"))  # exponents of Fortran
    if not math.isfinite(value):
        raise ValueError("is too large for a number of 64 bits")
    return value
