"""The outcome of a replication as data: what the pages show."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from relnav_sim.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Claim:
    """One claim with its verdict.

    Attributes:
        number: ``A1``.
        text: What the paper claims.
        rule: The rule in words.
        verdict: ``reproduced``, ``reproduced only if`` or ``not reproduced``.
        conditions: With ``reproduced only if``: the interpretations in which it holds, by family.
        found: The main effects in a few words.
        window: The span of time that they are of.
        runs: Runs of the main interpretations; 0 where nothing was simulated.
        why: The causes: title and what the experiment shows.
        evidence: Every interpretation with its effects, intervals and outcome.
        missing: Interpretations that were not run.
        undecided: Not reproduced, but no main interpretation contradicts the claim either: too few runs.
        stated: With ``reproduced only if``: whether it holds in a main interpretation, not in another one alone.
        fails: Whether an interpretation contradicts the claim; if none does, those without it are undecided.
    """

    number: str
    text: str
    rule: str
    verdict: str
    conditions: tuple[str, ...]
    found: str
    window: str
    runs: int
    why: tuple[str, ...]
    evidence: Table
    missing: tuple[str, ...] = ()
    undecided: bool = False
    stated: bool = True
    fails: bool = True


@dataclass(frozen=True)
class Plot:
    """A figure: the paper's number ("Figs. 3 and 5"), the file's name, caption, alternative text and what draws it."""

    number: str
    name: str
    caption: str
    alt: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Experiment:
    """An experiment that shows a cause: its claims, what it shows in sentences, and its table.

    The last sentence of the text is on the page of verdicts, unless ``detail`` keeps it on that of the evidence.
    """

    title: str
    claims: tuple[str, ...]
    text: tuple[str, ...]
    table: Table
    detail: bool = False


@dataclass(frozen=True)
class PaperPart:
    """Everything about one paper."""

    key: str
    short: str
    citation: str
    scenario: str
    silent: tuple[str, ...]
    index: Table
    tables: tuple[Table, ...]
    plots: tuple[Plot, ...]
    experiments: tuple[Experiment, ...]
    beyond: tuple[Table, ...]


@dataclass(frozen=True)
class Summary:
    """A whole replication.

    Attributes:
        size: ``full``, or ``trial``, whose verdicts mean nothing.
        claims: Every claim with its verdict.
        papers: What belongs to each paper.
        campaigns: The campaigns with their sizes.
        missing: Campaigns of the plan that have not been run.
        cpu_hours: What those that have been run took.
        findings: What the inference from all printed numbers found: `replication.findings`.
    """

    size: str
    claims: tuple[Claim, ...]
    papers: tuple[PaperPart, ...]
    campaigns: Table
    missing: tuple[str, ...]
    cpu_hours: float
    findings: Mapping[str, Any]


def written(summary: Summary) -> str:
    """Return the summary as JSON text, for programs; pages are made of the summary itself."""
    return json.dumps(_plain(summary), ensure_ascii=False, indent=1) + "\n"


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = (item.name for item in dataclasses.fields(value) if item.name != "draw")
        return {name: _plain(getattr(value, name)) for name in fields}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
