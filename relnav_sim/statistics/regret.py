"""Regret of a result's filters under truths that they are not told of, and the filter whose worst one is smallest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.results import layout
from relnav_sim.results.afterwards import known_when
from relnav_sim.results.block import RefusedError
from relnav_sim.statistics.divergence import diverged_runs
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.simultaneous_regret import simultaneous_regret

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

NOMINAL = "nominal"
"""What the case without a stress is called."""
Component = Literal["r", "v"]
Span = Literal["whole", "settled"]


@dataclass(frozen=True)
class Regret:
    """Filters (F) in a case of a campaign without a stress and under each of its stresses (C), the unstressed first.

    The regret of a filter in a case is its RMS over the smallest RMS of any filter there, less 1. RMS: over the time of
    a run, then the mean over the runs that all filters of all these cases have.

    Attributes:
        filters: Their names.
        cases: ``nominal``, and the names of the stresses.
        indices: The numbers of these cases in the result.
        rms: RMS (F, C), m or m/s; infinite where a run failed, as such a run has no error over its whole time.
        regret: Regret (F, C); infinite where a run failed, NaN where no filter completed every run.
        low: Lower ends of its intervals (F, C).
        high: Upper ends; infinite where there are too few runs to know one. All intervals hold together.
        failed: Runs in which the filter failed, though another did not, (F, C).
        diverged: Runs in which it diverged, those that failed left out, (F, C); they count with their errors.
        left_out: Runs in which every filter failed, (C,): they count for none.
        runs: Numbers of the runs (n,).
        component: ``r``: position, ``v``: velocity.
        span: ``settled`` or ``whole``: the time that the RMS is taken over.
        level: Confidence in all intervals together.
        not_observable: Filters left out because their sensors can't observe the state: a comparison would be one of
            the start.
        known_later: Rows left out because their estimates are known only later, where there are filters in flight: the
            smallest RMS of a case is one that can be flown.

    Examples:
        >>> import relnav_sim
        >>> with relnav_sim.open_results("results/stress.h5") as results:
        ...     found = relnav_sim.regret(results)
        >>> found.cases[0], found.regret.shape == (len(found.filters), len(found.cases))
        ('nominal', True)
    """

    filters: tuple[str, ...]
    cases: tuple[str, ...]
    indices: tuple[int, ...]
    rms: Array
    regret: Array
    low: Array
    high: Array
    failed: Integers
    diverged: Integers
    left_out: Integers
    runs: Integers
    component: Component
    span: Span
    level: float = CONFIDENCE
    not_observable: tuple[str, ...] = ()
    known_later: tuple[str, ...] = ()

    @property
    def undefined(self) -> tuple[str, ...]:
        """Cases in which no filter completed every run, so that there is no regret; they are left out of the worst."""
        return tuple(name for name, one in zip(self.cases, self.regret.T, strict=True) if np.isnan(one).all())

    @property
    def worst(self) -> tuple[Interval, ...]:
        """The largest regret of each filter over the cases, with its interval; NaN where there is none at all."""
        return tuple(
            self._interval(*(_largest(ends[row]) for ends in (self.regret, self.low, self.high)))
            for row in range(len(self.filters))
        )

    def worst_case(self, filter: str) -> str:
        """Return the case in which a filter's regret is largest; empty where it has none."""
        own = self.regret[self.filters.index(filter)]
        return "" if np.isnan(own).all() else self.cases[int(np.nanargmax(own))]

    def of(self, filter: str, case: str) -> Interval:
        """Return the regret of a filter in a case with its interval."""
        place = self.filters.index(filter), self.cases.index(case)
        return self._interval(*(float(part[place]) for part in (self.regret, self.low, self.high)))

    def _interval(self, estimate: float, low: float, high: float) -> Interval:
        return Interval(estimate, low, high, self.level, len(self.runs))

    @property
    def nominal_winner(self) -> str | None:
        """The filter with the smallest RMS in the case without a stress; None where no filter completed every run."""
        own = self.regret[:, 0]
        return None if np.isnan(own).all() else self.filters[int(np.nanargmin(own))]

    @property
    def minimax(self) -> str | None:
        """The filter with the smallest worst regret; None where every filter failed in some case."""
        worst = np.array([one.estimate for one in self.worst])
        finite = np.where(np.isfinite(worst), worst, np.inf)
        return self.filters[int(finite.argmin())] if np.isfinite(finite).any() else None

    @property
    def undecided(self) -> tuple[str, ...]:
        """The filters whose worst regret may be as small as that of the minimax filter: their intervals meet."""
        if self.minimax is None:
            return ()
        worst = dict(zip(self.filters, self.worst, strict=True))
        best = worst[self.minimax]
        return tuple(name for name, one in worst.items() if name != self.minimax and one.low <= best.high)


