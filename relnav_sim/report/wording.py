"""Numbers and lists in sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from relnav_sim.report.tables import shown_number

_PATH = r"(?:(?<=[ ,])|^)(?:[A-Za-z_]\w*\.)+(?P<last>[A-Za-z_]\w*\.[A-Za-z_]\w*=)"


def figure(value: float, digits: int = 3) -> str:
    """Return a number for a sentence: so many significant digits, no exponent unless it is huge or tiny."""
    if not math.isfinite(value) or value == 0:
        return shown_number(value, 0)
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.2e}" if decimals > 7 else shown_number(value, decimals)


def between(low: float, high: float) -> str:
    """Return an interval for a sentence, or nothing where there is none."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f" [{figure(low)}, {figure(high)}]"


def listed(words: Sequence[str]) -> str:
    """Return ``a``, ``a and b`` or ``a, b and c``."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"


def counted(number: int, noun: str) -> str:
    """Return ``1 run`` or ``7 runs``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def short_labels(labels: Sequence[str]) -> list[str]:
    """Return labels of cases with the last two parts of each path, as ``radar.range_sigma_m=4``.

    Labels stay whole where the short ones would not tell the cases apart, or a path is no plain dotted name.
    """
    short = [re.sub(_PATH, r"\g<last>", label) for label in labels]
    return short if len(set(short)) == len(labels) else list(labels)
