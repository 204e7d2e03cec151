"""Captions and alternative texts: what a figure shows, with the number that matters, for eyes and screen readers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.plots.axes import describe_axes
from relnav_sim.plots.data import drawn_step
from relnav_sim.plots.facts import CaseFacts, FilterFacts
from relnav_sim.report.layouts import not_judged
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.wording import counted, figure

_BOUND = "A bound, where stored, is one on the root mean square over runs, which is above the mean drawn here."


def errors_caption(case: CaseFacts, name: str) -> str:
    """Return the caption of ``figures.errors_with_envelope``."""
    item = case.filter(name)
    if not item.completed:
        return f"{name}: every run failed; there is no error to draw."
    run = f"run {item.median_run(case.span)}"
    parts = [f"{name}: error (estimate minus truth) per axis."]
    if item.completed > 2:
        parts.append(f"Grey band: mean ± 3 standard deviations over {item.completed} runs.")
        parts.append(f"Thin line: {run}, the run with the median position RMS.")
    else:
        parts.append(f"Line: {run}.")
    parts.append("Dashed: ± 3 sigma that the filter claims (root mean over runs); dotted, where stored: of the bound.")
    if case.times_s[0] < case.settle_s <= case.times_s[-1]:
        parts.append(f"Scaled to t ≥ {case.settle_s:g} s; the start may leave the panel.")
    return " ".join([*parts, *_thinned(case), *_left_out([item])])


def errors_alt(case: CaseFacts, name: str, ranking: Ranking) -> str:
    """Return the alternative text of ``figures.errors_with_envelope``."""
    standing = ranking.of(name)
    if standing is None:
        return f"Empty panels: every run of {name} failed."
    axes = describe_axes(case.axes)
    return (
        f"Six panels, error of {name} against time in position and velocity ({axes}) between the filter's "
        f"3-sigma lines; position RMS {figure(standing.position.estimate)} m for {case.when}."
    )


def rms_caption(case: CaseFacts) -> str:
    """Return the caption of ``figures.rms_over_time``."""
    count = max((item.completed for item in case.filters), default=0)
    if not count:
        return "Empty: every run failed; there is no error to draw."
    what = f"RMS over {count} runs" if count > 1 else "Size in the one run"
    what += " of the position and velocity error against time."
    claim = (
        "Dotted: what each filter claims, the root mean trace of its covariance; dash-dotted, where stored: the bound."
    )
    return " ".join([what, claim, *_thinned(case), *_left_out(case.filters)])


def rms_alt(case: CaseFacts, ranking: Ranking) -> str:
    """Return the alternative text of ``figures.rms_over_time``."""
    sizes = ", ".join(f"{item.name} {figure(item.position.estimate)} m" for item in ranking.standings)
    return (
        "Two panels, position and velocity RMS against time on logarithmic axes. "
        f"Position RMS for {case.when}: {sizes}."
    )


def boxes_caption(case: CaseFacts) -> str:
    """Return the caption of ``figures.box_plots``."""
    text = (
        f"Spread over runs, one figure per run (RMS and ANEES: {case.when}). Box: middle half of the runs; line: "
        "median; whiskers: up to 1.5 box lengths; dots: single runs. Dashed: ANEES of a consistent filter."
    )
    never = [f"{item.name} {item.never_converged} of {item.completed}" for item in case.filters if item.never_converged]
    parts = [f"Never converged, not drawn: {', '.join(never)}."] if never else []
    parts = parts if case.shows_convergence else [not_judged(case)]
    return " ".join([text, *parts, *_left_out(case.filters)])


def boxes_alt(case: CaseFacts, ranking: Ranking) -> str:
    """Return the alternative text of ``figures.box_plots``."""
    medians = []
    for item in ranking.standings:
        sizes = item.facts.errors("rms", case.span, "r")[item.facts.ok]
        medians.append(f"{item.name} {figure(float(np.median(sizes)))} m")
    return (
        "Box plots over runs of position RMS, velocity RMS, ANEES and convergence time for "
        f"{counted(len(medians), 'filter')}. Median position RMS: {', '.join(medians)}."
    )


def accuracy_caption(cases: Sequence[CaseFacts]) -> str:
    """Return the caption of ``figures.accuracy_by_case``."""
    return (
        f"RMS of the position error ({cases[0].when}) in every case: mean over runs with its 95 % interval. The table "
        f"says which case a number is. {_BOUND}"
    )


def accuracy_alt(rankings: Sequence[Ranking]) -> str:
    """Return the alternative text of ``figures.accuracy_by_case``."""
    best = [f"case {item.case.number} {item.best.name}" for item in rankings if item.standings]
    return f"Position RMS per case and filter with intervals. Smallest: {', '.join(best)}."


def start_caption(case: CaseFacts, until_s: float) -> str:
    """Return the caption of ``figures.rms_over_time`` for the start."""
    level = (
        f" Dotted line across, where errors are of its size: {case.convergence_m:g} m, which counts as converged."
        if case.convergence_m > 0
        else ""
    )
    return f"The first {until_s:g} s of the RMS over runs, at the stored epochs.{level}"


def start_alt(until_s: float) -> str:
    """Return the alternative text of ``figures.rms_over_time`` for the start."""
    return f"Two panels, position and velocity RMS of all filters against time over the first {until_s:g} s."


_NO_NIS_BAND = " The band of the NIS does not hold for filters that assume a mixture as noise; its mean does."


def consistency_caption(case: CaseFacts) -> str:
    """Return the caption of ``figures.consistency_over_time``."""
    runs = min((item.completed for item in case.filters if item.completed), default=0)
    return (
        "NEES and NIS divided by their dimension, mean over runs, against time. Grey: where a consistent filter lies "
        f"in 95 % of the epochs ({counted(runs, 'run')}). Above: it claims too much; below: too little."
        + ("" if all(item.nis_is_chi_square for item in case.filters) else _NO_NIS_BAND)
    )


def consistency_alt(case: CaseFacts) -> str:
    """Return the alternative text of ``figures.consistency_over_time``."""
    parts = [
        f"{item.name} {figure(float(item.consistency('anees', case.span)[item.ok].mean()))}"
        for item in case.filters
        if item.completed
    ]
    return f"Two panels, NEES and NIS against time with their 95 % bands. ANEES for {case.when}: {', '.join(parts)}."


def cost_caption(case: CaseFacts) -> str:
    """Return the caption of ``figures.cost_against_accuracy``."""
    return (
        f"Position RMS ({case.when}, with its 95 % interval) against CPU time per filter step: down and left is "
        f"better. Grey line: filters that no other beats in both. {_BOUND}"
    )


def cost_alt(case: CaseFacts) -> str:
    """Return the alternative text of ``figures.cost_against_accuracy``."""
    costs = [f"{item.name} {figure(float(np.nanmean(item.cpu_us[item.ok])))} µs" for item in _timed(case)]
    return f"Position RMS against CPU time per filter step. {', '.join(costs) or 'No time is known'}."


def worst_caption(case: CaseFacts, name: str) -> str:
    """Return the caption of ``figures.worst_runs``."""
    return (
        f"{name}: the runs to look at, those with the largest position RMS ({case.when}), before all others in grey. "
        "Below: their NEES. Where it is large too, the filter does not know of its error."
    )


def worst_alt(case: CaseFacts, name: str) -> str:
    """Return the alternative text of ``figures.worst_runs``."""
    item = case.filter(name)
    rms = item.errors("rms", case.span, "r")
    runs = [f"run {item.runs[row]} with {figure(float(rms[row]))} m" for row in item.worst_rows(case.span, 3)]
    return f"Two panels, position error and NEES against time of {name}. Largest position RMS: {', '.join(runs)}."


def trajectory_caption(case: CaseFacts, name: str) -> str:
    """Return the caption of ``figures.trajectory``."""
    run = case.filter(name).median_run(case.span)
    return f"True relative trajectory of run {run} and its estimate by {name}. {describe_axes(case.axes)}."


def trajectory_alt(case: CaseFacts, name: str) -> str:
    """Return the alternative text of ``figures.trajectory``."""
    return f"Relative trajectory in space and in three planes, the truth and the estimate of {name}."


def range_caption(case: CaseFacts) -> str:
    """Return the caption of ``figures.error_against_range``."""
    return f"Size of the errors against the true range, {case.when}. Solid: RMS over epochs and runs; dashed: 95 %."


RANGE_ALT = "Two panels, position and velocity error of every filter against the true range."
EVENTS_CAPTION = (
    "RMS position error over runs and events against the time since the event. Dotted: what the filters claim. Outages "
    "and acquisitions are those that show at the stored epochs."
)
EVENTS_ALT = (
    "Position RMS of every filter before and after outages, acquisitions and manoeuvres, a panel for each kind."
)


def sweep_caption(path: str, case: CaseFacts) -> str:
    """Return the caption of ``figures.sweep_trend``."""
    return (
        f"Position and velocity RMS ({case.when}) against {path}, mean over runs with 95 % intervals. Other varied "
        f"values are those of case {case.number}. {_BOUND}"
    )


def sweep_alt(path: str) -> str:
    """Return the alternative text of ``figures.sweep_trend``."""
    return f"Two panels, position and velocity RMS of every filter against {path}; the overview table has the figures."


def heat_map_caption(paths: Sequence[str], case: CaseFacts) -> str:
    """Return the caption of ``figures.heat_map``."""
    return f"Position RMS ({case.when}) of the best filter of each cell over {paths[0]} and {paths[1]}."


def heat_map_alt(paths: Sequence[str]) -> str:
    """Return the alternative text of ``figures.heat_map``."""
    return f"Heat map of the smallest position RMS over {paths[0]} and {paths[1]}; the overview table has the figures."


def _timed(case: CaseFacts) -> list[FilterFacts]:
    return [item for item in case.filters if np.isfinite(item.cpu_us[item.ok]).any()]


def _thinned(case: CaseFacts) -> list[str]:
    step = drawn_step(len(case.times_s))
    return [f"One stored epoch in {step} is drawn."] if step > 1 else []


def _left_out(filters: Sequence[FilterFacts]) -> list[str]:
    failed = [f"{item.name} {item.failed} of {len(item.runs)}" for item in filters if item.failed]
    return [f"Failed runs are left out ({', '.join(failed)})."] if failed else []
