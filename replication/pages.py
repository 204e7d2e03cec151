"""The pages of a replication, made of its summary alone: Markdown for the documentation, HTML for the browser."""

from __future__ import annotations

import base64
import functools
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.report.tables import Table, plain_markdown
from relnav_sim.report.tables import markdown as table_markdown
from replication.evidence import OUTCOMES
from replication.summary import Claim, Experiment, PaperPart, Plot, Summary

if TYPE_CHECKING:
    from jinja2 import Template

TITLE = "Three papers, claim by claim"
_SHOWN_CONDITIONS = 2
SIZES = {
    "trial": "A trial of a few minutes: three runs of each case, shortened. Its verdicts mean nothing.",
    "usual": "Made by `make reproduce`.",
    "full": "Made by `make reproduce-full`: every campaign at the papers' sizes, 100 runs of each case.",
    "mixed": "Made of what `make reproduce-full` has completed, campaigns at the papers' sizes with 100 runs of each "
    "case, and of `make reproduce` for the rest; the table of campaigns at the end says which is which.",
}
PRINCIPLES = (
    "Thresholds and main readings were written, and committed, before any result; alternative readings that came "
    "later, before their own, but for those on the particle number and time step of Wei et al., of which one run had "
    "been seen. Three principles make every threshold: an improvement counts as reproduced when at least half of it is "
    "there; a size (“about 5 m”, “18 s”) within a factor of two; a limit (“below 0.5 m”) as printed.",
    "Intervals decide, at 95 % over runs: an effect holds when its whole interval is where the rule asks for it, "
    "fails when none of it is, and is undecided in between. A claim is reproduced when all its figures hold in all "
    "its main readings: one process noise for all filters, and each filter tuned on separate seeds. It is “reproduced "
    "only if …” when it holds in one of them, or in another reading of what the paper leaves open; those share 5 % of "
    "error between them.",
    "Tuned, for Shi et al., means: the process noise with the least RMS position error on seeds of its own, which "
    "`relnav tune` found for every filter by itself with the same budget: twelve values between 1e-11 and 1e-3 m²/s³, "
    "the common 1e-6 among them, each on the same ten runs of half a revolution (the `tune:` sections of the "
    "campaigns, which say the command). A value that ten runs can't tell from a better one, and that is nearer to the "
    "common one, is taken. In the sweep over α it is KF(R/α) that was tuned. For Wei et al. the campaign files say how "
    "each process noise was found.",
)


def markdown_page(summary: Summary, figures: str) -> str:
    """Return the Markdown page.

    Args:
        summary: As it comes back from its file (`as_stored`), so that the page can be made again from there.
        figures: Path of the figures' folder as the page links it.
    """
    parts = [f"# {TITLE}", SIZES[summary.size], "## Verdicts", verdict_table(summary)]
    parts += ["## How a claim is judged", *PRINCIPLES]
    for part in summary.papers:
        claims = [claim for claim in summary.claims if claim.number in claims_of(part)]
        parts += _paper(part, claims, figures)
    parts += ["## Campaigns", _table(summary.campaigns)]
    return "\n\n".join(item.strip("\n") for item in parts if item) + "\n"


def claims_of(part: PaperPart) -> tuple[str, ...]:
    """Return the numbers of a paper's claims."""
    from replication.papers import papers

    return tuple(papers()[part.key].claims)


def verdict_table(summary: Summary) -> str:
    """Return the verdicts as a Markdown table."""
    lines = ["| claim | what the paper says | verdict | what the main readings show | runs |", "|:--|:--|:--|:--|--:|"]
    for claim in summary.claims:
        runs = str(claim.runs) if claim.runs else "counted" if claim.number == "A7" else "0"
        cells = (claim.number, claim.text, f"**{verdict_in_words(claim)}**", claim.found, runs)
        lines.append(
            "| " + " | ".join(cell if cell.startswith("**") else plain_markdown(cell) for cell in cells) + " |"
        )
    return "\n".join(lines)


