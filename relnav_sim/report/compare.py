"""Two results, or two filters across results, set against each other run by run.

The same run of the same case has the same random numbers in both if the seeds are the same, so differences are paired
even where the two were computed on different days. What cannot be paired is named with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.run_figures import RunFigures, Span, headline_span, run_figures
from relnav_sim.report.comparison_table import DECIDED_AT, decided_at, fewest_in_words, p_number, verdict_in_words
from relnav_sim.report.metrics import (
    CONVERGENCE,
    POSITION_RMS,
    VELOCITY_RMS,
    Metric,
    convergence_s,
    numbers,
    position_rms,
    velocity_rms,
)
from relnav_sim.report.ranking import in_percent
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.results.afterwards import known_when
from relnav_sim.results.changes import changed_keys
from relnav_sim.results.comparable import different_code, same_numbers
from relnav_sim.results.seal import NO_SEAL
from relnav_sim.statistics.intervals import NO_INTERVAL, Comparison, mean_interval, paired_differences
from relnav_sim.wording import first_of, short_labels

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

PerRun = Callable[[RunFigures, Span], Array]
_COMPARED: tuple[tuple[Metric, PerRun], ...] = (
    (POSITION_RMS, position_rms),
    (VELOCITY_RMS, velocity_rms),
    (replace(CONVERGENCE, label="convergence time"), convergence_s),  # a mean, as all differences here
)
"""Each with its value for a run."""


@dataclass(frozen=True)
class Side:
    """One side of a comparison: a result, its name, and the one filter to look at; None: every filter."""

    results: Results
    name: str
    filter: str | None = None


@dataclass(frozen=True)
class _Row:
    """What tells the rows apart."""

    case: str
    filters: tuple[str, str]
    known: tuple[str, str]
    metric: Metric

    @property
    def names(self) -> str:
        """The filters, with when their estimates are known where that is not alike."""
        apart = self.known[0] != self.known[1]
        said = [
            f"{name} (known {when})" if apart and when else name
            for name, when in zip(self.filters, self.known, strict=True)
        ]
        return " against ".join(dict.fromkeys(said))


@dataclass(frozen=True)
class Compared:
    """What came of a comparison.

    Attributes:
        table: A row per case, pair of filters and figure; None where nothing could be paired.
        reasons: What could not be paired, and why.
        notes: What else a reader must know.
    """

    table: Table | None
    reasons: tuple[str, ...]
    notes: tuple[str, ...]


def compare(first: Side, second: Side) -> Compared:
    """Return the differences between two sides, first minus second, each verdict adjusted for all of them."""
    a, b = first.results, second.results
    notes = different_code(a.provenance, b.provenance) if a.path.resolve() != b.path.resolve() else []
    notes += [f"{side.name}: {NO_SEAL}" for side in (first, second) if not side.results.sealed]
    if first.filter == second.filter and same_numbers(a, b):
        notes.append("both sides are identical: the same runs and numbers, bit for bit")
    if a.seed != b.seed:
        reason = f"the seeds differ ({a.seed} and {b.seed}): no run has the same random numbers in both"
        return Compared(None, (reason,), tuple(notes))
    places = {header.id: index for index, header in enumerate(b.headers)}
    labels = short_labels([header.label for header in a.headers])
    reasons: list[str] = []
    later: list[str] = []
    found: dict[_Row, tuple[Array, Array]] = {}
    for index, header in enumerate(a.headers):
        if header.id not in places:
            reasons.append(f"case {labels[index]}: only in {first.name}, with these settings")
            continue
        place = places[header.id]
        one, other = _figures(a, index), _figures(b, place)
        span = headline_span(one.values())
        for names in _filters(first, second, list(one), list(other), reasons, labels[index]):
            notes += _other_settings(a, b, index, place, names)
            known = (known_when(a, index, names[0]), known_when(b, place, names[1]))
            later += _known_apart((first, second), names, known)
            runs = 0
            for metric, of_runs in _COMPARED:
                values = _paired(one[names[0]], other[names[1]], span, of_runs)
                runs = max(runs, len(values[0]))
                if len(values[0]):
                    found[_Row(labels[index], names, known, metric)] = values
            if not runs:
                reasons.append(f"case {labels[index]}: {' and '.join(names)} have no completed run in common")
    keys = [
        key
        for key in changed_keys(a.campaign_content, b.campaign_content)
        if key.split(".")[0] not in ("name", "seed", "filters")
    ]
    reasons += [f"the campaigns differ in {first_of(keys)}"] if keys else []
    here = {header.id for header in a.headers}
    spare = short_labels([header.label for header in b.headers])
    reasons += [
        f"case {spare[index]}: only in {second.name}, with these settings"
        for index, header in enumerate(b.headers)
        if header.id not in here
    ]
    later = list(dict.fromkeys(later))
    table = _table(first, second, found, later) if found else None
    return Compared(table, tuple(reasons), (*later, *dict.fromkeys(notes)))


def _figures(results: Results, index: int) -> dict[str, RunFigures]:
    """Return what is known of each run of a case's filters, of those that have runs, by their names."""
    names = results.headers[index].filters
    return {name: run_figures(results, index, name) for name in names if len(results.case_runs(index, name))}


