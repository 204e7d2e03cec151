"""The page of settings, made of the findings: verdicts first, then what they rest on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from replication.inverse.page_evidence import evidence
from replication.inverse.page_tables import percent, share, table
from replication.papers import Paper, papers

PAGE = "replication-settings.md"
BANKS = {"mf_upf": ("mf_upf", "mf_upf_learned")}
"""Banks of a paper that has more than one."""

_HEAD = """# Which settings give the printed numbers

The papers leave settings open. A verdict here is about all of them: in which share of the settings of a prior a claim
holds, with its 95 % interval, and what it takes. [Three papers, claim by claim](replication.md) judges the same claims
at stated settings.
"""
_METHOD = """## Method

A prior says how likely each value of an open setting is before any printed number is looked at. A bank of short
campaigns, each with one setting drawn from the prior, is flown once and answers all questions. A claim holds in a
setting if its rule holds on the numbers of that one run: at least half of a published reduction, a size within a factor
of two. "Only if" tells the choices without which it does not hold, "mostly where" the interval that excludes the most
of the prior and that 90 % of the settings with the claim meet.

`python -m replication.inverse bank PAPER` fills a bank, and goes on where it stopped. `infer PAPER` judges claims and
searches the best settings, `check PAPER` checks the inference on synthetic papers, `page` writes this page from
replication/inverse/findings.json.
"""


def page_of(findings: Mapping[str, Any]) -> str:
    """Return the page, Markdown."""
    banks = findings["papers"]
    parts = [_HEAD, "## Verdicts\n"]
    for key, paper in papers().items():
        parts += _verdicts(paper, [banks[name] for name in _names(key) if name in banks])
    parts.append(_METHOD)
    for key, paper in papers().items():
        parts.append(f"## {paper.short}\n")
        for name in _names(key):
            parts += evidence(name, banks.get(name, {}))
    return "\n".join(parts).rstrip() + "\n"


def _names(key: str) -> tuple[str, ...]:
    return BANKS.get(key, (key,))


def _verdicts(paper: Paper, banks: list[Mapping[str, Any]]) -> Iterator[str]:
    """Yield what the banks of a paper say: claims, sentences and tables."""
    claims = {name: claim for bank in banks for name, claim in bank.get("claims", {}).items()}
    rows = (
        (name, *share(claim["probability"], claim["interval"]), claim["sentence"])
        for name, claim in sorted(claims.items(), key=lambda item: (item[0][0], int(item[0][1:])))
    )
    if claims:
        yield f"### {paper.short}: verdicts\n"
        yield table(("claim", "settings", "95 %", "verdict"), rows)
    for bank in banks:
        if "all_claims" in bank:
            every, ends = share(bank["all_claims"]["probability"], bank["all_claims"]["interval"])
            yield f"{bank['all_claims']['words']} hold together in {every} of the settings (95 %: {ends}).\n"
        if bank.get("sentences"):
            sentences = ((each["text"], each["verdict"], f"{each['p_value']:.2g}") for each in bank["sentences"])
            yield table(("sentence of the paper", "verdict", "p"), sentences)
        if "best" in bank:
            yield _tables(bank["best"], bank.get("inferred"))


def _tables(best: Mapping[str, Any], inferred: Mapping[str, Any] | None) -> str:
    """Return how near the best settings come to the printed tables, and whether one paper can have all columns."""
    rows = (
        (
            name.replace("_", " "),
            str(each["numbers"]),
            percent(each["within_two"], 0),
            str(each["beyond_four"]),
            f"{each['distance']:.0f}",
            "{:.0f}, {:.0f}".format(*each["honest"]),
            "a setting gives them" if each["distance"] <= each["honest"][1] else "no setting found gives them",
        )
        for name, each in best.items()
    )
    head = (
        "best setting for",
        "numbers",
        "within 2",
        "beyond 4",
        "distance",
        "of an honest paper: median, 95 %",
        "verdict",
    )
    found = (
        "\nWithin two and beyond four standard deviations of a single run. The distance sums squared residuals (large "
        "ones count less); an honest paper's is that to its own setting, which a search could only lower.\n"
    )
    if inferred:
        found += (
            f"\nA paper flown in one setting looks as inconsistent as this one with p = {inferred['p_value']:.2g}.\n"
        )
    return table(head, rows) + found
