"""A judgement as a table: every reading, every effect with its interval, and what it says."""

from __future__ import annotations

import math
from collections.abc import Iterable

from relnav_sim.report.tables import Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.intervals import Interval
from relnav_sim.wording import MISSING, shown_number
from replication.effects import Effect, Evidence, Judgement

OUTCOMES = {"holds": "holds", "fails": "fails", "open": "undecided"}
_COLUMNS = (
    Column("figure", numeric=False),
    Column("paper", numeric=True),
    Column("counts as reproduced", numeric=False),
    Column("relnav"),
    Column("runs"),
    Column("outcome", numeric=False),
)


def number_of(interval: Interval, decimals: int | None = None, note: str = "") -> Number:
    """Return an interval as a cell."""
    if decimals is None:
        decimals = decimals_for([interval.estimate], [(interval.high - interval.low) / 2])
    return Number(interval.estimate, interval.low, interval.high, decimals, note=note)


def evidence_table(judgement: Judgement) -> Table:
    """Return every reading of a rule with its effects."""
    rows = []
    for item in judgement.evidence:
        for index, effect in enumerate(item.effects):
            label = item.reading.words if index == 0 else ""
            rows.append(Row(label, _cells(effect, item), unit="", opens_block=index == 0))
    claim = judgement.rule.claim
    return Table(
        f"claim_{claim}",
        f"{claim}: the evidence",
        "Intervals: 95 % over runs for the main readings (marked *); the others share 5 % of error. A reading holds "
        "when every figure's whole interval is where the rule asks for it.",
        "reading",
        _COLUMNS,
        tuple(rows),
    )


def _cells(effect: Effect, item: Evidence) -> tuple[Words | Number, ...]:
    part, interval = effect.part, effect.interval
    decimals = decimals_for([interval.estimate], [(interval.high - interval.low) / 2])
    unit = "" if part.unit == "1" else f" {part.unit}"
    return (
        Words(part.what + (f" [{part.unit}]" if unit else "") + (" *" if item.main else "")),
        Number(part.published, decimals=_printed(part.published)),
        Words(_range(part.at_least, part.at_most, unit)),
        Number(interval.estimate, interval.low, interval.high, decimals),
        Number(float(interval.runs), decimals=0),
        Words(OUTCOMES[effect.outcome], mark="best" if effect.outcome == "holds" else ""),
    )


def found_in_words(judgement: Judgement) -> str:
    """Return the first main reading's effects in a few words, published and found, and how the other readings end."""
    words = []
    main = [item for item in judgement.evidence if item.main]
    for item in main[:1]:
        for effect in item.effects:
            part, interval = effect.part, effect.interval
            unit = "" if part.unit == "1" else f" {part.unit}"
            number = number_of(interval)
            claimed = (
                f"; paper {shown_number(part.published, _printed(part.published))}{unit}"
                if math.isfinite(part.published)
                else ""
            )
            words.append(f"{part.what} {number.shown}{unit} {number.shown_interval}{claimed}".rstrip())
    for item in main[1:]:
        words.append(f"{item.reading.words}: {OUTCOMES[item.outcome]}")
    return ". ".join(_capital(text) for text in words) if words else MISSING


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def runs_of(judgements: Iterable[Evidence]) -> int:
    """Return the least number of runs behind the main readings."""
    runs = [effect.interval.runs for item in judgements if item.main for effect in item.effects]
    return min(runs, default=0)


def _printed(value: float) -> int:
    """Return how many decimals show a printed figure as it is, at most three."""
    if not math.isfinite(value):
        return 0
    return next((decimals for decimals in range(3) if abs(round(value, decimals) - value) < 1e-9), 3)


def _range(at_least: float, at_most: float, unit: str) -> str:
    low = "" if math.isinf(at_least) else f"at least {at_least:.3g}{unit}"
    high = "" if math.isinf(at_most) else f"at most {at_most:.3g}{unit}"
    return ", ".join(part for part in (low, high) if part)
