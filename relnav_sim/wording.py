"""Numbers and lists in sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

MINUS = "\N{MINUS SIGN}"
MISSING = "\N{EN DASH}"
MOST_DECIMALS = 6
_LARGEST_PLAIN = 1e5
_PATH = r"(?:(?<=[ ,])|^)(?:[A-Za-z_]\w*\.)+(?P<last>[A-Za-z_]\w*\.[A-Za-z_]\w*=)"


def shown_number(value: float, decimals: int) -> str:
    """Return a number as text: plain with ``decimals``, or with an exponent where it is huge."""
    if math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    lost = decimals >= MOST_DECIMALS and 0 < abs(value) < 0.5 * 10.0**-MOST_DECIMALS
    text = f"{value:.2e}" if abs(value) >= _LARGEST_PLAIN else f"{value:.0e}" if lost else f"{value:.{decimals}f}"
    if text.startswith("-") and not text.strip("-0."):
        text = text[1:]
    return text.replace("-", MINUS, 1) if text.startswith("-") else text


def shown_end(value: float, decimals: int) -> str:
    """Return an end of an interval as text: with more ``decimals`` where it would else seem to be 0 and is not.

    Whether zero lies in an interval is its verdict, so that 0.206 to 7.42 must not read as 0 to 7.

    Example:
        >>> shown_end(7.42, 0), shown_end(0.206, 0), shown_end(0.0, 0)
        ('7', '0.2', '0')
    """
    if 0 < abs(value) < 0.5 * 10.0**-decimals:
        decimals = min(MOST_DECIMALS, -math.floor(math.log10(abs(value))))
    return shown_number(value, decimals)


def significant(value: float, digits: int = 3) -> str:
    """Return a number for a sentence: so many significant digits, no exponent unless it is huge or tiny."""
    if not math.isfinite(value) or value == 0:
        return shown_number(value, 0)
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.2e}" if decimals > 7 else shown_number(value, decimals)


def with_prefix(value: float, unit: str = "") -> str:
    """Return a number of three digits with a decimal prefix before its unit: ``1.24 k``, ``1.49 kB``, ``744 B``."""
    for size, prefix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * size:
            return f"{significant(value / size)} {prefix}{unit}"
    return f"{significant(value)} {unit}".rstrip()


def between(low: float, high: float) -> str:
    """Return an interval for a sentence, or nothing where there is none."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f" [{significant(low)}, {significant(high)}]"


def listed(words: Sequence[str]) -> str:
    """Return ``a``, ``a and b`` or ``a, b and c``."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"


def first_of(words: Sequence[str], most: int = 6) -> str:
    """Return ``a, b, c``, of very many words the first, and how many more there are: ``a, b and 8 more``."""
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


def counted(number: int, noun: str) -> str:
    """Return ``1 run`` or ``7 runs``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def short_labels(labels: Sequence[str]) -> list[str]:
    """Return labels of cases with the last two parts of each path, as ``radar.range_sigma_m=4``.

    Labels stay whole where the short ones would not tell the cases apart, or a path is no plain dotted name.
    """
    short = [re.sub(_PATH, r"\g<last>", label) for label in labels]
    return short if len(set(short)) == len(labels) else list(labels)
