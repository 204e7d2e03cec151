"""The page for the browser: verdicts and evidence in one file, figures inside it."""

from __future__ import annotations

import base64
import functools
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from replication.findings import possible
from replication.pages import INTERVALS, SIZES, THRESHOLDS, TITLE, causes, verdict_in_words
from replication.papers import papers
from replication.summary import Claim, Summary

if TYPE_CHECKING:
    from jinja2 import Template


def html_page(summary: Summary, figures: Path) -> str:
    """Return the HTML page, with the figures of a folder inside it."""
    from markupsafe import Markup

    style = (files("relnav_sim.report") / "assets" / "page.css").read_text(encoding="utf-8")
    claims = {
        part.key: [claim for claim in summary.claims if claim.number in papers()[part.key].claims]
        for part in summary.papers
    }
    pictures = {plot.name: _data_uri(figures / f"{plot.name}.png") for part in summary.papers for plot in part.plots}

    def words(claim: Claim) -> str:
        return "; ".join(text for text in (verdict_in_words(claim), possible(summary.findings, claim.number)) if text)

    return _template().render(
        title=TITLE,
        size=SIZES[summary.size].replace("`", ""),
        principles=[text.replace("`", "") for text in (THRESHOLDS, INTERVALS)],
        causes=[text.replace("**", "") for text in causes(summary)],
        contradictions=[f"{paper.short}: {text}" for paper in papers().values() for text in paper.contradictions],
        summary=summary,
        claims=claims,
        pictures=pictures,
        words=words,
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
