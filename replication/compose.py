"""From the campaigns' results to the summary."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path

from relnav_sim.report.tables import Column, Number, Row, Table, Words
from replication.effects import Judgement, judge
from replication.evidence import evidence_table, found_in_words, runs_of
from replication.liu2011 import results as liu2011_results
from replication.liu2011 import rules as liu2011_rules
from replication.measured import Measured
from replication.papers import paper_of
from replication.reasons import why
from replication.shi2025 import results as shi2025_results
from replication.shi2025 import rules as shi2025_rules
from replication.summary import Claim, Experiment, PaperPart, Summary
from replication.wei2012 import results as wei2012_results
from replication.wei2012 import rules as wei2012_rules

RULES = (*shi2025_rules.RULES, *wei2012_rules.RULES, *liu2011_rules.RULES)


def summarised(measured: Measured, size: str, figures: Path, in_full: Container[str] = ()) -> Summary:
    """Return everything a replication found; its figures are written to a folder.

    Args:
        measured: Results of the plan's campaigns.
        size: Size of the plan, or ``mixed``.
        figures: Folder for the figures.
        in_full: With ``mixed``: names of the campaigns that are of the full size.
    """
    parts: tuple[PaperPart, ...] = (
        shi2025_results.part(measured, figures),
        wei2012_results.part(measured, figures),
        liu2011_results.part(measured, figures),
    )
    experiments = tuple(item for part in parts for item in part.experiments)
    claims = tuple(_claim(judge(rule, measured), experiments) for rule in RULES)
    return Summary(size, claims, parts, _campaigns(measured, size, in_full))


def _claim(judgement: Judgement, experiments: tuple[Experiment, ...]) -> Claim:
    rule = judgement.rule
    return Claim(
        number=rule.claim,
        text=paper_of(rule.claim).claims[rule.claim],
        rule=rule.text,
        verdict=judgement.verdict,
        conditions=judgement.conditions,
        found=found_in_words(judgement),
        runs=runs_of(judgement.evidence),
        why=why(rule.claim, experiments),
        evidence=evidence_table(judgement),
        missing=judgement.missing,
        undecided=judgement.undecided,
    )


def _campaigns(measured: Measured, size: str, in_full: Container[str]) -> Table:
    rows = []
    for name in measured.campaigns:
        results = measured.results(name)
        content = results.campaign_content
        failed = sum(
            len({f.run for f in (failure for _, failure in results.failures(i))}) for i in range(len(results.cases))
        )
        rows.append(
            Row(
                name,
                (
                    Words(("full" if name in in_full else "usual") if size == "mixed" else size),
                    Number(float(len(results.cases)), decimals=0),
                    Number(float(len(results.runs)), decimals=0),
                    Number(float(len(results.filters)), decimals=0),
                    Number(float(content["clock"]["duration_s"]), decimals=0),
                    Number(float(failed), decimals=0),
                    Words(results.campaign_hash[:12]),
                ),
            )
        )
    columns = ("cases", "runs of each", "filters", "duration [s]", "runs with a failed filter")
    return Table(
        "campaigns",
        "Campaigns behind these pages",
        "In campaigns/; the hash is of the content as it was run.",
        "campaign",
        (Column("size", numeric=False), *(Column(label) for label in columns), Column("hash", numeric=False)),
        tuple(rows),
    )