def _filters(
    first: Side, second: Side, one: Sequence[str], other: Sequence[str], reasons: list[str], label: str
) -> list[tuple[str, str]]:
    """Return the pairs of filters to compare in a case: those named, else those of the same name."""
    here, there = first.filter or second.filter, second.filter or first.filter
    if here is not None and there is not None:
        wanted = [(here, there)]
    else:
        wanted = [(name, name) for name in one if name in other]
        reasons += [] if wanted else [f"case {label}: {first.name} and {second.name} have no filter in common"]
    held: list[tuple[str, str]] = []
    for pair in wanted:
        absent = [
            f"case {label}: {side.name} has no run of {name}"
            for side, name, held_there in zip((first, second), pair, (one, other), strict=True)
            if name not in held_there
        ]
        reasons += absent
        held += [] if absent else [pair]
    return held


def _other_settings(a: Results, b: Results, index: int, place: int, names: tuple[str, str]) -> list[str]:
    if names[0] != names[1] or a.headers[index].filter_ids[names[0]] == b.headers[place].filter_ids[names[1]]:
        return []
    return [f"{names[0]} has other settings in each of the two"]


def _known_apart(sides: tuple[Side, Side], names: tuple[str, str], known: tuple[str, str]) -> list[str]:
    """Return a sentence where the estimates of two rows are not known at the same time."""
    if known[0] == known[1]:
        return []
    if names[0] == names[1]:
        names = (f"{names[0]} of {sides[0].name}", f"{names[1]} of {sides[1].name}")
    one, other = (f"{name} is known {when or 'in flight'}" for name, when in zip(names, known, strict=True))
    return [
        f"{one}, {other}: a row that is known later has had more measurements and is no filter to fly, so its "
        "verdict is "
        "not one between two filters."
    ]


def _paired(one: RunFigures, other: RunFigures, span: Span, of_runs: PerRun) -> tuple[Array, Array]:
    """Return a metric of both filters on their common runs."""
    _, here, there = np.intersect1d(one.runs, other.runs, return_indices=True)
    first, second = (np.where(item.ok, of_runs(item, span), np.nan) for item in (one, other))
    both = np.isfinite(first[here]) & np.isfinite(second[there])
    return first[here][both], second[there][both]


def _table(first: Side, second: Side, found: dict[_Row, tuple[Array, Array]], later: Sequence[str]) -> Table:
    compared = paired_differences({key: one - other for key, (one, other) in found.items()})
    rows = []
    for key, (one, other) in found.items():
        rows.append(
            Row(
                key.case,
                (
                    Words(key.names),
                    Words(key.metric.label),
                    *numbers([mean_interval(one), mean_interval(other)]),
                    *_cells(compared[key], float(other.mean())),
                ),
                unit=key.metric.unit,
                opens_block=key.metric is POSITION_RMS,
            )
        )
    headings = ("filters", "quantity", first.name, second.name, "difference", "%", "verdict", "p", "decided at")
    words = ("filters", "quantity", "verdict", "decided at")
    return Table(
        name="comparison",
        title=f"{first.name} against {second.name}",
        caption="".join(f"{sentence} " for sentence in later)
        + "First minus second on their common runs that failed in neither: mean over runs, 95 % interval. The "
        "verdict is the first's. Verdicts, intervals of differences and p (sign-flip test, after Holm) hold at 95 % "
        "for all rows together: zero lies in an interval where the verdict is undecided. "
        f"{DECIDED_AT} {fewest_in_words(len(found), 'row')}",
        corner="case",
        columns=tuple(Column(heading, numeric=heading not in words) for heading in headings),
        rows=tuple(rows),
    )


def _cells(comparison: Comparison, reference: float) -> Sequence[Cell]:
    difference = comparison.difference
    percent = in_percent(difference, reference) if reference else NO_INTERVAL
    return (
        *numbers([difference]),
        *numbers([percent]),
        Words(verdict_in_words(comparison)),
        p_number(comparison.p_value),
        Words(decided_at(comparison)),
    )
