"""Regret in a report: the tables, the figure, and which filter to fly if the truth may be one of the stresses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.plots.regret import drawn_regret, regret_words
from relnav_sim.report.attempts import attempted
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
from relnav_sim.report.metrics import numbers
from relnav_sim.report.page import RegretSection
from relnav_sim.report.tables import Cell, Column, Row, Table, Words
from relnav_sim.results.block import RefusedError
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.regret import NOMINAL, Regret, regret
from relnav_sim.statistics.simultaneous_regret import RESAMPLES
from relnav_sim.wording import between, counted, listed, significant

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

MOST_SHOWN = 6
"""Cases whose regret is on the page; that of all is in the files."""


def regret_section(results: Results, figure_folder: FigureFolder) -> RegretSection | None:
    """Return the section on regret of a result; None where no stressed case is held.

    Args:
        results: An opened result.
        figure_folder: Where the figures' files go.
    """
    cases = [index for index in results.nominal if results.stressed(index)]
    if not cases:
        return None
    missing: list[str] = []
    sentences: list[str] = []
    tables: list[Table] = []
    pictures: list[Picture] = []
    by_case: dict[int, Regret] = {}
    for place, index in enumerate(cases):
        try:
            found = attempted(f"The regret of case {index}", partial(regret, results, index), missing)
        except RefusedError as error:  # not all of it has been computed yet
            missing.append(str(error))
            continue
        if found is None:
            continue
        by_case[index] = found
        label = f"Case {index}: " if len(results.nominal) > 1 else ""
        tables += [_regret_table(found, index, label), _rms_table(found, index, label)]
        if place < MOST_SHOWN:
            sentences += [f"{label}{sentence}" for sentence in in_sentences(found)]
            picture = draw(figure_folder, f"case_{index:03d}_regret", partial(_drawing, found, results.filters))
            pictures += [picture] if picture is not None else []
    if len(cases) > MOST_SHOWN:
        sentences.append(f"The regret of {len(cases) - MOST_SHOWN} more cases is in tables/*.csv.")
    shown = 2 * MOST_SHOWN
    return RegretSection(
        sentences=tuple(sentences),
        tables=(stresses_table(results), *tables[:shown]),
        pictures=tuple(pictures),
        file_tables=tuple(tables[shown:]),
        missing=tuple(missing),
        by_case=by_case,
    )


def in_sentences(found: Regret) -> list[str]:
    """Return the decision: the winner of the nominal case beside the filter with the smallest worst regret."""
    winner, minimax = found.nominal_winner, found.minimax
    sentences = []
    if winner is None or minimax is None:
        sentences.append("No filter has a finite worst regret: each failed in a run of some case.")
    elif winner == minimax:
        sentences.append(
            f"{winner} has the smallest position RMS in the nominal case and is the minimax filter: its worst regret "
            f"over the nominal and {counted(len(found.cases) - 1, 'stressed case')} is {_worst(found, winner)}."
        )
    else:
        sentences += [_winner_loses(found, winner), _minimax(found, winner, minimax)]
    if minimax is not None and (others := [name for name in found.undecided if name != winner]):
        sentences.append(f"No significant difference from {minimax} in worst regret: {listed(others)}.")
    return [*sentences, *_reservations(found)]


def _winner_loses(found: Regret, winner: str) -> str:
    case = found.worst_case(winner)
    own = found.of(winner, case)
    tied = [name for name in found.filters if name != winner and found.of(name, NOMINAL).low <= 0]
    equal = f" (no significant difference from {listed(tied)})" if tied else ""
    first = f"{winner} has the smallest position RMS in the nominal case{equal}"
    if math.isinf(own.estimate):
        return f"{first} and fails under {case}, {_failed(found, winner, case)}."
    if own.low > 0:
        best = found.filters[int(np.nanargmin(found.regret[:, found.cases.index(case)]))]
        return f"{first} and loses under {case}: regret {_percent(own)} against {best}."
    return f"{first}; its worst regret, under {case}, is {_percent(own)}."


def _minimax(found: Regret, winner: str, minimax: str) -> str:
    price = _percent(found.of(minimax, NOMINAL))
    decided = winner not in found.undecided
    said = "" if decided else "; the difference is not significant"
    return (
        f"The minimax filter is {minimax}: its worst regret is {_worst(found, minimax)}, that of {winner} "
        f"{_percent(_worst_of(found, winner))}{said}. In the nominal case it costs {price}."
    )


def _reservations(found: Regret) -> Iterator[str]:
    """Yield what limits the interpretation of the numbers."""
    runs = len(found.runs)
    if found.not_observable:
        yield f"Left out, because their sensors cannot observe the state: {listed(found.not_observable)}."
    if found.known_later:
        yield f"Left out, because their estimates are known only later: {listed(found.known_later)}."
    if found.undefined:
        yield f"No filter completed every run under {listed(found.undefined)}: no regret there, and none in the worst."
    for case, left_out in zip(found.cases, found.left_out, strict=True):
        if left_out:
            yield f"Every filter failed in {left_out} of {counted(runs, 'run')} under {case}; these count for none."
    for place, case in enumerate(found.cases):
        if np.isfinite(found.regret[:, place]).any():
            best = int(np.nanargmin(found.regret[:, place]))
            if 2 * found.diverged[best, place] >= runs:
                yield (
                    f"Under {case} the best filter, {found.filters[best]}, counts as diverged in "
                    f"{found.diverged[best, place]} of {counted(runs, 'run')} by its own covariance: regret there "
                    "compares filters that have diverged, or whose covariance does not cover the stress."
                )
    if np.isinf(found.high[np.isfinite(found.regret)]).any():
        yield f"{counted(runs, 'run')} are too few for intervals of the regret."


def stresses_table(results: Results) -> Table:
    """Return what each stress is."""
    stress = results.campaign_content.get("stress", {})
    rows = [
        Row(name, (Words("; ".join(f"{path} = {_shown(value)}" for path, value in overrides.items())),))
        for name, overrides in stress.items()
    ]
    return Table(
        name="stresses",
        title="Stresses",
        caption="What is simulated instead. Filters, their start's covariance and what they learn from are those of "
        "the nominal case. times: the nominal value is multiplied.",
        corner="stress",
        columns=(Column("truth that no filter is told of", numeric=False),),
        rows=tuple(rows),
    )


def _regret_table(found: Regret, index: int, label: str) -> Table:
    """Return the regret of every filter in every case, and the worst of each."""
    columns = [Column(f"{case} [%]") for case in found.cases]
    columns += [Column("worst [%]"), Column("worst case", numeric=False)]
    by_case = [_cells(found, case) for case in found.cases]
    worst = _infinite_as_words(numbers([_in_percent(one) for one in found.worst]))
    if found.minimax is not None:
        place = found.filters.index(found.minimax)
        worst = [replace(cell, mark="best") if row == place else cell for row, cell in enumerate(worst)]
    rows = [
        Row(name, (*cells, worst[row], Words(found.worst_case(name))), anchor=regret_anchor(index, row))
        for row, (name, *cells) in enumerate(zip(found.filters, *by_case, strict=True))
    ]
    when = "steady state" if found.span == "settled" else "whole span"
    return Table(
        name=f"case_{index:03d}_regret",
        title=f"{label}Regret",
        caption=f"Position RMS ({when}, mean over the {counted(len(found.runs), 'run')} that all filters have) over "
        "the smallest of any filter in the same case, less 1. Intervals hold together at "
        f"{100 * found.level:.0f} % for all filters and cases of the table: paired over runs, {RESAMPLES} resamples, "
        "the best filter of a case taken as unknown. Green: the interval has 0, the filter may be the best there; "
        "in the column of the worst: the minimax filter. A failed run makes a regret infinite; diverged runs count "
        "with their errors.",
        corner="filter",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def regret_anchor(index: int, row: int) -> str:
    """Return the id of a row of the table of regret of a case, its number from 0."""
    return f"regret-{index}-{row}"


def _cells(found: Regret, case: str) -> list[Cell]:
    """Return the cells of one case, a filter each."""
    own = [found.of(name, case) for name in found.filters]
    cells = _infinite_as_words(numbers([_in_percent(one) for one in own]))
    for row, (name, one) in enumerate(zip(found.filters, own, strict=True)):
        if math.isinf(one.estimate):
            cells[row] = Words(f"∞ ({_failed(found, name, case)})", math.inf, mark="failed")
        elif one.low <= 0:
            cells[row] = replace(cells[row], mark="best")
    return cells


def _infinite_as_words(cells: Sequence[Cell]) -> list[Cell]:
    """Return cells in which an infinite number is text, which a reader of a CSV file can't miss."""
    return [
        Words("∞", math.inf, mark="failed") if not isinstance(cell, Words) and math.isinf(cell.value) else cell
        for cell in cells
    ]


