"""Formal covariances with their correlations: consistency by axis and plane, and against the errors of the runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from relnav_sim.conventions import CONFIDENCE
from relnav_sim.plots.axes import AXIS_COMPONENTS, describe_axes
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.in_full import InFull
from relnav_sim.report.layouts import INTERVALS
from relnav_sim.report.metrics import numbers
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.formal_covariance import LEVELS, PARTS, Ensemble
from relnav_sim.statistics.intervals import NO_INTERVAL, Interval, mean_interval
from relnav_sim.wording import MISSING

_SHARE = 0.1
"""Share of the squared length of a direction from which a component is named."""


def by_part_table(case: CaseFacts) -> Table | None:
    """Return ANEES and coverage of each axis and plane; None where no filter's covariances are stored whole."""
    if not any(item.in_full for item in case.filters):
        return None
    rows = []
    for place, part in enumerate(PARTS):
        name = "-".join(AXIS_COMPONENTS[i] for i in part)
        what = f"axis {name}" if len(part) == 1 else f"plane {name}"
        opens = place > 0 and len(part) > 1
        rows.append(Row(f"ANEES, {what}", _cells(case, _anees(case, place)), opens_block=opens or place == 0))
        shape = "interval" if len(part) == 1 else "ellipse"
        for level, probability in enumerate(LEVELS):
            label = f"inside the {100 * probability:g} % {shape}, {what}"
            rows.append(Row(label, _cells(case, _coverage(case, place, level)), "%"))
    return Table(
        name=f"case_{case.index:03d}_axes_and_planes",
        title=f"Consistency by axis and plane ({case.when})",
        caption=f"{describe_axes(case.axes)}. ANEES: squared error in units of the formal covariance of one or two "
        "components, correlation included, per component: 1 when consistent. Inside: share of the stored epochs. "
        f"{INTERVALS}",
        corner="quantity",
        columns=tuple(Column(item.name) for item in case.filters),
        rows=tuple(rows),
    )


def correlations_table(case: CaseFacts) -> Table | None:
    """Return formal against actual covariance at the last stored epoch; None where none is stored whole."""
    held = [item.in_full.at_end if item.in_full else None for item in case.filters]
    if not any(held):
        return None
    rows = [
        Row("runs", tuple(Words(str(each.runs) if each else MISSING, span=2) for each in held)),
        *(_ratio_row(held, place) for place in (0, 1)),
        Row("95 % band of both if consistent", tuple(_band(each) for each in held)),
    ]
    for i in range(6):
        cells = [cell for each in held for cell in _sigmas(each, i)]
        unit = "m/s" if i >= 3 else "m"
        rows.append(Row(f"sigma of {AXIS_COMPONENTS[i]}", tuple(cells), unit, opens_block=i == 0))
    for n, (i, j) in enumerate(combinations(range(6), 2)):
        cells = [cell for each in held for cell in _pair(each, i, j)]
        rows.append(
            Row(f"correlation of {AXIS_COMPONENTS[i]} and {AXIS_COMPONENTS[j]}", tuple(cells), opens_block=not n)
        )
    return Table(
        name=f"case_{case.index:03d}_correlations",
        title=f"Formal and actual covariance at t = {case.times_s[-1]:g} s",
        caption=f"{describe_axes(case.axes)}. Formal: mean over the completed runs of the filter's covariance. Actual: "
        "mean over the runs of e e^T, the mean error not taken out, as the filter states none; correlations with their "
        "95 % interval (Fisher 1921). Ratio of actual to formal sigma in the direction in which it is smallest and "
        "largest: above the band the filter is overconfident there, below it conservative. A direction is named by "
        "the components of the displacement, in formal sigmas.",
        corner="quantity",
        columns=tuple(
            Column(label, item.name, opens_group=label == "formal")
            for item in case.filters
            for label in ("formal", "actual")
        ),
        rows=tuple(rows),
    )


def _cells(case: CaseFacts, of: Callable[[InFull], Interval]) -> tuple[Cell, ...]:
    return numbers([of(item.in_full) if item.in_full else NO_INTERVAL for item in case.filters])


def _anees(case: CaseFacts, part: int) -> Callable[[InFull], Interval]:
    return lambda whole: mean_interval(whole.by_part[case.span].anees[:, part])


def _coverage(case: CaseFacts, part: int, level: int) -> Callable[[InFull], Interval]:
    return lambda whole: mean_interval(100 * whole.by_part[case.span].coverage[:, part, level], most=100)


def _ratio_row(held: list[Ensemble | None], place: int) -> Row:
    cells = []
    for each in held:
        if each is None:
            cells.append(Words(MISSING, span=2))
            continue
        outside = each.band is not None and not each.band.low <= each.ratios[place] <= each.band.high
        words = f"{each.ratios[place]:.3f} along {_direction(each, place)}"
        cells.append(Words(words, each.ratios[place], 2, mark="failed" if outside else ""))
    return Row(
        f"{('smallest', 'largest')[place]} ratio of actual to formal sigma", tuple(cells), opens_block=place == 0
    )


def _direction(found: Ensemble, place: int) -> str:
    """Return the components of which a direction mostly consists, with their signs: ``x - vy``."""
    u = found.directions[place]
    order = [i for i in np.argsort(-np.abs(u)).tolist() if u[i] ** 2 >= _SHARE]
    first, *others = order
    turn = math.copysign(1.0, u[first])
    return AXIS_COMPONENTS[first] + "".join(f" {'+' if turn * u[i] > 0 else '-'} {AXIS_COMPONENTS[i]}" for i in others)


def _band(found: Ensemble | None) -> Cell:
    if found is None or found.band is None:
        return Words(MISSING, span=2)
    return Words(f"[{found.band.low:.3f}, {found.band.high:.3f}]", span=2)


def _sigmas(found: Ensemble | None, i: int) -> tuple[Cell, ...]:
    if found is None:
        return Number(math.nan), Number(math.nan)
    values = [math.sqrt(found.formal[i, i]), math.sqrt(found.actual[i, i])]
    return numbers([Interval(value, math.nan, math.nan, CONFIDENCE, found.runs) for value in values])


def _pair(found: Ensemble | None, i: int, j: int) -> tuple[Cell, ...]:
    if found is None:
        return Number(math.nan), Number(math.nan)
    actual = found.actual_correlation(i, j)
    return (
        Number(found.formal_correlation(i, j), decimals=3),
        Number(actual.estimate, actual.low, actual.high, decimals=3),
    )