def regret(
    results: Results,
    case: int | str = 0,
    component: Component = "r",
    span: Span | None = None,
    level: float = CONFIDENCE,
) -> Regret:
    """Return the regret of the filters of a case under its stresses, as `relnav run --stress` has flown them.

    Args:
        results: An opened result.
        case: Number, label or id of a case without a stress.
        component: ``r`` for the position, ``v`` for the velocity.
        span: ``settled`` or ``whole``; default: settled, unless nothing lies after settling.
        level: Confidence in all intervals together.

    Raises:
        RefusedError: The result holds no such case, no stressed case of it, or no run that all filters have.

    Examples:
        >>> import relnav_sim
        >>> with relnav_sim.open_results("results/stress.h5") as results:
        ...     found = relnav_sim.regret(results)
        >>> found.minimax in found.filters, bool((found.regret >= 0).all())
        (True, True)
    """
    index = results.case_index(case)
    stressed = results.stressed(index)
    if not stressed:
        raise RefusedError(f"{results.path}: case {results.cases[index]!r} has no stressed cases; relnav run --stress")
    indices = (index, *stressed.values())
    names = results.headers[index].filters
    unseen = tuple(name for name in names if (seen := results.observability(index, name)) and not seen.observable)
    observing = tuple(name for name in names if name not in unseen)
    in_flight = tuple(name for name in observing if not known_when(results, index, name))
    filters = in_flight or observing
    held = [set(results.case_runs(number, name).tolist()) for number in indices for name in filters]
    runs = np.array(sorted(set.intersection(*held)) if held else [], dtype=np.int64)
    if not len(runs):
        raise RefusedError(f"{results.path}: no run is held by all filters in all stressed cases yet")
    place = {"r": layout.QUANTITIES.index("r"), "v": layout.QUANTITIES.index("v")}[component]
    rms = np.empty((len(indices), len(filters), len(layout.SPANS), len(runs)))
    diverged = np.zeros((len(indices), len(filters), len(runs)), dtype=bool)
    for c, number in enumerate(indices):
        for f, name in enumerate(filters):
            rows = np.searchsorted(results.case_runs(number, name), runs)
            failed = results.statistic(number, name, "failed")[rows] == 1
            own = results.statistic(number, name, "rms")[rows][..., place].astype(np.float64)
            rms[c, f] = np.where(failed | ~np.isfinite(own).any(axis=1), np.inf, own.T)
            diverged[c, f] = diverged_runs(results, number, name)[rows] & ~failed
    chosen: Span = span or ("settled" if np.isfinite(rms[:, :, 1]).any() else "whole")
    sizes = rms[:, :, layout.SPANS.index(chosen)]
    sizes = np.where(np.isnan(sizes), np.inf, sizes)
    lost: Mask = np.asarray(~np.isfinite(sizes))
    everywhere: Mask = np.asarray(lost.all(axis=1, keepdims=True))
    found = simultaneous_regret(sizes, level)
    return Regret(
        filters=filters,
        cases=(NOMINAL, *stressed),
        indices=indices,
        rms=_means(sizes, everywhere).T,
        regret=found[0].T,
        low=found[1].T,
        high=found[2].T,
        failed=(lost & ~everywhere).sum(axis=2).T,
        diverged=diverged.sum(axis=2).T,
        left_out=everywhere[:, 0].sum(axis=1),
        runs=runs,
        component=component,
        span=chosen,
        level=level,
        not_observable=unseen,
        known_later=tuple(name for name in observing if name not in filters),
    )


def _means(sizes: Array, left_out: Mask) -> Array:
    """Return the mean over the runs that count, (cases, filters); NaN where none does."""
    kept = (~left_out).sum(axis=2)
    with np.errstate(invalid="ignore"):
        total = np.where(left_out, 0.0, sizes).sum(axis=2)
    return np.asarray(np.where(kept > 0, total / np.maximum(kept, 1), np.nan))


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() or np.isinf(values).any() else float("nan")