def _rms_table(found: Regret, index: int, label: str) -> Table:
    """Return the RMS that the regret is of, with the runs that failed or diverged."""
    columns = [Column(f"{case} [m]") for case in found.cases]
    by_case = []
    for place, case in enumerate(found.cases):
        sizes = [Interval(size, math.nan, math.nan, found.level, len(found.runs)) for size in found.rms[:, place]]
        notes = [_lost(found, name, case) for name in found.filters]
        cells: list[Cell] = [
            Words(note, math.inf, mark="failed")
            if math.isinf(cell.value)
            else replace(cell, mark="failed" if note else "")
            for cell, note in zip(numbers(sizes, notes=notes), notes, strict=True)
        ]
        by_case.append(cells)
    rows = [Row(name, tuple(cells)) for name, *cells in zip(found.filters, *by_case, strict=True)]
    return Table(
        name=f"case_{index:03d}_stressed_rms",
        title=f"{label}Position RMS under stress",
        caption="Mean over the same runs. No Cramér-Rao bound goes with stressed cases: that of the stressed truth "
        "would be one for filters that are told of it. Consistency and all else stand in the sections of the cases.",
        corner="filter",
        columns=tuple(columns),
        rows=tuple(rows),
    )


def _lost(found: Regret, name: str, case: str) -> str:
    place = found.filters.index(name), found.cases.index(case)
    diverged = f"diverged in {found.diverged[place]} of {len(found.runs)}" if found.diverged[place] else ""
    failed = _failed(found, name, case) if found.failed[place] else ""
    return f"({'; '.join(part for part in (failed, diverged) if part)})" if failed or diverged else ""


def _failed(found: Regret, name: str, case: str) -> str:
    place = found.filters.index(name), found.cases.index(case)
    return f"failed in {found.failed[place]} of {counted(len(found.runs), 'run')}"


def _drawing(found: Regret, all_filters: Sequence[str]) -> Drawing:
    words = regret_words(found)
    return Drawing(drawn_regret(found, all_filters), words.caption, words.alt)


def _worst_of(found: Regret, name: str) -> Interval:
    return found.worst[found.filters.index(name)]


def _worst(found: Regret, name: str) -> str:
    return f"{_percent(_worst_of(found, name))} ({found.worst_case(name)})"


def _in_percent(one: Interval) -> Interval:
    return replace(one, estimate=100 * one.estimate, low=100 * one.low, high=100 * one.high)


def _percent(one: Interval) -> str:
    shown = _in_percent(one)
    if math.isinf(shown.estimate):
        return "infinite"
    return f"{significant(shown.estimate, 2)} %{between(shown.low, shown.high)}"


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_shown(inner)}" for key, inner in value.items() if inner is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_shown, value)) + "]"
    return str(value)
