"""The page of evidence: rules, every interpretation, the papers' tables and figures, experiments and campaigns."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.report.tables import Table, plain_markdown
from relnav_sim.report.tables import markdown as table_markdown
from replication.evidence import OUTCOMES
from replication.listed import deviation_table, entries, pipe_table
from replication.pages import INTERVALS, verdict_in_words
from replication.papers import papers
from replication.summary import Claim, Experiment, PaperPart, Plot, Summary

TITLE = "Three papers: the evidence"
NOTE = (
    "Intervals: 95 % over runs for the main interpretations (marked \\*); the others share 5 % of error. An "
    "interpretation holds when every value's whole interval is where the rule asks for it. The verdicts are on "
    "[the page of verdicts](replication.md)."
)


def evidence_page(summary: Summary, figures: str, literal: str = "") -> str:
    """Return the Markdown page.

    Args:
        summary: What was found.
        figures: Path of the figures' folder as the page links it.
        literal: Text of the campaigns that fly the papers literally; empty where there are none.
    """
    parts = [f"# {TITLE}", NOTE]
    for part in summary.papers:
        claims = [claim for claim in summary.claims if claim.number in papers()[part.key].claims]
        parts += _paper(part, claims, figures)
    parts += ["## Where relnav deviates from the papers", deviation_table(literal)]
    parts += ["## What intervals decide", INTERVALS]
    parts += ["## History of the rules", history_table()]
    parts += ["## Campaigns", _table(summary.campaigns)]
    return "\n\n".join(item.strip("\n") for item in parts if item) + "\n"


def _paper(part: PaperPart, claims: Sequence[Claim], figures: str) -> list[str]:
    parts = [f"## {part.short}", plain_markdown(part.citation) + ".", plain_markdown(part.scenario)]
    parts.append("What it leaves open: " + "; ".join(map(plain_markdown, part.silent)) + ".")
    parts.append(_folded(part.index.title, part.index))
    for claim in claims:
        parts += _claim(claim)
    for experiment in part.experiments:
        parts += _experiment(experiment)
    parts += [_folded(table.title, table) for table in (*part.tables, *part.beyond)]
    parts += [_plot(plot, figures) for plot in part.plots]
    return parts


def _claim(claim: Claim) -> list[str]:
    parts = [
        f"### {claim.number}",
        f"{plain_markdown(claim.text)} **{plain_markdown(verdict_in_words(claim))}.**",
        f"Rule: {plain_markdown(claim.rule)}",
    ]
    if claim.missing:
        missing = ", ".join(map(plain_markdown, claim.missing))
        parts.append(f"Not run here, and counted as {OUTCOMES['open']}: {missing}.")
    return [*parts, _folded("all interpretations", claim.evidence)]


def _experiment(experiment: Experiment) -> list[str]:
    text = [plain_markdown(sentence) for sentence in experiment.text]
    claims = ", ".join(experiment.claims)
    return [f"### {plain_markdown(experiment.title)} ({claims})", *text, _folded("the numbers", experiment.table)]


def _plot(plot: Plot, figures: str) -> str:
    caption = f"**{plain_markdown(plot.number)}.** {plain_markdown(plot.caption)}"
    return f"![{plain_markdown(plot.alt)}]({figures}/{plot.name}.png)\n\n{caption}"


def _table(table: Table) -> str:
    return table_markdown(table).replace("### ", "#### ", 1)


def _folded(words: str, table: Table) -> str:
    if not table.rows:
        return ""
    return f'<details markdown="1"><summary>{words}</summary>\n\n{_table(table)}\n\n</details>'


def history_table() -> str:
    """Return how the rules changed, and why, as a Markdown table."""
    rows = [(item["rules"], item["change"], item["reason"]) for item in entries("history.yaml")]
    return pipe_table(("rules", "change", "reason"), rows)
