"""An error budget as a table: every source with its sigmas, its share, and what halving it would gain."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.budget.budget import Budget
from relnav_sim.budget.sources import INTERACTION

SHOWN = 1e-3
"""Of the total sigma: what is less has no number in the table of phases."""

_POSITION, _VELOCITY = slice(0, 3), slice(3, 6)


def budget_rows(budget: Budget, settle_s: float) -> list[tuple[str, ...]]:
    """Return the rows of the table: the sources, the largest first, the total, and what the filter states.

    Each has its position sigma in m, that at the end, its velocity sigma in m/s, that at the end, its share of the
    position's variance, by how much the position's total sigma falls when the source is halved, and by how much it
    grows for each unit that the source is larger.

    Args:
        budget: The budget.
        settle_s: From when on the sigmas, roots of mean variances, count; s.
    """
    span = settled(budget, settle_s)
    total = _norm(budget.total[span], _POSITION).mean()
    parts = _norm(budget.variance[:, span], _POSITION).mean(axis=1)
    gains = 1 - np.sqrt(_norm(budget.halved()[:, span], _POSITION).mean(axis=1) / total)
    slopes = _norm(budget.slope()[:, span], _POSITION).mean(axis=1) / (2 * np.sqrt(total) * budget.sizes)
    rows = []
    for place in np.argsort(-parts, kind="stable"):
        name, gain, slope = budget.sources[place], "", ""
        if name != INTERACTION:
            gain, slope = _percent(gains[place]), _slope(slopes[place], budget.units[place])
        rows.append((name, *_sigmas(budget.variance[place], span), _percent(parts[place] / total), gain, slope))
    rows.append(("total", *_sigmas(budget.total, span), "100 %", "", ""))
    rows.append(("formal", *_sigmas(budget.formal, span), "", "", ""))
    return rows


def phase_rows(budget: Budget) -> list[tuple[str, ...]]:
    """Return the position sigma of each source at the end of each phase, the largest at the end first, m.

    The total and what the filter states come last. The columns are the phases. Sigmas below `SHOWN` of the total are a
    dash, and sources that are so everywhere have no row.
    """
    at = [phase.epoch for phase in budget.phases]
    parts = _norm(budget.at_phases(), _POSITION)
    order = np.argsort(-parts[:, -1], kind="stable")
    total = _norm(budget.total[at], _POSITION)
    shown = np.where(np.abs(parts) < SHOWN**2 * total, np.nan, parts)
    rows = [
        (budget.sources[place], *(_root(part, 2) for part in shown[place]))
        for place in order
        if np.isfinite(shown[place]).any()
    ]
    rows.append(("total", *map(_root, total)))
    rows.append(("formal", *map(_root, _norm(budget.formal[at], _POSITION))))
    return rows


def settled(budget: Budget, settle_s: float) -> slice:
    """Return the epochs from `settle_s` on; the last one at least."""
    first = int(np.searchsorted(budget.times_s, settle_s * (1 - 1e-12)))
    return slice(min(max(first, 1), len(budget.times_s) - 1), None)


def _norm(variance: Array, part: slice) -> Array:
    return np.asarray(variance[..., part].sum(axis=-1))


def _sigmas(variance: Array, span: slice) -> tuple[str, ...]:
    found = []
    for part in (_POSITION, _VELOCITY):
        over_time = _norm(variance, part)
        found += [_root(over_time[span].mean()), _root(over_time[-1])]
    return tuple(found)


def _root(variance: float, digits: int = 3) -> str:
    """Return a root in words; of a variance below zero, as that of an interaction may be, with a minus."""
    return "-" if np.isnan(variance) else f"{np.sign(variance) * np.sqrt(abs(variance)):.{digits}g}"


def _slope(slope: float, unit: str) -> str:
    if unit == "whole":
        return ""
    return f"{slope:.2g} m/({unit})" if "/" in unit else f"{slope:.2g} m/{unit}"


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %".replace("-0.00", "0.00")
