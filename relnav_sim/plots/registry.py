"""Every kind of figure by name, so that one call or one command makes any of them from a result."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relnav_sim.campaign.problems import no_such
from relnav_sim.plots import (
    availability,
    choice,
    conditions,
    ellipses,
    errors,
    geometry,
    grid,
    observability,
    over_time,
    regret,
    residuals,
    scenario,
    spread,
    sweeps,
)
from relnav_sim.plots.axes import Axes
from relnav_sim.plots.data import FigureError
from relnav_sim.plots.words import FigureWords

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results


@dataclass(frozen=True)
class FigureKind:
    """A kind of figure.

    Attributes:
        name: What it is asked for by.
        shows: What it shows, in one phrase.
        draw: The function; its first argument is an opened result.
        preset: Arguments of the function that make this kind.
        papers: Which published figures are of this kind.
        words: Its caption and alternative text, from the facts of the case; None: ``shows`` says it all.
    """

    name: str
    shows: str
    draw: Callable[..., Figure]
    preset: Mapping[str, Any] = field(default_factory=dict)
    papers: str = ""
    words: Callable[..., FigureWords] | None = None

    @property
    def takes(self) -> tuple[str, ...]:
        """Names of the options it takes."""
        return tuple(name for name in list(inspect.signature(self.draw).parameters)[1:] if name not in self.preset)

    def in_words(self, *about: Any) -> FigureWords:
        """Return the words of one figure, from what they are about: a case, and what is chosen of it."""
        if self.words is not None:
            return self.words(*about)
        return FigureWords(f"{self.shows[0].upper()}{self.shows[1:]}.", f"{self.shows[0].upper()}{self.shows[1:]}.")


_SHI, _WEI = "Shi et al. 2025", "Wei, Song and Zhang 2012"
_KINDS = (
    FigureKind("errors", "error of one filter per axis, with its ± 3 sigma, the spread of the runs and the bound",
               errors.errors_with_envelope, words=errors.errors_words),
    FigureKind("position_error", "position error per axis of several filters in one run", errors.axis_errors,
               {"quantity": "position", "at_start": False}, f"{_SHI}, Figs. 3 and 10; {_WEI}, Fig. 3"),
    FigureKind("velocity_error", "velocity error per axis of several filters in one run", errors.axis_errors,
               {"quantity": "velocity", "at_start": False}, f"{_SHI}, Figs. 5 and 11; {_WEI}, Fig. 4"),
    FigureKind("position_start", "the same position error from the start to convergence", errors.axis_errors,
               {"quantity": "position", "at_start": True}, f"{_SHI}, Fig. 4"),
    FigureKind("velocity_start", "the same velocity error from the start to convergence", errors.axis_errors,
               {"quantity": "velocity", "at_start": True}, f"{_SHI}, Fig. 6"),
    FigureKind("rms", "RMS over runs against time, logarithmic, with the formal sigma and the bound",
               over_time.rms_over_time, {"at_start": False}, words=over_time.rms_words),
    FigureKind("start", "the same from the start to convergence", over_time.rms_over_time, {"at_start": True},
               words=over_time.start_words),
    FigureKind("covariance", "formal sigma of the filters and their RMS error over runs, per axis",
               over_time.covariance_against_error, {}, f"{_SHI}, Figs. 7 to 9"),
    FigureKind("consistency", "NEES and NIS over time with their chi-square bands", over_time.consistency_over_time,
               {"which": ("nees", "nis")}, words=over_time.consistency_words),
    FigureKind("nees", "NEES over time with its chi-square band", over_time.consistency_over_time,
               {"which": ("nees",)}),
    FigureKind("nis", "NIS over time with its chi-square band", over_time.consistency_over_time,
               {"which": ("nis",)}),
    FigureKind("boxes", "box plots over runs of RMS, ANEES and convergence time", spread.box_plots,
               words=spread.boxes_words),
    FigureKind("violins", "the same as densities over runs", spread.violin_plots),
    FigureKind("sweep", "position and velocity RMS against what the campaign varies, with intervals",
               sweeps.sweep_trend, {"statistics": ("rms",), "known": ()}, words=sweeps.sweep_words),
    FigureKind("sweep_moments", "mean and standard deviation of the error's size against what the campaign varies",
               sweeps.sweep_trend, {"statistics": ("mean", "std"), "known": ()}, f"{_SHI}, Figs. 14 and 15"),
    FigureKind("position_boxes", "box plots of the position error against what the campaign varies",
               sweeps.sweep_boxes, {"quantity": "position"}, f"{_SHI}, Fig. 12"),
    FigureKind("velocity_boxes", "box plots of the velocity error against what the campaign varies",
               sweeps.sweep_boxes, {"quantity": "velocity"}, f"{_SHI}, Fig. 13"),
    FigureKind("heat_map", "RMS over a grid of two varied parameters, of one filter or of the best in each cell",
               grid.heat_map, words=grid.heat_map_words),
    FigureKind("cases", "position RMS of every filter in every case, with intervals", sweeps.accuracy_by_case,
               words=sweeps.accuracy_words),
    FigureKind("regret", "position RMS over the smallest of any filter, in the nominal case and under each stress",
               regret.regret_by_case),
    FigureKind("trajectory", "relative trajectory with the estimate, in space and in the three planes",
               geometry.trajectory, words=geometry.trajectory_words),
    FigureKind("scenario", "true relative trajectory, range, line-of-sight rate, sensors and manoeuvres against time",
               scenario.scenario, words=scenario.scenario_words),
    FigureKind("plane", "relative trajectory in the orbital plane with the estimates, and a part magnified",
               geometry.plane, {}, f"{_WEI}, Fig. 2"),
    FigureKind("ellipses", "errors of all runs at one epoch in three planes, with actual and formal ellipses",
               ellipses.error_ellipses, words=ellipses.ellipses_words),
    FigureKind("range", "size of the errors against the true range", conditions.error_against_range,
               words=conditions.range_words),
    FigureKind("events", "RMS around outages, acquisitions and manoeuvres", conditions.error_around_events,
               words=conditions.events_words),
    FigureKind("availability", "share of the runs in which each sensor gives measurements, with outages shaded",
               availability.availability_over_time, words=availability.availability_words),
    FigureKind("whiteness", "autocorrelation of a filter's residuals over all runs, by channel",
               residuals.residual_whiteness, words=residuals.residual_whiteness_words),
    FigureKind("observability", "how much of the initial sigma is left in the weakest direction, against time",
               observability.observability_over_time, words=observability.observability_words),
    FigureKind("cost", "position RMS against CPU time per step, with the Pareto front", choice.cost_against_accuracy,
               words=choice.cost_words),
    FigureKind("worst", "the runs with the largest error, in front of all others", choice.worst_runs,
               words=choice.worst_words),
)  # fmt: skip
FIGURE_KINDS = {kind.name: kind for kind in _KINDS}


def figure(
    result: Results | str | Path,
    kind: str,
    case: int | str | None = None,
    filter: str | Sequence[str] | None = None,
    run: int | None = None,
    axes: Axes | None = None,
    **options: Any,
) -> Figure:
    """Draw one figure of a result.

    Args:
        result: An opened result, or its file.
        kind: A name of ``FIGURE_KINDS``; docs/figures.md shows them all.
        case: Number from 0, label or id of the case; default: the first.
        filter: A filter, or several for kinds that compare filters; default: all, or the most accurate one for a
            kind that shows one.
        run: The run, for kinds that show one; default: the one with the median position RMS.
        axes: ``rtn`` or ``shi2025``, for kinds with axes.
        **options: What else the kind takes: ``from_s``, ``until_s``, ``along``, ``at_s``, ``sigma``, ``count``, ...

    Returns:
        A figure 89 mm wide; ``figure.savefig("name.pdf")`` writes it as a vector file.

    Raises:
        FigureError: An unknown kind, an option that the kind does not take, or nothing to draw for it.
        ResultsError: The result can't be read, or holds no such case.
    """
    if kind not in FIGURE_KINDS:
        raise FigureError(no_such("figure", kind, FIGURE_KINDS))
    chosen = FIGURE_KINDS[kind]
    given: dict[str, Any] = {"case": case, "run": run, "axes": axes, **options}
    if filter is not None:
        names = [filter] if isinstance(filter, str) else list(filter)
        if "filter" in chosen.takes and len(names) != 1:
            raise FigureError(f"figure {kind!r} shows one filter, not {len(names)}")
        given |= {"filter": names[0]} if "filter" in chosen.takes else {"filters": names}
    given = {name: value for name, value in given.items() if value is not None}
    if unknown := [name for name in given if name not in chosen.takes]:
        raise FigureError(f"figure {kind!r} takes no {unknown[0]}, only {', '.join(chosen.takes)}")
    if isinstance(result, str | Path):
        from relnav_sim.results.read import open_results

        with open_results(result) as results:
            return _drawn(chosen, results, given)
    return _drawn(chosen, result, given)


def _drawn(kind: FigureKind, results: Results, given: Mapping[str, Any]) -> Figure:
    try:
        return kind.draw(results, **kind.preset, **given)
    except KeyError as error:
        raise FigureError(str(error.args[0])) from None
