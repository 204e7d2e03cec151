"""Tables of Markdown, and numbers in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from relnav_sim.report.tables import plain_markdown

_COLUMNS = {"ekf": "EKF", "ukf": "UKF", "alpha_kf": "alpha filter"}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    lines = ["| " + " | ".join(head) + " |", "|" + ":--|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    """Return text so that Markdown shows it as written."""
    return plain_markdown(text)


def column_words(name: str) -> str:
    """Return a column of a printed table, or a table alone, as words.

    Example:
        >>> column_words("table_2 ekf"), column_words("table_4 alpha=0.5"), column_words("all tables")
        ('Table 2, EKF', 'Table 4, α = 0.5', 'all tables')
    """
    where, _, column = name.partition(" ")
    if not where.startswith("table_"):
        return name
    told = _COLUMNS.get(column, column.replace("alpha=", "α = "))
    return f"Table {where.removeprefix('table_')}" + (f", {told}" if told else "")


def number_words(name: str) -> str:
    """Return a printed number as words.

    Example:
        >>> number_words("table_2 ekf vz std")
        'Table 2, EKF, vz std'
    """
    where, column, label = name.split(" ", 2)
    return f"{column_words(f'{where} {column}')}, {label}"


def percent(share: float, decimals: int = 0) -> str:
    """Return a share in per cent."""
    return f"{100 * share:.{decimals}f} %"


def plain(value: float, digits: int = 2) -> str:
    """Return a number to so many digits, with an exponent only where it is huge or tiny.

    Example:
        >>> plain(16815.0), plain(0.0036), plain(7.04e-9), plain(46.4)
        ('17000', '0.0036', '7e-9', '46')
    """
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0 or 1e-3 <= abs(rounded) < 1e6:
        return f"{rounded:.{max(0, digits - 1 - _power(rounded))}f}".removesuffix(".0") if rounded else "0"
    mantissa, power = f"{rounded:.{digits - 1}e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(power)}"


def _power(value: float) -> int:
    return math.floor(math.log10(abs(value)))


def deviation(value: float) -> str:
    """Return a signed number of standard deviations: one decimal, none from ten on."""
    return f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.1f}"
