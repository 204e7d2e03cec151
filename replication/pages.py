"""The page of verdicts, made of the summary alone: one screen first, then causes, and how claims are judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any

from relnav_sim.report.tables import plain_markdown
from replication.findings import PAPER_OF, possible, sentence_lines
from replication.papers import paper_of, papers
from replication.summary import Claim, Summary

TITLE = "Three papers, claim by claim"
EVIDENCE_PAGE = "replication-evidence.md"
LITERAL = "filters.md#as-published"
SETTINGS_PAGE = "replication-settings.md"
"""Written by replication/inverse with its findings."""
_SHOWN_CONDITIONS = 3
_SHARED_WORDS = 3
SIZES = {
    "trial": "A trial of a few minutes: three runs of each case, shortened. Its verdicts mean nothing.",
    "full": "Campaigns at full size; `replication/full/` holds their summaries. `make reproduce` computes some runs "
    "again and compares; `make reproduce-full` computes all.",
}
COLUMNS = (
    f"Bold: the verdict in stated settings. Then: in which share of all settings that the paper leaves open the claim "
    f"holds ([how]({SETTINGS_PAGE}))."
)
THRESHOLDS = (
    "Thresholds follow from principles, so that none is chosen for a claim: half of an improvement; a size within a "
    "factor of two; a limit as printed; a period within a tenth; a number printed of one run within two standard "
    "deviations of our single runs. Every rule is applied to the paper's own printed numbers first: a rule that the "
    "paper fails is restated."
)
INTERVALS = (
    "Intervals decide, at 95 % over runs: an effect holds when its whole interval is in the rule's range, fails when "
    "none of it is, and is undecided in between; a claim is undecided where only more runs could tell. It is "
    "reproduced when all its effects hold in all main interpretations, and “reproduced only …” when they hold in some "
    "and fail in others; where they fail in none, the others are undecided; "
    "“not reproduced as stated, only …” when they hold in other "
    "interpretations of what the paper leaves open, which share 5 % of error. For Shi et al. the main "
    "interpretations are one process noise for all filters, and the process noise of each filter tuned by `relnav "
    "tune` on other random numbers: twelve values between 1e-11 and 1e-3 m²/s³, ten runs of a whole revolution, three "
    "seeds, whose variance is part of the interval."
)


def markdown_page(summary: Summary) -> str:
    """Return the Markdown page."""
    parts = [f"# {TITLE}", _introduction(summary), "## Verdicts", COLUMNS, verdict_table(summary)]
    parts += ["## Which settings could do it", *_inference(summary.findings)]
    parts += ["## Contradictions inside the papers", _bullets(_contradictions())]
    parts += ["## Causes", _bullets(causes(summary))]
    parts += ["## How a claim is judged", THRESHOLDS]
    parts.append(
        f"[What intervals decide]({EVIDENCE_PAGE}#what-intervals-decide); "
        f"[how the rules have changed, and why]({EVIDENCE_PAGE}#history-of-the-rules)."
    )
    return "\n\n".join(item.strip("\n") for item in parts if item) + "\n"


def _introduction(summary: Summary) -> str:
    parts = [
        f"{SIZES[summary.size]} The filters took {summary.cpu_hours:.1f} CPU hours.",
        f"All interpretations, tables, figures and deviations from the papers: [the evidence]({EVIDENCE_PAGE}).",
        f"Flown word for word: [as published]({LITERAL}).",
    ]
    if summary.missing:
        parts.append(f"Not run yet: {plain_markdown(', '.join(summary.missing))}.")
    return " ".join(parts)


def verdict_table(summary: Summary) -> str:
    """Return the verdicts as a Markdown table."""
    lines = ["| claim | verdict | found, with 95 % interval | window | runs |", "|:--|:--|:--|:--|--:|"]
    for claim in summary.claims:
        verdict = f"**{plain_markdown(verdict_in_words(claim))}**"
        sentence = possible(summary.findings, claim.number)
        if sentence:
            verdict += f"; {plain_markdown(sentence)}"
        literal = paper_of(claim.number).word_for_word.get(claim.number)
        if literal:
            verdict += f"; [word for word]({LITERAL}) {plain_markdown(literal)}"
        link = f"[{claim.number}]({EVIDENCE_PAGE}#{claim.number.lower()}) {plain_markdown(claim.text.rstrip('.'))}"
        found, window = plain_markdown(claim.found), plain_markdown(claim.window)
        lines.append(f"| {link} | {verdict} | {found} | {window} | {claim.runs or '–'} |")
    return "\n".join(lines)


def verdict_in_words(claim: Claim) -> str:
    """Return the verdict with its conditions."""
    if not claim.evidence.rows:
        return "not run"
    if claim.verdict == "reproduced only if" and claim.conditions:
        shown, more = claim.conditions[:_SHOWN_CONDITIONS], len(claim.conditions) - _SHOWN_CONDITIONS
        rest = f"; or in {more} more" if more > 0 else ""
        if not claim.fails:  # then nothing says that it takes these
            return f"reproduced {either(shown)}{rest}; else undecided"
        start = "reproduced only" if claim.stated else "not reproduced as stated, only"
        return f"{start} {either(shown)}{rest}"
    return "undecided" if claim.undecided else claim.verdict


def either(conditions: Sequence[str]) -> str:
    """Return conditions of which one is enough; what they begin with in common is said once.

    Example:
        >>> either(["with a start error of 10 m", "with a start error of 50 m"]), either(["if a", "if b"])
        ('with a start error of 10 m or 50 m', 'if a; or if b')
    """
    words = [condition.split() for condition in conditions]
    shared = [each[0] for each in takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False))]
    while shared and not (shared[-1].isalpha() and shared[-1].islower()):  # a formula stays whole
        shared.pop()
    rests = [" ".join(each[len(shared) :]) for each in words]
    if len(rests) == 1 or len(shared) < _SHARED_WORDS or not all(rests):
        return "; or ".join(conditions)
    return f"{' '.join(shared)} {', '.join(rests[:-1])} or {rests[-1]}"


def verdict_lines(summary: Summary) -> list[tuple[str, str, str]]:
    """Return number, verdict and what was found of every claim, for the terminal."""
    return [(claim.number, verdict_in_words(claim), claim.found) for claim in summary.claims]


def causes(summary: Summary) -> list[str]:
    """Return the causes that experiments show, in a sentence or two each, with the numbers of the claims."""
    return [
        f"**{item.title}** ({', '.join(item.claims)}). {item.text[-1]}"
        for part in summary.papers
        for item in part.experiments
        if not item.detail
    ]


def _inference(findings: Mapping[str, Any]) -> list[str]:
    if not findings:
        return ["The inference of unreported settings from all printed numbers has not been run."]
    banks: dict[str, list[str]] = {}
    for key, paper in findings.items():
        if "bank" in paper:
            banks.setdefault(papers()[PAPER_OF[key]].short, []).append(str(paper["bank"]["campaigns"]))
    flown = ", ".join(f"{' and '.join(sizes)} ({short})" for short, sizes in banks.items())
    lines = [f"Short campaigns, each drawn from a prior over what the paper leaves open: {flown}."]
    for key, paper in findings.items():
        lines += [f"{papers()[PAPER_OF[key]].short}: {line}" for line in sentence_lines(paper)]
    return [_bullets(lines), f"What these settings have in common, and checks: [the inference]({SETTINGS_PAGE})."]


def _contradictions() -> list[str]:
    return [f"{paper.short}: {' '.join(paper.contradictions)}" for paper in papers().values() if paper.contradictions]


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join("- " + _marked(line) for line in lines)


def _marked(line: str) -> str:
    """Return a line as Markdown, its leading bold words kept."""
    if not line.startswith("**"):
        return plain_markdown(line)
    bold, rest = line.removeprefix("**").split("**", 1)
    return f"**{plain_markdown(bold)}** {plain_markdown(rest.strip())}"
