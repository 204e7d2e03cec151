"""The page of settings, made of the findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from replication.papers import papers

PAGE = "replication-settings.md"

_HEAD = """# Which settings give the printed numbers

Each paper leaves settings open. A prior says how likely each value of them is before any printed number is looked at. A
bank of short campaigns, each with one setting drawn from the prior, is flown once; all answers below are read from it.
[Three papers, claim by claim](replication.md) judges the claims at stated settings instead.

`python -m replication.inverse bank PAPER` fills the bank, and goes on where it stopped. `infer PAPER` judges claims and
searches the best setting, `check PAPER` checks the inference on synthetic papers, `page` writes this page.
"""


def page_of(findings: Mapping[str, Any]) -> str:
    """Return the page, Markdown."""
    parts = [_HEAD]
    for key, paper in papers().items():
        if key in findings["papers"]:
            parts += [f"## {paper.short}\n", *_paper(findings["papers"][key])]
    return "\n".join(parts).rstrip() + "\n"


def _paper(found: Mapping[str, Any]) -> list[str]:
    parts = []
    if "bank" in found:
        bank = found["bank"]
        parts.append(
            f"Bank: {bank['campaigns']} campaigns, {bank['cpu_hours']:.2f} hours of processor time, seed {bank['seed']}.\n"
        )
    if "claims" in found:
        parts.append(_table(("claim", "probability", "95 %", "what it takes"), map(_claim, found["claims"].items())))
        conflicts = [f"- {name}: {text}." for name, claim in found["claims"].items() for text in claim["conflicts"]]
        if conflicts:
            parts += ["Printed numbers that pull against a claim:\n", "\n".join(conflicts) + "\n"]
    if found.get("sentences"):
        rows = ((each["text"], each["verdict"], f"{each['p_value']:.2g}") for each in found["sentences"])
        parts.append(_table(("sentence", "verdict", "p"), rows))
    if "best" in found:
        parts += _best(found)
    if "checks" in found:
        parts += _checks(found["checks"])
    return parts


def _claim(item: tuple[str, Mapping[str, Any]]) -> Sequence[str]:
    name, claim = item
    low, high = claim["interval"]
    return name, f"{claim['probability']:.2%}", f"{low:.2%} to {high:.2%}", claim["sentence"]


def _best(found: Mapping[str, Any]) -> list[str]:
    best = found["best"]
    parts = [
        "### The best joint setting\n",
        f"Of {best['flown']} settings flown towards all printed numbers together, the best has {best['within_two']:.0%} of "
        f"them within two standard deviations of a single run, and {best['beyond_four']} beyond four.\n",
    ]
    settings = ((each["name"], _value(each["value"]), each["unit"]) for each in best["settings"])
    parts.append(_table(("setting", "value", "unit"), settings))
    for name, table in found["tables"].items():
        parts.append(
            f"#### {name.replace('_', ' ').capitalize()}: paper, best setting, residual in standard deviations\n"
        )
        rows = ((row["label"], *map(_cell, row["paper"], row["best"], row["residual"])) for row in table["rows"])
        parts.append(_table(("", *table["columns"]), rows))
    return parts


def _cell(paper: float, best: float, residual: float) -> str:
    return f"{paper:.3f}, {best:.3f}, {residual:+.1f}"


def _value(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _checks(checks: Mapping[str, Any]) -> list[str]:
    coverage = checks["coverage"]
    parts = [
        "### Checks on synthetic papers\n",
        f"Intervals of {coverage['level']:.0%} contain the known settings of {coverage['papers']} papers that were held out of "
        f"the bank in {coverage['contained']:.1%} of all cases; least for one unknown: "
        f"{min(each['contained'] for each in coverage['unknowns'])}, the binomial bound for {len(coverage['unknowns'])} unknowns "
        f"together is {coverage['least_allowed']}.\n",
    ]
    rows = ((each["unknown"], str(each["contained"]), f"{each['width']:.2f}") for each in coverage["unknowns"])
    parts.append(_table(("unknown", f"contained, of {coverage['papers']}", "width over the prior's"), rows))
    for title, forged in (("", checks.get("forged")), (" like the printed one", checks.get("forged_like_printed"))):
        if not forged:
            continue
        factors = list(forged["columns"][0]["called_inconsistent"])
        parts.append(
            f"Share of {forged['papers']} synthetic papers{title} that are called inconsistent when the errors of one column are "
            f"multiplied by a factor; without that {forged['false_alarm']:.1%} (nominal {forged['nominal_false_alarm']:.0%}).\n"
        )
        powers = (
            (each["column"], *(f"{each['called_inconsistent'][factor]:.2f}" for factor in factors))
            for each in forged["columns"]
        )
        parts.append(_table(("column", *factors), powers))
    return parts


def _table(head: Sequence[str], rows: Any) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + ":--|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"
