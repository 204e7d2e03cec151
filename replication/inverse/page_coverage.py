"""How well known settings of synthetic papers are found again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from replication.inverse.page_tables import percent, table

_NAMES = {
    "alpha_kf": "Shi et al.",
    "mf_upf": "Wei et al., particle filter",
    "mf_upf_learned": "Wei et al., learned dynamics",
    "two_step_kf": "Liu et al.",
}
_COVERED = """## Banks and coverage

{papers} synthetic papers of each bank, which nothing was learned from, check its intervals of {level}: in which share
of them the known setting lies, and, for the setting with the fewest, in how many papers; in brackets the least that
chance allows. [All open settings](replication-unknowns.csv) with prior, best values and coverage.
"""


def banks_and_coverage(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the banks with their cost, and how often known settings are found again."""
    held = {name: bank for name, bank in banks.items() if "bank" in bank}
    checked = [bank["checks"]["coverage"] for bank in held.values() if "coverage" in bank.get("checks", {})]
    if checked:
        yield _COVERED.format(papers=checked[0]["papers"], level=percent(checked[0]["level"]))
    head = ("bank", "settings flown", "CPU hours", "open settings", "known setting inside", "fewest papers")
    rows = [
        (
            _NAMES.get(name, name),
            str(bank["bank"]["campaigns"]),
            f"{bank['bank']['cpu_hours']:.2f}",
            str(len(bank["bank"]["unknowns"])),
            *_covered(bank.get("checks", {}).get("coverage")),
        )
        for name, bank in held.items()
    ]
    if rows:
        yield table(head, rows)


def _covered(coverage: Mapping[str, Any] | None) -> tuple[str, str]:
    if coverage is None:
        return "–", "–"
    least = min(each["contained"] for each in coverage["unknowns"])
    warning = "" if coverage["passed"] else ": below, not to be relied on"
    return percent(coverage["contained"], 1), f"{least} ({coverage['least_allowed']}){warning}"