def verdict_in_words(claim: Claim) -> str:
    """Return the verdict with its conditions."""
    if not claim.evidence.rows:
        return "not run"
    if claim.verdict == "reproduced only if" and claim.conditions:
        shown, more = claim.conditions[:_SHOWN_CONDITIONS], len(claim.conditions) - _SHOWN_CONDITIONS
        rest = f", or in {more} more readings" if more > 1 else ", or in one more reading" if more == 1 else ""
        return f"reproduced only {'; or '.join(shown)}{rest}"
    return f"{claim.verdict} (undecided with these runs)" if claim.undecided else claim.verdict


def verdict_lines(summary: Summary) -> list[tuple[str, str, str]]:
    """Return number, verdict and what was found of every claim, for the terminal."""
    return [(claim.number, verdict_in_words(claim), claim.found) for claim in summary.claims]


def _paper(part: PaperPart, claims: Sequence[Claim], figures: str) -> list[str]:
    parts = [f"## {part.short}", plain_markdown(part.citation) + ".", plain_markdown(part.scenario)]
    parts.append(
        "What it leaves open, and these campaigns vary or state: " + "; ".join(map(plain_markdown, part.silent)) + "."
    )
    if part.learned:
        parts += ["**What the paper doesn't say:**", "\n".join(f"- {plain_markdown(text)}" for text in part.learned)]
    parts += [_table(part.index)]
    for claim in claims:
        parts += _claim(claim)
    if part.tables:
        parts += [f"### {part.short}: tables", *map(_table, part.tables)]
    if part.plots:
        parts += [f"### {part.short}: figures", *(_plot(plot, figures) for plot in part.plots)]
    for experiment in part.experiments:
        parts += _experiment(experiment)
    if part.beyond:
        parts += [f"### Beyond {part.short}", *map(_table, part.beyond)]
    return parts


def _claim(claim: Claim) -> list[str]:
    parts = [
        f"### {claim.number}: {plain_markdown(claim.text)}",
        f"**{verdict_in_words(claim)}.** {plain_markdown(claim.found)}",
    ]
    parts.append(f"Rule: {plain_markdown(claim.rule)}")
    if claim.why:
        parts.append("\n".join(f"- {plain_markdown(text)}" for text in claim.why))
    if claim.missing:
        parts.append(
            f"Not run here, and counted as {OUTCOMES['open']}: {', '.join(map(plain_markdown, claim.missing))}."
        )
    return [*parts, _folded("all readings", claim.evidence)]


def _experiment(experiment: Experiment) -> list[str]:
    claims = ", ".join(experiment.claims)
    text = [plain_markdown(sentence) for sentence in experiment.text]
    return [f"### Cause: {plain_markdown(experiment.title)} ({claims})", *text, _table(experiment.table)]


def _plot(plot: Plot, figures: str) -> str:
    caption = f"**{plain_markdown(plot.number)}.** {plain_markdown(plot.caption)}"
    return f"![{plain_markdown(plot.alt)}]({figures}/{plot.name}.png)\n\n{caption}"


def _table(table: Table) -> str:
    return table_markdown(table).replace("### ", "#### ", 1)


def _folded(words: str, table: Table) -> str:
    return f"<details><summary>{words}</summary>\n\n{_table(table)}\n\n</details>" if table.rows else ""


def html_page(summary: Summary, figures: Path) -> str:
    """Return the HTML page, with the figures of a folder inside it."""
    from markupsafe import Markup

    style = (files("relnav_sim.report") / "assets" / "page.css").read_text(encoding="utf-8")
    claims = {part.key: [c for c in summary.claims if c.number in claims_of(part)] for part in summary.papers}
    pictures = {plot.name: _data_uri(figures / f"{plot.name}.png") for part in summary.papers for plot in part.plots}
    return _template().render(
        title=TITLE,
        size=SIZES[summary.size].replace("`", ""),
        principles=[text.replace("`", "") for text in PRINCIPLES],
        summary=summary,
        claims=claims,
        pictures=pictures,
        words=verdict_in_words,
        style=Markup(style),
    )


def _data_uri(path: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


@functools.cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    text = (files("replication") / "page.html.j2").read_text(encoding="utf-8")
    return environment.from_string(text)
