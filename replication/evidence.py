"""A judgement as a table: every interpretation, every effect with its interval, and what it says."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from relnav_sim.report.tables import Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.intervals import Interval
from relnav_sim.wording import MISSING, shown_number
from replication.effects import Effect, Evidence, Judgement
from replication.rules import Part

_MOST_PERCENT = 300.0
"""What is further above is told as a ratio."""
OUTCOMES = {"holds": "holds", "fails": "fails", "open": "undecided"}
_COLUMNS = (
    Column("value", numeric=False),
    Column("paper", numeric=True),
    Column("counts as reproduced", numeric=False),
    Column("relnav"),
    Column("window", numeric=False),
    Column("runs"),
    Column("outcome", numeric=False),
)


def number_of(interval: Interval, decimals: int | None = None, note: str = "") -> Number:
    """Return an interval as a cell."""
    if decimals is None:
        decimals = decimals_for([interval.estimate], [(interval.high - interval.low) / 2])
    return Number(interval.estimate, interval.low, interval.high, decimals, note=note or _one_end(interval))


def _one_end(interval: Interval) -> str:
    """Return in words the interval of a ratio that has no upper end; nothing where it has one, or is not known."""
    if interval.high != math.inf:
        return ""
    return f"[{shown_number(interval.low, 1)} or more]" if interval.low > 0 else "[no bound]"


def evidence_table(judgement: Judgement) -> Table:
    """Return every interpretation of a rule with its effects."""
    rows = []
    for item in judgement.evidence:
        for index, effect in enumerate(item.effects):
            label = item.interpretation.words if index == 0 else ""
            rows.append(Row(label, _cells(effect, item), unit="", opens_block=index == 0))
    claim = judgement.rule.claim
    return Table(f"claim_{claim}", f"{claim}: the evidence", "", "interpretation", _COLUMNS, tuple(rows))


def _cells(effect: Effect, item: Evidence) -> tuple[Words | Number, ...]:
    part, interval = as_told(effect)
    decimals = decimals_for([interval.estimate], [(interval.high - interval.low) / 2])
    unit = unit_of(part.unit)
    return (
        Words(part.what + (f" [{part.unit}]" if unit else "") + (" *" if item.main else "")),
        Number(part.published, decimals=_printed(part.published)),
        Words(_range(part.at_least, part.at_most, unit)),
        number_of(interval, decimals),
        Words(item.window),
        Number(float(interval.runs), decimals=0),
        Words(OUTCOMES[effect.outcome], mark="best" if effect.outcome == "holds" else ""),
    )


def as_told(effect: Effect) -> tuple[Part, Interval]:
    """Return an effect as it is told: where a size is far above what it should be below, their ratio, not a percentage.

    Example:
        >>> part = Part("error below the EKF's", "reduction", ("a",), "r", "%", ("ekf",), at_least=20.0)
        >>> told, ratio = as_told(Effect(part, Interval(-900.0, -1000.0, -800.0, 0.95, 9), "fails"))
        >>> told.what, told.at_most, ratio.estimate, ratio.low, ratio.high
        ("error over the EKF's", 0.8, 10.0, 9.0, 11.0)
    """
    part, below = effect.part, effect.interval
    if part.kind not in ("reduction", "margin") or not below.low < -_MOST_PERCENT:
        return part, below
    what = part.what.replace("below ", "over ", 1)
    bound, published = 1 - part.at_least / 100, 1 - part.published / 100
    told = replace(part, what=what, unit="×", at_least=-math.inf, at_most=bound, published=published)
    # A ratio of sizes is not negative, though an interval of Student's may be.
    ratio, low, high = (max(0.0, 1 - end / 100) for end in (below.estimate, below.high, below.low))
    return told, Interval(ratio, low, high, below.level, below.runs)


def unit_of(unit: str) -> str:
    """Return a unit as it stands behind a number."""
    return "" if unit == "1" else f" {unit}"


def found_in_words(judgement: Judgement) -> str:
    """Return the first main interpretation's effects in a few words, and how the others end.

    Where some hold the verdict itself says which.
    """
    mains = [item for item in judgement.evidence if item.main]
    if not mains:
        return MISSING
    words = []
    for effect in mains[0].effects:
        part, interval = as_told(effect)
        unit, number = unit_of(part.unit), number_of(interval)
        claimed = ""
        if math.isfinite(part.published):
            claimed = f" (paper {shown_number(part.published, _printed(part.published))})"
        words.append(f"{part.what} {number.shown}{unit} {number.shown_interval or number.note}".rstrip() + claimed)
    told = () if judgement.verdict == "reproduced only if" else mains[1:]
    others = [f"{item.interpretation.words}: {OUTCOMES[item.outcome]}" for item in told]
    return ". ".join(text[:1].upper() + text[1:] for text in ("; ".join(words), "; ".join(others)) if text)


def runs_of(judgements: Iterable[Evidence]) -> int:
    """Return the least number of runs behind the main interpretations."""
    runs = [effect.interval.runs for item in judgements if item.main for effect in item.effects]
    return min(runs, default=0)


def _printed(value: float) -> int:
    """Return how many decimals show a printed value as it is, or to three digits where it follows from printed ones."""
    if not math.isfinite(value):
        return 0
    exact = (decimals for decimals in range(6) if abs(round(value, decimals) - value) < 1e-9)
    return next(exact, max(0, 2 - math.floor(math.log10(abs(value)))))


def _range(at_least: float, at_most: float, unit: str) -> str:
    low = "" if math.isinf(at_least) else f"at least {at_least:.3g}{unit}"
    high = "" if math.isinf(at_most) else f"at most {at_most:.3g}{unit}"
    return ", ".join(part for part in (low, high) if part)
