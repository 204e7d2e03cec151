"""A judgement as a table: every interpretation, every effect with its interval, and what it says."""

from __future__ import annotations

import math
from collections.abc import Iterable

from relnav_sim.report.tables import Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.intervals import Interval
from relnav_sim.wording import MISSING, shown_number
from replication.effects import Effect, Evidence, Judgement

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
    return Number(interval.estimate, interval.low, interval.high, decimals, note=note)


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
    part, interval = effect.part, effect.interval
    decimals = decimals_for([interval.estimate], [(interval.high - interval.low) / 2])
    unit = unit_of(part.unit)
    return (
        Words(part.what + (f" [{part.unit}]" if unit else "") + (" *" if item.main else "")),
        Number(part.published, decimals=_printed(part.published)),
        Words(_range(part.at_least, part.at_most, unit)),
        Number(interval.estimate, interval.low, interval.high, decimals),
        Words(item.window),
        Number(float(interval.runs), decimals=0),
        Words(OUTCOMES[effect.outcome], mark="best" if effect.outcome == "holds" else ""),
    )


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
        part, interval = effect.part, effect.interval
        unit, number = unit_of(part.unit), number_of(interval)
        claimed = ""
        if math.isfinite(part.published):
            claimed = f" (paper {shown_number(part.published, _printed(part.published))})"
        words.append(f"{part.what} {number.shown}{unit} {number.shown_interval}".rstrip() + claimed)
    told = () if judgement.verdict == "reproduced only if" else mains[1:]
    others = [f"{item.interpretation.words}: {OUTCOMES[item.outcome]}" for item in told]
    return ". ".join(text[:1].upper() + text[1:] for text in ("; ".join(words), "; ".join(others)) if text)


def runs_of(judgements: Iterable[Evidence]) -> int:
    """Return the least number of runs behind the main interpretations."""
    runs = [effect.interval.runs for item in judgements if item.main for effect in item.effects]
    return min(runs, default=0)


def _printed(value: float) -> int:
    """Return how many decimals show a printed value as it is, at most three."""
    if not math.isfinite(value):
        return 0
    return next((decimals for decimals in range(3) if abs(round(value, decimals) - value) < 1e-9), 3)


def _range(at_least: float, at_most: float, unit: str) -> str:
    low = "" if math.isinf(at_least) else f"at least {at_least:.3g}{unit}"
    high = "" if math.isinf(at_most) else f"at most {at_most:.3g}{unit}"
    return ", ".join(part for part in (low, high) if part)
