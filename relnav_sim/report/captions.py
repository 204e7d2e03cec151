"""Captions and alternative texts: what a figure shows, with the number that matters, for eyes and screen readers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.report.axes import describe_axes
from relnav_sim.report.facts import CaseFacts, FilterFacts
from relnav_sim.report.figures.data import drawn_step
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.wording import counted, figure


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
    parts.append("Dashed: ± 3 sigma that the filter claims (root mean over runs).")
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
    what = f"RMS over {count} runs" if count > 1 else "Size in the one run"
    what += " of the position and velocity error against time."
    claim = "Dotted: what each filter claims, the root mean trace of its covariance."
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
        "says which case a number is."
    )


def accuracy_alt(rankings: Sequence[Ranking]) -> str:
    """Return the alternative text of ``figures.accuracy_by_case``."""
    best = [f"case {item.case.number} {item.best.name}" for item in rankings if item.standings]
    return f"Position RMS per case and filter with intervals. Smallest: {', '.join(best)}."


def _thinned(case: CaseFacts) -> list[str]:
    step = drawn_step(len(case.times_s))
    return [f"One stored epoch in {step} is drawn."] if step > 1 else []


def _left_out(filters: Sequence[FilterFacts]) -> list[str]:
    failed = [f"{item.name} {item.failed} of {len(item.runs)}" for item in filters if item.failed]
    return [f"Failed runs are left out ({', '.join(failed)})."] if failed else []
