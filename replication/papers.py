"""The three papers as data: what they report, as printed, and what they leave open."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib.resources import files
from typing import Any


@dataclass(frozen=True)
class Paper:
    """One paper.

    Attributes:
        key: Its name in relnav: ``alpha_kf``, ``mf_upf`` or ``two_step_kf``.
        short: Authors and year.
        title: Its title in English.
        citation: Authors, source and DOI.
        scenario: What it simulates, in words.
        silent: What it doesn't say.
        contradictions: Sentences and numbers of it that exclude each other.
        claims: Text by number of the claim.
        word_for_word: What the paper flown word for word gives instead, by number of the claim.
        content: Everything in papers.yaml, its tables by number included.
    """

    key: str
    short: str
    title: str
    citation: str
    scenario: str
    silent: tuple[str, ...]
    contradictions: tuple[str, ...]
    claims: dict[str, str]
    word_for_word: dict[str, str]
    content: dict[str, Any]


@functools.cache
def papers() -> dict[str, Paper]:
    """Return the papers by key, in the order they are replicated."""
    import yaml

    text = (files("replication") / "papers.yaml").read_text(encoding="utf-8")
    return {
        key: Paper(
            key=key,
            short=entry["short"],
            title=entry["title"],
            citation=f"{entry['authors']}: {entry['title']}. {entry['source']}. doi {entry['doi']}",
            scenario=entry["scenario"],
            silent=tuple(entry["silent"]),
            contradictions=tuple(entry["contradictions"]),
            claims={number: " ".join(text.split()) for number, text in entry["claims"].items()},
            word_for_word=entry.get("word_for_word", {}),
            content=entry,
        )
        for key, entry in yaml.safe_load(text).items()
    }


def paper_of(claim: str) -> Paper:
    """Return the paper that makes a claim, such as ``A1``.

    Raises:
        KeyError: No paper makes it.
    """
    for paper in papers().values():
        if claim in paper.claims:
            return paper
    raise KeyError(claim)
