"""What is open in each paper, with its prior, and how well known settings of synthetic papers are found again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from replication.inverse.page_tables import escaped, folded, percent, plain, table

_NAMES = {
    "alpha_kf": "Shi et al.",
    "mf_upf": "Wei et al., particle filter",
    "mf_upf_learned": "Wei et al., learned dynamics",
    "two_step_kf": "Liu et al.",
}
_COVERED = """## Banks and coverage

{papers} papers of each bank, which nothing was learned from, check its intervals of {level}: the share that contain
the known settings, and the least count for one unknown with its binomial bound. The prior, best settings and coverage
of [all unknowns](replication-unknowns.csv).
"""


def banks_and_coverage(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the banks with their cost, and how often known settings are found again."""
    held = {name: bank for name, bank in banks.items() if "bank" in bank}
    checked = [bank["checks"]["coverage"] for bank in held.values() if "coverage" in bank.get("checks", {})]
    if checked:
        yield _COVERED.format(papers=checked[0]["papers"], level=percent(checked[0]["level"]))
    head = ("bank", "settings", "CPU hours", "contained", "least")
    rows = [
        (
            _NAMES.get(name, name),
            str(bank["bank"]["campaigns"]),
            f"{bank['bank']['cpu_hours']:.2f}",
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


def open_settings(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield what a paper leaves open, with its prior; what differs after a comma alone is told once and counted."""
    shown: dict[tuple[str, str], dict[str, None]] = {}
    for bank in banks.values():
        for unknown in bank["bank"]["unknowns"]:
            words = unknown["words"].removeprefix("the ")
            shown.setdefault((words.partition(", ")[0], _law(unknown)), {})[words] = None
    told = (
        f"{next(iter(words))} ({law})" if len(words) == 1 else f"{stem}, {len(words)} of them ({law})"
        for (stem, law), words in shown.items()
    )
    if shown:
        yield folded("What is open: choices, or least to largest value", escaped("; ".join(told)) + ".\n")


def _law(unknown: Mapping[str, Any]) -> str:
    if "choices" in unknown:
        parts = unknown["choices"]
        equal = max(parts.values()) - min(parts.values()) < 0.01
        return ", ".join(name if equal else f"{name} {part:.0%}" for name, part in parts.items())
    least, _, middle, _, largest = unknown["quantiles"]
    span = largest - least
    if abs(middle - (least + largest) / 2) < 0.01 * span:  # uniform
        least, largest = (round(end / span, 2) * span for end in (least, largest))
    return f"{_end(least)} to {_end(largest)} {unknown['unit']}".rstrip()


def _end(value: float) -> str:
    """Return an end of a prior, of which the findings have a quantile close to it: one digit where that is near."""
    return plain(value, 1 if abs(float(f"{value:.1g}") - value) <= 0.02 * abs(value) else 2)
