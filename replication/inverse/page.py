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
first and 5 s from 960 s on, with readings that much better, which leaves white noise as it is. Drag is left out. A8 to
A12, of scatter over runs, outliers, periods and covariances, are not judged here.
""",
    "mf_upf": """The particle filter over Clohessy-Wiltshire dynamics: 50 to 500 particles, 2 to 20 s between readings.
B3 asks for a largest position error of 5 m from 4000 s on, B4 for 0.01 m/s RMS, both within a factor of two and with
half of the RMS of 1000 to 2000 s or more; B6 for 1 m RMS from 1000 s on, within a factor of two.
""",
    "mf_upf_learned": """### With learned dynamics

Both filters of the comparison in one setting, for B1, B2 and B5. An unscented Kalman filter over the learned dynamics
stands for the published filter; one process serves all outputs, fitted to 75 of the 500 pairs. These settings are too
few to infer any from numbers: only probabilities are given.
""",
    "two_step_kf": """No scenario of the paper is accessible, so that every scenario is admissible. Each setting flies
eight runs of 40 readings, with Clohessy-Wiltshire motion for truth and filters.
""",
}
_BANKS = {"mf_upf": ("mf_upf", "mf_upf_learned")}
_STAND_IN = """The published filter with {particles} particles, flown in {settings} of these settings, has {low:.2f} to
{high:.2f} times the stand-in's RMS position error (80 % of them; median {middle:.2f}). B1 comes out the same in {B1} of
them, B2 in {B2}.
"""
_PAIRS = """### Printed numbers that pull against each other

Each number alone is as far out as in a twentieth of the bank's papers or more. Of the papers that have nearly the first
number, p is twice the share in which the second is as far out on its side, or the same the other way round if that is
more; deviations are from the median of these papers. One pair is listed for each pair of columns. Pairs with p of
{limit:.0%} or less: {count}; papers held out of the bank have {middle:.0f} (95 % of them at most {high:.0f}).
"""
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
column are multiplied by a factor, or are those of another such paper. Of those without a forged column
{false_alarm:.1%} are; nominal are {nominal_false_alarm:.0%}. The test is a classifier that has been shown other papers
forged in these two ways.
"""
_COLUMNS = """### Columns that go with the others

The probability that a column of an honest paper like this one is as improbable given the other columns, and the numbers
that are furthest from what the others imply, in standard deviations. The probability that a paper flown in one setting
looks as inconsistent as a whole is {p_value:.2g}: a small one tells that no setting of the prior gives all columns, not
why.
"""


def page_of(findings: Mapping[str, Any]) -> str:
    """Return the page, Markdown."""
    parts = [_HEAD]
    for key, paper in papers().items():
        parts.append(f"## {paper.short}\n")
        for bank in _BANKS.get(key, (key,)):
            parts.append(_HOW[bank])
            parts += _paper(findings["papers"].get(bank, {})) or ["No bank has been flown yet.\n"]
    return "\n".join(parts).rstrip() + "\n"


def _paper(found: Mapping[str, Any]) -> list[str]:
    parts = []
    if "bank" in found:
        bank = found["bank"]
        size = f"{bank['campaigns']} independent settings, {bank['cpu_hours']:.2f} hours of processor time"
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
        parts.append(f"{found['all_claims']['words']} hold together in {every} of the settings.\n")
    if found.get("together"):
        rows = ((" and ".join(pair["claims"]), *_share(pair["share"], pair["interval"])) for pair in found["together"])
        parts.append(_table(("both claims hold, least often first", "where the rarer one holds", "95 %"), rows))
    if "stand_in" in found:
        low, middle, high = found["stand_in"]["ratio"]
        same = found["stand_in"]["same"]
        parts.append(_STAND_IN.format(**found["stand_in"], **same, low=low, middle=middle, high=high))
    if found.get("sentences"):
        rows = ((each["text"], each["verdict"], f"{each['p_value']:.2g}") for each in found["sentences"])
        parts.append(_table(("sentence", "verdict", "p"), rows))
    if "best" in found:
        parts += _best(found)
    if "pairs" in found:
        middle, high = found["pairs"]["honest"]
        parts += [_PAIRS.format(**found["pairs"], middle=middle, high=high), _pairs(found["pairs"]["pairs"])]
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
    return name, *_share(claim["probability"], claim["interval"]), claim["sentence"]


def _share(share: float, interval: Sequence[float]) -> tuple[str, str]:
    low, high = interval
    return f"{share:.2%}", f"{low:.2%} to {high:.2%}"


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


def _pairs(pairs: Iterable[Mapping[str, Any]]) -> str:
    rows = ((each["first"], each["second"], f"{each['p_value']:.3f}", f"{each['deviations']:.1f}") for each in pairs)
    return _table(("number", "number", "p", "deviations"), rows)


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
    rows = (
        (
            each["column"],
            *(f"{each['called_inconsistent'][factor]:.2f}" for factor in factors),
            f"{each['of_another_paper']:.2f}",
        )
        for each in columns
    )
    return _table(("column", *factors, "another paper's"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + ":--|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"
