"""Sentences of a page whose clauses link to the rows that hold their numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Clause:
    """A part of a sentence; ``table`` and ``row`` name where its number stands, empty where it has none."""

    text: str
    table: str = ""
    row: str = ""

    @property
    def target(self) -> str:
        """The place in the page that it links to; empty without one."""
        return self.row or self.table


Sentence = tuple[Clause, ...]


def plain(sentence: Iterable[Clause]) -> str:
    """Return a sentence without its links."""
    return "".join(clause.text for clause in sentence)


def joined(parts: Iterable[Iterable[Clause]], between: str, last: str = "") -> list[Clause]:
    """Return parts of sentences with a text between each two, before the last one another if it is given."""
    found: list[Clause] = []
    listed = list(parts)
    for place, part in enumerate(listed):
        if place:
            found.append(Clause(last if last and place == len(listed) - 1 else between))
        found += part
    return found
