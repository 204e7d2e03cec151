"""From what the campaigns found to the summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relnav_sim.report.tables import Column, Number, Row, Table, Words
from replication.effects import Judgement, judge
from replication.evidence import evidence_table, found_in_words, runs_of
from replication.liu2011 import results as liu2011_results
from replication.liu2011 import rules as liu2011_rules
from replication.measured import Measured
from replication.papers import paper_of
from replication.plan import PLAN
from replication.reasons import why
from replication.shi2025 import results as shi2025_results
from replication.shi2025 import rules as shi2025_rules
from replication.summary import Claim, Experiment, PaperPart, Summary
from replication.wei2012 import results as wei2012_results
from replication.wei2012 import rules as wei2012_rules

RULES = (*shi2025_rules.RULES, *wei2012_rules.RULES, *liu2011_rules.RULES)


def summarised(measured: Measured, size: str, findings: Mapping[str, Any] | None = None) -> Summary:
    """Return everything a replication found.

    Args:
        measured: Extracts of the plan's campaigns, of all of them or of some.
        size: ``full`` or ``trial``.
        findings: What the inference from all printed numbers found; default: nothing.
    """
    parts: tuple[PaperPart, ...] = (
        shi2025_results.part(measured),
        wei2012_results.part(measured),
        liu2011_results.part(measured),
    )
    experiments = tuple(item for part in parts for item in part.experiments)
    claims = tuple(_claim(judge(rule, measured), experiments) for rule in RULES)
    missing = tuple(planned.name for planned in PLAN if not measured.has(planned.name))
    hours = sum(extract.content["cpu_hours"] for extract in measured.extracts.values())
    return Summary(size, claims, parts, _campaigns(measured), missing, hours, findings or {})


def _claim(judgement: Judgement, experiments: tuple[Experiment, ...]) -> Claim:
    rule = judgement.rule
    windows = [item.window for item in judgement.evidence if item.main]
    return Claim(
        number=rule.claim,
        text=paper_of(rule.claim).claims[rule.claim],
        rule=rule.text,
        verdict=judgement.verdict,
        conditions=judgement.conditions,
        found=found_in_words(judgement),
        window=windows[0] if windows else "",
        runs=runs_of(judgement.evidence),
        why=why(rule.claim, experiments),
        evidence=evidence_table(judgement),
        missing=judgement.missing,
        undecided=judgement.undecided,
        stated=any(item.outcome == "holds" for item in judgement.evidence if item.main),
        fails=any(item.outcome == "fails" for item in judgement.evidence),
    )


def _campaigns(measured: Measured) -> Table:
    rows = []
    for name, extract in measured.extracts.items():
        numbers = (
            len(extract.cases),
            len(extract.runs),
            len(extract.content["filters"]),
            max(case["end_s"] for case in extract.cases),
            sum(case["failed_runs"] for case in extract.cases),
        )
        cells = tuple(Number(float(number), decimals=0) for number in numbers)
        hours = Number(extract.content["cpu_hours"], decimals=2)
        rows.append(Row(name, (*cells, hours, Words(extract.campaign_hash[:12]))))
    columns = ("cases", "runs of each", "filters", "duration [s]", "runs with a failed filter", "CPU hours")
    return Table(
        "campaigns",
        "Campaigns behind these pages",
        "In campaigns/; the hash is of the settings as they were run; CPU hours are of the filters.",
        "campaign",
        (*(Column(label) for label in columns), Column("hash", numeric=False)),
        tuple(rows),
    )
