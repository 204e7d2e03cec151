"""The page of settings, made of the findings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from replication.papers import papers

PAGE = "replication-settings.md"

_HEAD = """# Which settings give the printed numbers

Each paper leaves settings open. A prior says how likely each value of them is before any printed number is looked at. A
bank of short campaigns, each with one setting drawn from the prior, is flown once; the answers below are read from it.
[Three papers, claim by claim](replication.md) judges the claims at stated settings instead.

`python -m replication.inverse bank PAPER` fills the bank, and goes on where it stopped. `infer PAPER` judges claims and
searches the best setting, `check PAPER` checks the inference on synthetic papers, `page` writes this page. The findings
are kept in replication/inverse/findings.json: nothing is flown to read them.

The probability of a claim is the share of the bank's settings in which the rule of the claim holds on the numbers of
one run: at least half of a published reduction, a size within a factor of two. What it takes is told by the choices
without which it does not hold, and by the interval that excludes the most of the prior and that 90 % of the settings
with the claim meet.
"""
_HOW = {
    "alpha_kf": """EKF and UKF are flown as one Kalman filter on the converted reading, the alpha filter as that with
R / alpha and the scatter of its samples: at 12 km they are the same ([why](replication.md)). Steps are 0.2 s long at
first and 5 s from 960 s on, with readings that much better, which leaves white noise as it is. Drag is left out.
""",
    "mf_upf": """The bank has the particle filter over Clohessy-Wiltshire dynamics alone, with 50 to 500 particles and
at least 2 s between readings. Filters over learned dynamics, which B1 and B2 are about, are not flown yet. B3 asks for
an error of about 5 m from 1000 to 3500 s and from 3500 to 6000 s, and for less before: an oscillation that starts and
stays.
""",
    "two_step_kf": """No scenario of the paper is accessible, so that every scenario is admissible. A hundred settings
of the bank share radar, clock and process noise; each flies eight runs of 60 readings, with Clohessy-Wiltshire motion
for truth and filters.
""",
}
_FITTED = """### The best joint setting

Of {flown} settings flown towards all printed numbers together, the best has {within_two:.0%} of them within two
standard deviations of a single run, and {beyond_four} beyond four. The tables have the paper's number, the best
setting's and the residual in those standard deviations, which count the rounding of the last digit too.
"""
_COVERED = """### Checks on synthetic papers

Intervals of {level:.0%} contain the known settings of {papers} papers that were held out of the bank in
{contained:.1%} of all cases. The least for one unknown is {least} papers; for so many unknowns together the binomial
bound is {least_allowed}. The width is that of the interval over the prior's.
"""
_FORGED = """Share of {papers} synthetic papers like the printed one that are called inconsistent when the errors of one
column are multiplied by a factor. Of those without a forged column {false_alarm:.1%} are; nominal are
{nominal_false_alarm:.0%}.
"""
_COLUMNS = """### Columns that go with the others

