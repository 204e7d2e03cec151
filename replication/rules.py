"""The form of a rule: what must be seen, where, and at which confidence, before a claim counts as reproduced.

The rules themselves (`alpha_kf_rules`, `mf_upf_rules`, `two_step_rules`) are data and were written before any result
was looked at. Three principles make all thresholds, so that none is chosen for a claim of its own:

- An improvement counts as reproduced when at least HALF of it is there, at 95 % confidence.
- A size ("about 5 m", "18 s") counts as reproduced within a factor of TWO.
- A limit ("below 0.5 m") is taken as printed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

Kind = Literal["reduction", "difference", "value", "median", "ratio of medians", "share", "margin", "operations"]

HALF = 0.5
TWO = 2.0


@dataclass(frozen=True)
class Reading:
    """One way to read what a paper leaves open: the campaign, case and filters that stand for it.

    Attributes:
        name: Short name.
        words: Completes "reproduced only ...": "with each filter tuned for itself".
        campaign: Name of the campaign.
        filters: Filter of the campaign by its role in the rule.
        case: Swept variables that pick the case; empty where the campaign has one.
        columns: Columns of the summary that take the place of those in the rule's parts.
        samples: For counted operations: the number of samples; no campaign then.
    """

    name: str
    words: str
    campaign: str = ""
    filters: Mapping[str, str] = field(default_factory=dict)
    case: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    samples: int = 0


@dataclass(frozen=True)
class Part:
    """One figure that must lie in a range.

    Attributes:
        what: The figure in words.
        kind: How it is made of the runs' figures: `effects.effect`.
        of: Role of the filter that the claim is about; for ``margin`` several.
        column: Column of `Results.summary`.
        against: Role of the filter it is compared with; for ``margin`` several.
        unit: Unit of the figure.
        published: The figure in the paper; NaN where it has none.
        at_least: Least figure that counts as reproduced.
        at_most: Largest.
        within: For ``share``: the value of the column below which a run counts.
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


@dataclass(frozen=True)
class Rule:
    """When a claim counts as reproduced.

    Attributes:
        claim: Number of the claim, such as ``A1``.
        text: The rule in words.
        parts: All must hold in a reading.
        main: Readings that must all hold for ``reproduced``.
        others: Readings of which one is enough for ``reproduced only if``.
    """

    claim: str
    text: str
    parts: tuple[Part, ...]
    main: tuple[Reading, ...]
    others: tuple[Reading, ...] = ()


def reduction(of: str, against: str, column: str, published_percent: float, what: str) -> Part:
    """Return the part of a published reduction in percent: at least half of it."""
    return Part(what, "reduction", (of,), column, "%", (against,), published_percent, at_least=HALF * published_percent)


def within_factor(part: Part, factor: float = TWO) -> Part:
    """Return a part whose figure must be the published one within a factor."""
    return replace(part, at_least=part.published / factor, at_most=part.published * factor)
