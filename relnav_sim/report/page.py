"""A report as data: everything the HTML and Markdown forms show, in the order they show it."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from relnav_sim.report.drawing import Picture
from relnav_sim.report.sentences import Sentence
from relnav_sim.report.tables import Table
from relnav_sim.statistics.regret import Regret

MOST_ROWS = 2000
"""Of a longer overview or table of requirements a reader gets the first rows: a browser needs seconds for all."""


@dataclass(frozen=True)
class CaseSection:
    """One case: its table, its figures, tables that are folded away at first, tables only for files, its curves.

    ``missing`` says of each part that could not be made why.
    """

    index: int
    label: str
    notes: tuple[str, ...]
    table: Table | None
    pictures: tuple[Picture, ...]
    more_tables: tuple[Table, ...]
    file_tables: tuple[Table, ...] = ()
    curves: Mapping[str, Any] | None = None
    missing: tuple[str, ...] = ()


@dataclass(frozen=True)
class RegretSection:
    """Filters under truths that they are not told of: what follows, tables, figures, and what could not be made.

    ``by_case`` has the regret of each case without a stress, by its number from 0.
    """

    sentences: tuple[str, ...]
    tables: tuple[Table, ...]
    pictures: tuple[Picture, ...]
    file_tables: tuple[Table, ...] = ()
    missing: tuple[str, ...] = ()
    by_case: Mapping[int, Regret] = field(default_factory=dict)


@dataclass(frozen=True)
class DecisionSection:
    """Which filter to fly: the sentence that says it, the others, the table that they go by, and its part to show."""

    lead: Sentence
    others: tuple[Sentence, ...]
    table: Table
    shown: Table


@dataclass(frozen=True)
class ScenarioSection:
    """What is simulated: its figure, what each filter is told of it, and what the campaign leaves out."""

    picture: Picture | None
    told: Table | None
    limitations: tuple[str, ...]


@dataclass(frozen=True)
class Page:
    """A whole report; ``missing`` says of each part outside the cases that could not be made why.

    ``cases`` are those that it shows closely, of ``all_cases`` in the result.
    """

    name: str
    facts: tuple[str, ...]
    summary: tuple[str, ...]
    overview: Table | None
    pictures: tuple[Picture, ...]
    cases: tuple[CaseSection, ...]
    commands: tuple[str, ...]
    settings: tuple[tuple[str, str], ...]
    filters: Table | None
    all_settings: Table | None
    campaign_text: str
    reading: tuple[str, ...]
    footer: str
    requirements: Table | None = None
    regret: RegretSection | None = None
    curves: str = ""
    filter_names: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    all_cases: int = 1
    decision: DecisionSection | None = None
    scenario: ScenarioSection | None = None
    document: tuple[str, ...] = ()

    @property
    def all_missing(self) -> tuple[str, ...]:
        """What could not be made anywhere in the report, a sentence each."""
        pictures = [*self.pictures, *(picture for case in self.cases for picture in case.pictures)]
        pictures += self.regret.pictures if self.regret is not None else ()
        pictures += [self.scenario.picture] if self.scenario is not None and self.scenario.picture else []
        about_regret = self.regret.missing if self.regret is not None else ()
        parts = [f"Case {case.index}: {sentence}" for case in self.cases for sentence in case.missing]
        return (*self.missing, *about_regret, *parts, *(picture.missing for picture in pictures if picture.missing))


def shortened(page: Page) -> Page:
    """Return a page for readers: of very long tables the first rows, and those that sentences of the decision cite."""
    sentences = (page.decision.lead, *page.decision.others) if page.decision is not None else ()
    cited = {clause.row for sentence in sentences for clause in sentence if clause.row}
    return replace(page, overview=_first_rows(page.overview, cited), requirements=_first_rows(page.requirements, cited))


def _first_rows(table: Table | None, cited: Container[str]) -> Table | None:
    if table is None or len(table.rows) <= MOST_ROWS:
        return table
    rows = [row for place, row in enumerate(table.rows) if place < MOST_ROWS or row.anchor in cited]
    caption = f"{table.caption} {len(rows)} of {len(table.rows)} rows; all: tables/{table.name}.csv."
    return replace(table, caption=caption, rows=tuple(rows))


def page_tables(page: Page) -> Sequence[Table]:
    """Return every table of a report, each of which is a CSV file too."""
    tables = [page.decision.table if page.decision else None, page.overview, page.requirements]
    if page.regret is not None:
        tables += [*page.regret.tables, *page.regret.file_tables]
    for case in page.cases:
        tables += [case.table, *case.more_tables, *case.file_tables]
    tables.append(page.scenario.told if page.scenario else None)
    return [table for table in (*tables, page.filters, page.all_settings) if table is not None]
