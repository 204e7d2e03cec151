"""What is known of each run of a filter in a case without a look at its series: errors over time, convergence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.plots.axes import COMPONENTS, Axes, source_component
from relnav_sim.results import layout
from relnav_sim.statistics.intervals import mean_interval

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

Statistic = Literal["mean", "std", "rms"]
Span = Literal["whole", "settled"]

_SPANS: dict[Span, int] = {"whole": 0, "settled": 1}


@dataclass(frozen=True)
class RunFigures:
    """One filter in one case; every array has its computed runs as the leading axis.

    Attributes:
        name: The filter's name in the campaign.
        runs: Numbers of the runs (n,).
        ok: Which of them did not fail (n,).
        statistics: ``mean``, ``std`` and ``rms`` of the error over time (n, 2 spans, 8 components), in the
            order of ``COMPONENTS``, in the axes of the report; m and m/s.
        convergence_s: Time from which the position error stays small (n,), s; NaN where it never does.
    """

    name: str
    runs: Integers
    ok: Mask
    statistics: Mapping[Statistic, Array]
    convergence_s: Array

    @property
    def failed(self) -> int:
        """Number of failed runs."""
        return int((~self.ok).sum())

    @property
    def completed(self) -> int:
        """Number of runs that did not fail."""
        return int(self.ok.sum())

    @property
    def never_converged(self) -> int:
        """Number of completed runs that never converged."""
        return int((self.ok & np.isnan(self.convergence_s)).sum())

    def errors(self, statistic: Statistic, span: Span, component: str) -> Array:
        """Return a statistic of one component, one figure for each computed run (n,)."""
        return self.statistics[statistic][:, _SPANS[span], COMPONENTS.index(component)]

    def mean_rms(self, span: Span, component: str = "r") -> float:
        """Return the RMS of one component, mean over the completed runs that have one; NaN where none has."""
        return mean_interval(self.errors("rms", span, component)[self.ok]).estimate


def span_index(span: Span) -> int:
    """Return where a span stands along the layout's dimension of that name."""
    return _SPANS[span]


def headline_span(filters: Iterable[RunFigures]) -> Span:
    """Return the span that headline figures of a case are taken over: settled, unless nothing lies after settling."""
    settled = any(np.isfinite(item.errors("rms", "settled", "r")[item.ok]).any() for item in filters)
    return "settled" if settled else "whole"


def run_figures(results: Results, index: int, name: str, axes: Axes = "rtn") -> RunFigures:
    """Return what is known of each run of a filter.

    Args:
        results: An opened result.
        index: Number of the case.
        name: The filter.
        axes: The axes of the errors.
    """

    def statistic(which: str) -> Array:
        return np.asarray(results.statistic(index, name, which), dtype=float)

    return RunFigures(
        name=name,
        runs=results.case_runs(index, name),
        ok=statistic("failed") == 0,
        statistics={
            "mean": _in_axes(statistic("mean"), axes, signed=True),
            "std": _in_axes(statistic("std"), axes, signed=False),
            "rms": _in_axes(statistic("rms"), axes, signed=False),
        },
        convergence_s=statistic("convergence"),
    )


def _in_axes(stored: Array, axes: Axes, signed: bool) -> Array:
    """Return figures (n, spans, quantities of the layout) in the axes and order of the report."""
    columns = []
    for component in COMPONENTS:
        source, sign = source_component(component, axes)
        columns.append(stored[..., layout.QUANTITIES.index(source)] * (sign if signed else 1.0))
    return np.stack(columns, axis=-1)
