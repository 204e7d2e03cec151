"""Cells of CSV files that spreadsheets show as written instead of computing them."""

from __future__ import annotations

from typing import Any

from relnav_sim.printable import visible

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def csv_cell(value: Any) -> Any:
    """Return a cell for a CSV file: NaN empty, other numbers as they are, text that no spreadsheet takes for a formula.

    Text that begins with ``=``, ``+``, ``-`` or ``@`` gets an apostrophe before it, as OWASP recommends against CSV
    injection; text that is a number stays.
    """
    if not isinstance(value, str):
        return "" if value != value else value
    return visible(f"'{value}" if value.lstrip(" ").startswith(_FORMULA) and not _is_number(value) else value)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
