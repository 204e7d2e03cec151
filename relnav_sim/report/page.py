"""A report as data: everything the HTML and Markdown forms show, in the order they show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from relnav_sim.report.drawing import Picture
from relnav_sim.report.tables import Table


@dataclass(frozen=True)
class CaseSection:
    """One case: its table, its figures, tables that are folded away at first, tables only for files, its curves."""

    number: int
    label: str
    notes: tuple[str, ...]
    table: Table | None
    pictures: tuple[Picture, ...]
    more_tables: tuple[Table, ...]
    file_tables: tuple[Table, ...] = ()
    curves: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Page:
    """A whole report."""

    name: str
    facts: tuple[str, ...]
    summary: tuple[str, ...]
    overview: Table
    pictures: tuple[Picture, ...]
    cases: tuple[CaseSection, ...]
    commands: tuple[str, ...]
    settings: tuple[tuple[str, str], ...]
    filters: Table
    all_settings: Table
    campaign_text: str
    reading: tuple[str, ...]
    footer: str
    requirements: Table | None = None
    curves: str = ""

    @property
    def filter_names(self) -> tuple[str, ...]:
        """Names of all filters."""
        return tuple(row.label for row in self.filters.rows)


def page_tables(page: Page) -> Sequence[Table]:
    """Return every table of a report, each of which is a CSV file too."""
    tables = [page.overview, *([page.requirements] if page.requirements else [])]
    for case in page.cases:
        tables += [table for table in (case.table, *case.more_tables, *case.file_tables) if table is not None]
    return [*tables, page.filters, page.all_settings]
