"""Estimators that pass over all measurements again and again, until there is nothing more to find."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from relnav_sim.filters.belief import Filter
from relnav_sim.filters.failed_runs import FailedRun
from relnav_sim.filters.history import FilterHistory


def last_pass(filter: Filter, start: Any, go: Callable[[Any], Any]) -> Any:
    """Return the beginning of the last pass, whose estimates are the result; a filter in flight makes one pass.

    Args:
        filter: A filter; one that passes again says whether a pass is the last by ``settled(start)``, and where the
            next one begins by ``again(end)``.
        start: Its belief before the first measurement.
        go: Carries a belief over all measurements.
    """
    settled: Callable[[Any], bool] | None = getattr(filter, "settled", None)
    if settled is None:
        return start
    while not settled(start):
        start = filter.again(go(start))  # type: ignore[attr-defined]  # it goes with `settled`
    return start


def unfit(filter: Filter, belief: Any) -> Mapping[int, str]:
    """Return why runs have no result, by place; a filter in flight has none of these."""
    found: Callable[[Any], Mapping[int, str]] | None = getattr(filter, "unfit", None)
    return {} if found is None else found(belief)


def with_unfit(history: FilterHistory, reasons: Mapping[int, str], epoch: int) -> FilterHistory:
    """Return the history of the last pass with the runs that have no result failed from its first epoch on."""
    others = [failure for failure in history.failures if failure.run not in reasons]
    failed = [FailedRun(place, epoch, reason) for place, reason in reasons.items()]
    return replace(history, failures=tuple(sorted((*others, *failed), key=lambda one: one.run)))
