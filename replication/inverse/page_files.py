"""The long tables behind the page of settings, as CSV files beside it: all printed numbers, and all open settings."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from relnav_sim.results.csv_cells import csv_cell

NUMBERS, UNKNOWNS = "replication-numbers.csv", "replication-unknowns.csv"


def files_of(findings: Mapping[str, Any]) -> dict[str, str]:
    """Return the files' texts by name."""
    banks: Mapping[str, Mapping[str, Any]] = findings["papers"]
    numbers, unknowns = [row for bank in banks.values() for row in _numbers(bank)], [*_unknowns(banks)]
    return {NUMBERS: _written(numbers), UNKNOWNS: _written(unknowns)}


def _written(rows: Sequence[Mapping[str, Any]]) -> str:
    file = io.StringIO()
    head = dict.fromkeys(name for row in rows for name in row)
    writer = csv.DictWriter(file, head, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: csv_cell(value) for name, value in row.items()} for row in rows)
    return file.getvalue()


def _numbers(bank: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield each printed number beside those of the best settings; residuals in standard deviations of a single run."""
    for name, printed in bank.get("tables", {}).items():
        for row in printed["rows"]:
            for place, column in enumerate(printed["columns"]):
                yield {
                    "table": name.removeprefix("table_"),
                    "column": column,
                    "number": row["label"],
                    "unit": row["unit"],
                    "paper": row["paper"][place],
                    "best for the table": row["alone"][place],
                    "its residual": row["alone_residual"][place],
                    "best for all tables": row["joint"][place],
                    "residual of that": row["joint_residual"][place],
                }


def _unknowns(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield each open setting with its prior, the values of the best settings, and how well it is found again."""
    for name, bank in banks.items():
        checks = bank.get("checks", {}).get("coverage", {})
        covered = {each["unknown"]: each for each in checks.get("unknowns", ())}
        inferred = {each["name"]: each for each in bank.get("inferred", {}).get("settings", ())}
        for place, unknown in enumerate(bank.get("bank", {}).get("unknowns", ())):
            own, told = covered.get(unknown["name"], {}), inferred.get(unknown["name"], {})
            yield {
                "bank": name,
                "unknown": unknown["words"],
                "unit": unknown["unit"],
                "prior: choices, or 0, 5, 50, 95 and 100 %": _law(unknown),
                "inferred from all printed numbers: choices, or 90 %": _law(told) if told else "",
                f"intervals that contain it, of {checks.get('papers', 'the')} papers": own.get("contained", ""),
                "their width over the prior's": own.get("width", ""),
                **{f"best for {key.replace('_', ' ')}": each["settings"][place] for key, each in _best(bank)},
            }


def _best(bank: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    return ((key, each) for key, each in bank.get("best", {}).items() if "settings" in each)


def _law(unknown: Mapping[str, Any]) -> str:
    if "choices" in unknown:
        return "; ".join(f"{name} {100 * part:.0f} %" for name, part in unknown["choices"].items())
    return "; ".join(f"{end:.3g}" for end in unknown.get("quantiles", unknown.get("interval", ())))
