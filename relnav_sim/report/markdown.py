"""A report as one Markdown file: the same words, tables and figures, the figures by their files."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.report.drawing import Picture
from relnav_sim.report.page import Page, shortened
from relnav_sim.report.sentences import Sentence
from relnav_sim.report.tables import Table, plain_markdown
from relnav_sim.report.tables import markdown as table_markdown


def render(page: Page) -> str:
    """Return the report as Markdown; what the campaign's author wrote shows as written."""
    page = shortened(page)
    parts = [f"# {plain_markdown(page.name)}", *([plain_markdown(" · ".join(page.document))] if page.document else [])]
    parts.append(plain_markdown(" · ".join(page.facts)))
    if page.decision is not None:
        parts += ["## Decision", _linked(page.decision.lead)]
        parts.append("\n".join(f"- {_linked(sentence)}" for sentence in page.decision.others))
        parts.append(_table(page.decision.shown))
    parts.append("## Summary")
    parts.append("\n".join(f"- {plain_markdown(sentence)}" for sentence in page.summary))
    parts += [plain_markdown(sentence) for sentence in page.missing]
    if page.scenario is not None:
        parts += ["## Scenario", *_pictures([page.scenario.picture] if page.scenario.picture else [])]
        parts += _tables(page.scenario.told)
        parts.append("\n".join(f"- {plain_markdown(sentence)}" for sentence in page.scenario.limitations))
    parts += ["## Requirements", _table(page.requirements)] if page.requirements else []
    parts += ["## Overview", *_tables(page.overview), *_pictures(page.pictures)]
    if page.regret is not None:
        parts.append("## Regret")
        parts += [plain_markdown(sentence) for sentence in (*page.regret.sentences, *page.regret.missing)]
        parts += [*_pictures(page.regret.pictures), *_tables(*page.regret.tables)]
    for case in page.cases:
        parts.append(f"## Case {case.index}: {plain_markdown(case.label)}")
        parts += [plain_markdown(note) for note in (*case.notes, *case.missing)]
        parts += _tables(case.table)
        parts += _pictures(case.pictures)
        parts += [_table(table) for table in case.more_tables]
    parts += ["## Campaign", _code("\n".join(page.commands))]
    parts.append("\n".join(f"- {plain_markdown(name)}: {plain_markdown(value)}" for name, value in page.settings))
    parts += [*_tables(page.filters, page.all_settings), _code(page.campaign_text)]
    parts.append("## How to read the values")
    parts.append("\n".join(f"- {plain_markdown(sentence)}" for sentence in page.reading))
    return "\n\n".join(part.strip("\n") for part in [*parts, plain_markdown(page.footer)]) + "\n"


def _table(table: Table) -> str:
    """Return a table after the name that sentences link to."""
    return f'<a id="{table.name}"></a>\n\n{table_markdown(table)}'


def _linked(sentence: Sentence) -> str:
    """Return a sentence whose numbers link to their tables; Markdown has no names for rows."""
    return "".join(
        f"[{plain_markdown(clause.text)}](#{clause.table})" if clause.table else _spaced(clause.text)
        for clause in sentence
    )


def _spaced(text: str) -> str:
    """Return text as written with the blanks at its ends, which separate it from the clauses beside it."""
    before, after = " " * (text[:1] == " "), " " * (text[-1:] == " " and bool(text.strip()))
    return f"{before}{plain_markdown(text)}{after}"


def _tables(*tables: Table | None) -> list[str]:
    return [_table(table) for table in tables if table is not None]


def _pictures(pictures: Sequence[Picture]) -> list[str]:
    return [
        plain_markdown(picture.missing)
        if picture.missing
        else f"![{plain_markdown(picture.alt)}](figures/{picture.name}.png)\n\n{plain_markdown(picture.caption)}"
        for picture in pictures
    ]


def _code(text: str) -> str:
    fence = "```"
    while fence in text:
        fence += "`"
    return f"{fence}\n{text.rstrip()}\n{fence}"