The probability that a column of an honest paper like this one is as improbable given the other columns, and the numbers
that are furthest from what the others imply, in standard deviations. Taken together: {p_value:.2g}.
"""


def page_of(findings: Mapping[str, Any]) -> str:
    """Return the page, Markdown."""
    parts = [_HEAD]
    for key, paper in papers().items():
        parts += [f"## {paper.short}\n", _HOW[key]]
        parts += _paper(findings["papers"][key]) if key in findings["papers"] else ["No bank has been flown yet.\n"]
    return "\n".join(parts).rstrip() + "\n"


def _paper(found: Mapping[str, Any]) -> list[str]:
    parts = []
    if "bank" in found:
        bank = found["bank"]
        size = f"{bank['campaigns']} campaigns, {bank['cpu_hours']:.2f} hours of processor time"
        parts.append(f"Bank: {size}, seed {bank['seed']}, digest {bank['digest']}.\n")
        parts += ["<details><summary>what is open, and its prior</summary>\n", _prior(bank["unknowns"]), "</details>\n"]
    if "claims" in found:
        parts.append(_table(("claim", "probability", "95 %", "what it takes"), map(_claim, found["claims"].items())))
        conflicts = [f"- {name}: {text}." for name, claim in found["claims"].items() for text in claim["conflicts"]]
        if conflicts:
            parts += ["Printed numbers that pull against a claim:\n", "\n".join(conflicts) + "\n"]
    if "all_claims" in found:
        low, high = found["all_claims"]["interval"]
        every = f"{found['all_claims']['probability']:.2%} (95 %: {low:.2%} to {high:.2%})"
        parts.append(f"All claims but the one on cost hold together in {every} of the settings.\n")
    if found.get("sentences"):
        rows = ((each["text"], each["verdict"], f"{each['p_value']:.2g}") for each in found["sentences"])
        parts.append(_table(("sentence", "verdict", "p"), rows))
    if "best" in found:
        parts += _best(found)
    if "inferred" in found:
        parts += [_COLUMNS.format(**found["inferred"]), _pulls(found["inferred"]["columns"])]
    if "checks" in found:
        parts += _checks(found["checks"])
    return parts


def _prior(unknowns: Iterable[Mapping[str, Any]]) -> str:
    rows = []
    for each in unknowns:
        if "choices" in each:
            law = ", ".join(f"{name} ({share:.0%})" for name, share in each["choices"].items())
        else:
            law = ", ".join(f"{end:.3g}" for end in each["quantiles"])
        rows.append((each["words"], law, each["unit"]))
    return _table(("unknown", "choices, or least, 5 %, median, 95 % and most", "unit"), rows)


def _claim(item: tuple[str, Mapping[str, Any]]) -> Sequence[str]:
    name, claim = item
    low, high = claim["interval"]
    return name, f"{claim['probability']:.2%}", f"{low:.2%} to {high:.2%}", claim["sentence"]


def _best(found: Mapping[str, Any]) -> list[str]:
    settings = ((each["words"], _value(each["value"]), each["unit"]) for each in found["best"]["settings"])
    parts = [_FITTED.format(**found["best"]), _table(("setting", "value", "unit"), settings)]
    for name, table in found["tables"].items():
        parts.append(f"#### {name.replace('_', ' ').capitalize()}: paper, best setting, residual\n")
        rows = ((row["label"], *map(_cell, row["paper"], row["best"], row["residual"])) for row in table["rows"])
        parts.append(_table(("", *table["columns"]), rows))
    return parts


def _cell(paper: float, best: float, residual: float) -> str:
    return f"{paper:.3f}, {best:.3f}, {residual:+.1f}"


def _value(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _pulls(columns: Iterable[Mapping[str, Any]]) -> str:
    rows = (
        (
            each["column"],
            f"{each['p_value']:.3f}",
            ", ".join(f"{far['number']} ({far['deviations']:+.1f})" for far in each["furthest"]),
        )
        for each in columns
    )
    return _table(("column", "p", "furthest from what the others imply"), rows)


def _checks(checks: Mapping[str, Any]) -> list[str]:
    coverage = checks["coverage"]
    least = min(each["contained"] for each in coverage["unknowns"])
    rows = ((each["unknown"], str(each["contained"]), f"{each['width']:.2f}") for each in coverage["unknowns"])
    head = ("unknown", f"contained, of {coverage['papers']}", "width")
    parts = [_COVERED.format(**coverage, least=least)]
    if not coverage["passed"]:
        parts.append("That is below the bound: intervals of settings from this bank are not to be relied on.\n")
    parts.append(_table(head, rows))
    if "forged" in checks:
        parts += [_FORGED.format(**checks["forged"]), _powers(checks["forged"]["columns"])]
    return parts


def _powers(columns: Sequence[Mapping[str, Any]]) -> str:
    factors = list(columns[0]["called_inconsistent"])
    rows = ((each["column"], *(f"{each['called_inconsistent'][factor]:.2f}" for factor in factors)) for each in columns)
    return _table(("column", *factors), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + ":--|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"
