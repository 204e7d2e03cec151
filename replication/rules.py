"""The form of a rule: what must be seen, where, and at which confidence, before a claim counts as reproduced.

The rules themselves are data, one module a paper. Principles make all thresholds, so that none is chosen for a claim
of its own:

- An improvement counts as reproduced when at least HALF of it is there, at 95 % confidence.
- A size ("about 5 m", "18 s") counts as reproduced within a factor of TWO.
- A limit ("below 0.5 m") is taken as printed.
- A number printed of a single run counts as reproduced within TWO standard deviations of our single runs.
- A period counts as reproduced within a TENTH.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

Kind = Literal[
    "reduction", "difference", "value", "median", "ratio of medians", "share", "margin", "operations", "distance"
]

HALF = 0.5
TWO = 2.0
TENTH = 0.1


@dataclass(frozen=True)
class Interpretation:
    """One way to take what a paper leaves open: the campaign, case and filters that stand for it.

    Attributes:
        name: Short name.
        words: Completes "reproduced only ...": "with each filter tuned for itself".
        campaign: Name of the campaign.
        filters: Filter of the campaign by its role in the rule.
        case: Swept variables that pick the case; empty where the campaign has one.
        columns: Columns that take the place of those in the rule's parts.
        samples: For counted operations: the number of samples; no campaign then.
        repeats: Numbers of cases that differ by the seed of the tuning alone: their variance is part of the interval.
        family: What several interpretations have in common, as a condition; default: `words`.
    """

    name: str
    words: str
    campaign: str = ""
    filters: Mapping[str, str] = field(default_factory=dict)
    case: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    samples: int = 0
    repeats: tuple[int, ...] = ()
    family: str = ""


@dataclass(frozen=True)
class Part:
    """One figure that must lie in a range.

    Attributes:
        what: The figure in words.
        kind: How it is made of the runs' figures: `effects.effect`.
        of: Role of the filter that the claim is about; for ``margin`` several.
        column: A column of `kept.COLUMNS`.
        against: Role of the filter it is compared with; for ``margin`` several.
        unit: Unit of the figure.
        published: The figure in the paper; NaN where it has none.
        at_least: Least figure that counts as reproduced.
        at_most: Largest.
        within: For ``share``: the value of the column below which a run counts.
        printed: For ``distance``: the number in the paper.
        rounding: For ``distance``: the unit of its last digit.
    """

    what: str
    kind: Kind
    of: tuple[str, ...]
    column: str
    unit: str
    against: tuple[str, ...] = ()
    published: float = math.nan
    at_least: float = -math.inf
    at_most: float = math.inf
    within: float = math.nan
    printed: float = math.nan
    rounding: float = 0.0


@dataclass(frozen=True)
class Rule:
    """When a claim counts as reproduced.

    Attributes:
        claim: Number of the claim, such as ``A1``.
        text: The rule in words.
        parts: All must hold in an interpretation.
        main: Interpretations that must all hold for ``reproduced``.
        others: Interpretations of which one is enough for ``reproduced only if``.
        window: The span that its figures are of, where that is not the whole run or its steady state.
    """

    claim: str
    text: str
    parts: tuple[Part, ...]
    main: tuple[Interpretation, ...]
    others: tuple[Interpretation, ...] = ()
    window: str = ""


def reduction(of: str, against: str, column: str, published_percent: float, what: str) -> Part:
    """Return the part of a published reduction in percent: at least half of it."""
    return Part(what, "reduction", (of,), column, "%", (against,), published_percent, at_least=HALF * published_percent)


def within_factor(part: Part, factor: float = TWO) -> Part:
    """Return a part whose figure must be the published one within a factor."""
    return replace(part, at_least=part.published / factor, at_most=part.published * factor)


def within_tenth(part: Part) -> Part:
    """Return a part whose figure must be the published one within a tenth."""
    return replace(part, at_least=part.published * (1 - TENTH), at_most=part.published * (1 + TENTH))


def among_single_runs(of: str, column: str, printed: float, what: str, rounding: float = 0.001) -> Part:
    """Return the part of a number printed of one run: within two standard deviations of our single runs."""
    return Part(what, "distance", (of,), column, "std", at_least=-TWO, at_most=TWO, printed=printed, rounding=rounding)
