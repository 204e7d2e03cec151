"""The outcome of a replication as data: what the pages show, kept as one JSON file.

Everything a page says is in here, so that a page can be made again, and checked, without the campaigns. Figures are
rounded to six digits and there are no times, versions or dates: two replications give the same bytes.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words

_DIGITS = 6


@dataclass(frozen=True)
class Claim:
    """One claim with its verdict.

    Attributes:
        number: ``A1``.
        text: What the paper claims.
        rule: The rule in words.
        verdict: ``reproduced``, ``reproduced only if`` or ``not reproduced``.
        conditions: With ``reproduced only if``: the readings in which it holds.
        found: The main effects in a few words.
        runs: Runs of the main readings; 0 where nothing was simulated.
        why: The cause, in sentences with the figures of its experiment.
        evidence: Every reading with its effects, intervals and outcome.
        missing: Readings that were not run.
        undecided: Not reproduced, but no main reading contradicts the claim either: too few runs.
    """

    number: str
    text: str
    rule: str
    verdict: str
    conditions: tuple[str, ...]
    found: str
    runs: int
    why: tuple[str, ...]
    evidence: Table
    missing: tuple[str, ...] = ()
    undecided: bool = False


@dataclass(frozen=True)
class Plot:
    """A figure: the paper's number ("Figs. 3 and 5"), the file's name, caption and alternative text."""

    number: str
    name: str
    caption: str
    alt: str


@dataclass(frozen=True)
class Experiment:
    """An experiment that shows a cause: its claims, what it shows in sentences, and its table."""

    title: str
    claims: tuple[str, ...]
    text: tuple[str, ...]
    table: Table


@dataclass(frozen=True)
class PaperPart:
    """Everything about one paper."""

    key: str
    short: str
    citation: str
    scenario: str
    silent: tuple[str, ...]
    learned: tuple[str, ...]
    index: Table
    tables: tuple[Table, ...]
    plots: tuple[Plot, ...]
    experiments: tuple[Experiment, ...]
    beyond: tuple[Table, ...]


@dataclass(frozen=True)
class Summary:
    """A whole replication.

    Attributes:
        size: Size of the plan; ``mixed``: the usual one, with the full size of some campaigns.
        claims: Every claim with its verdict.
        papers: What belongs to each paper.
        campaigns: The campaigns with their sizes.
        usual_sha256: Of the file of the summary of the usual size, where this is another one of the same results.
    """

    size: str
    claims: tuple[Claim, ...]
    papers: tuple[PaperPart, ...]
    campaigns: Table
    usual_sha256: str = ""


def written(summary: Summary) -> str:
    """Return the summary as JSON text."""
    return json.dumps(_plain(summary), ensure_ascii=False, indent=1) + "\n"


def fingerprint(summary: Summary) -> str:
    """Return the SHA-256 of the summary's file."""
    return hashlib.sha256(written(summary).encode("utf-8")).hexdigest()


def read_summary(path: Path) -> Summary:
    """Return the summary in a file.

    Raises:
        OSError: The file can't be read.
        ValueError: It is no summary.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return _summary(content)
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path} is no summary of a replication: {error}") from error


def as_stored(summary: Summary) -> Summary:
    """Return the summary as it comes back from its file, figures rounded."""
    return _summary(json.loads(written(summary)))


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kept = {}
        for item in dataclasses.fields(value):
            entry = getattr(value, item.name)
            # What is at its default says nothing: half the file.
            if item.default is dataclasses.MISSING or not _same(entry, item.default):
                kept[item.name] = _plain(entry)
        return kept
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return _rounded(value)
    return value


def _same(value: Any, default: Any) -> bool:
    both_nan = isinstance(value, float) and isinstance(default, float) and math.isnan(value) and math.isnan(default)
    return both_nan or bool(value == default)


def _rounded(value: float) -> float | str | None:
    """Return a figure with six digits; JSON has no NaN and no infinity."""
    if math.isnan(value):
        return None
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return float(f"{value:.{_DIGITS}g}")


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _cell(content: Mapping[str, Any]) -> Cell:
    if "value" not in content:
        return Words(**content)
    figures = {key: _number(content[key]) for key in ("value", "low", "high") if key in content}
    return Number(**{**content, **figures})


def _table(content: Mapping[str, Any]) -> Table:
    rows = tuple(Row(**{**row, "cells": tuple(map(_cell, row["cells"]))}) for row in content["rows"])
    return Table(**{**content, "columns": tuple(Column(**item) for item in content["columns"]), "rows": rows})


def _claim(content: Mapping[str, Any]) -> Claim:
    lists = {key: tuple(content.get(key, ())) for key in ("conditions", "why", "missing")}
    return Claim(**{**content, **lists, "evidence": _table(content["evidence"])})


def _experiment(content: Mapping[str, Any]) -> Experiment:
    return Experiment(content["title"], tuple(content["claims"]), tuple(content["text"]), _table(content["table"]))


def _part(content: Mapping[str, Any]) -> PaperPart:
    return PaperPart(
        **{
            **content,
            "silent": tuple(content["silent"]),
            "learned": tuple(content["learned"]),
            "index": _table(content["index"]),
            "tables": tuple(map(_table, content["tables"])),
            "plots": tuple(Plot(**plot) for plot in content["plots"]),
            "experiments": tuple(map(_experiment, content["experiments"])),
            "beyond": tuple(map(_table, content["beyond"])),
        }
    )


def _summary(content: Mapping[str, Any]) -> Summary:
    return Summary(
        content["size"],
        tuple(map(_claim, content["claims"])),
        tuple(map(_part, content["papers"])),
        _table(content["campaigns"]),
        content.get("usual_sha256", ""),
    )
