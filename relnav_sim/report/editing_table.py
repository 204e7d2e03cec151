"""What came of the editing of measurements: rejections, lock-outs and recoveries of a case's filters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relnav_sim.arrays import Mask
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import span_index
from relnav_sim.report.layouts import INTERVALS
from relnav_sim.report.metrics import numbers
from relnav_sim.report.ranking import in_percent
from relnav_sim.report.tables import Column, Row, Table
from relnav_sim.results.block import EDIT_ENDS, Editing
from relnav_sim.statistics.intervals import Interval, mean_interval, median_interval
from relnav_sim.statistics.proportions import share_of_runs
from relnav_sim.wording import counted, listed

Figure = Callable[[FilterFacts, Editing], Interval]
_NONE = Interval(np.nan, np.nan, np.nan, 0.95, 0)


def editing_table(case: CaseFacts) -> Table | None:
    """Return rejections by sensor, lock-outs, recoveries and how the runs end; None where nothing is edited."""
    sensors = dict.fromkeys(name for item in case.filters if item.editing is not None for name in item.editing.names)
    if not sensors:
        return None
    span = span_index(case.span)
    rows: list[Row] = []

    def add(
        label: str, figure: Callable[[FilterFacts, Editing], Interval], unit: str = "", opens: bool = False
    ) -> None:
        found = [_NONE if item.editing is None else figure(item, item.editing) for item in case.filters]
        rows.append(Row(label, numbers(found), unit, opens_block=opens))

    for sensor in sensors:

        def rejected(item: FilterFacts, held: Editing, sensor: str = sensor) -> Interval:
            if sensor not in held.names:
                return _NONE
            place = held.names.index(sensor)
            tests, refused = (np.asarray(part)[item.ok, span, place] for part in (held.tests, held.rejected))
            return mean_interval(100 * np.where(tests > 0, refused / np.maximum(tests, 1), np.nan), most=100)

        add(f"{sensor}: rejected", rejected, "%", opens=bool(rows))
    add("rejected if the filter is right", lambda item, held: _exact(100 * item.false_rejections), "%")
    add("lock-outs a run", lambda item, held: mean_interval(held.lock_outs.sum(axis=1)), opens=True)
    add("actions a run", lambda item, held: mean_interval(held.actions.sum(axis=1)))
    add("runs locked out", lambda item, held: _share(held.lock_outs.sum(axis=1) > 0), "%", opens=True)
    add("runs diverged for 10 N epochs", lambda item, held: _share(held.lost > 0), "%")
    add("runs recovered", lambda item, held: _share(held.recoveries > 0), "%")
    for end, words in (
        ("rejecting", "ends with measurements rejected"),
        ("adopted", "ends off the truth, fault adopted"),
        ("not_seen", "ends inside, not yet recovered"),
    ):
        place = EDIT_ENDS.index(end)
        add(words, lambda item, held, place=place: _share(held.end == place), "%", opens=end == "rejecting")  # type: ignore[misc]
    add("longest time to recover, median", lambda item, held: median_interval(held.recovery), "s", opens=True)
    add("longest time to recover, of all runs", lambda item, held: _exact(_largest(held)), "s")
    return Table(
        name=f"case_{case.index:03d}_editing",
        title="Measurement editing",
        caption=f"{INTERVALS} Rejected: share of the tests, {case.when}. A lock-out: as many rejections in a row as "
        "the filter's max_rejects N. Diverged for 10 N epochs: NEES above its 99.9 % quantile so long without a break. "
        "Recovered: after a lock-out, NEES inside and no sensor locked out for 10 N epochs in a row; the time is from "
        "the first of the rejections to the first of those epochs. A filter that takes measurements again and is off "
        "the truth has adopted a fault, and is not recovered. Shares of runs have exact intervals.",
        corner="quantity",
        columns=tuple(Column(item.name) for item in case.filters),
        rows=tuple(rows),
    )


def editing_notes(case: CaseFacts) -> list[str]:
    """Return in sentences which filters end off the truth after they were locked out."""
    notes = []
    for end, what in (
        (
            "adopted",
            "take measurements again that had locked them out, and are off the truth: a fault reported and adopted",
        ),
        ("rejecting", "still reject measurements"),
    ):
        place = EDIT_ENDS.index(end)
        ended = {item.name: int((item.editing.end == place).sum()) for item in case.filters if item.editing is not None}
        told = [
            f"{name} in {count} of {counted(len(item.runs), 'run')}"
            for item in case.filters
            for name, count in ended.items()
            if name == item.name and count
        ]
        if told:
            notes.append(f"At the end of the run some filters {what}: {listed(told)}.")
    return notes


def _share(runs: Mask) -> Interval:
    return in_percent(share_of_runs(int(np.sum(runs)), len(runs)).interval(), 1.0)


def _exact(value: float) -> Interval:
    return Interval(value, np.nan, np.nan, 0.95, 0)


def _largest(held: Editing) -> float:
    known = held.recovery[~np.isnan(held.recovery)]
    return float(known.max()) if len(known) else np.nan
