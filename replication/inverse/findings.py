"""The file of findings: what banks and searches have said of each paper, small enough to be committed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from replication.inverse.bank import Paper
from replication.inverse.refinement import Fit

FILE = Path(__file__).with_name("findings.json")


def read_findings(path: Path = FILE) -> dict[str, Any]:
    """Return the findings, those of no paper if there is no file."""
    if not path.exists():
        return {"papers": {}}
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def add_findings(paper: str, parts: Mapping[str, Any], path: Path = FILE) -> None:
    """Put parts of a paper's findings in the file, in place of what was there under the same names."""
    found = read_findings(path)
    found["papers"].setdefault(paper, {}).update(parts)
    path.write_text(json.dumps(_short(found), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _short(value: Any) -> Any:
    """Return a value with its numbers to five digits, as JSON can hold it."""
    if isinstance(value, dict):
        return {key: _short(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_short(each) for each in value]
    if isinstance(value, float):
        return float(f"{value:.5g}")
    return value


def table_rows(paper: Paper, fits: Mapping[str, Fit]) -> dict[str, Any]:
    """Return the printed tables beside the numbers of the best settings, by the name of the table.

    Args:
        paper: The paper.
        fits: The best setting of all tables, and then of each table alone, by its name.
    """
    joint, *_ = fits.values()
    tables: dict[str, Any] = {}
    for place, number in enumerate(paper.numbers):
        table = tables.setdefault(number.table, {"columns": [], "rows": []})
        if number.column not in table["columns"]:
            table["columns"].append(number.column)
        row = next((each for each in table["rows"] if each["label"] == number.label), None)
        if row is None:
            row = {"label": number.label, "unit": number.unit, "paper": []}
            row |= {key: [] for kind in ("alone", "joint") for key in (kind, f"{kind}_residual")}
            table["rows"].append(row)
        row["paper"].append(float(paper.printed[place]))
        own = paper.tables[number.table].numbers.index(number) if number.table in fits else place
        for kind, fit, at in (("joint", joint, place), ("alone", fits.get(number.table, joint), own)):
            row[kind].append(float(fit.mean[at]))
            row[f"{kind}_residual"].append(round(float(fit.residual[at]), 2))
    return tables
