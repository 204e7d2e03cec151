"""What tuning found, in words: the table on the terminal and the comment in the tuned file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from relnav_sim import __version__
from relnav_sim.campaign.models import TuneOptions
from relnav_sim.campaign.problems import listed
from relnav_sim.report.metrics import ANEES, POSITION_RMS, VELOCITY_RMS
from relnav_sim.statistics.intervals import Comparison, fewest_runs_to_decide
from relnav_sim.tuning.edit import number_text
from relnav_sim.tuning.objective import Figures, band_of, mean_log
from relnav_sim.tuning.result import FilterTuning, Tuning

NUMBERS = ("filter", "number", "start", "tuned", "cannot be told from the best")
FIGURES = ("filter", POSITION_RMS.heading, VELOCITY_RMS.heading, ANEES.heading, "objective, tuned less start")


def number_rows(tuning: Tuning) -> list[Sequence[str]]:
    """Return a row for each free number of each filter, under `NUMBERS`."""
    rows: list[Sequence[str]] = []
    for name, found in tuning.filters.items():
        if not found.found:
            rows.append((name, "every candidate failed", "", "", ""))
            continue
        for place, (scalar, good) in enumerate(zip(found.scalars, found.as_good(), strict=True)):
            start, best = found.start.values[place], found.best.values[place]
            tuned = "as it is" if start == best else f"{best:.4g}"
            rows.append((name, scalar.name, f"{start:.4g}", tuned, f"{good[0]:.2g} to {good[1]:.2g}"))
    return rows


def figure_rows(tuning: Tuning) -> list[Sequence[str]]:
    """Return what each filter gained, under `FIGURES`: on the held-out runs where there are some."""
    return [
        (
            name,
            *(_before_after(found, what) for what in ("position", "velocity", "anees")),
            check_words(found, tuning.options),
        )
        for name, found in tuning.filters.items()
        if found.found
    ]


def sentences(tuning: Tuning) -> list[str]:
    """Return what the reader of the table must know."""
    options = tuning.options
    words = [
        f"objective: {_objective_words(options)}, {options.span}; at most {options.budget} candidates a filter, "
        f"{options.runs} runs of each case, seed {tuning.seed}",
        "a number stays as it is where the runs cannot tell (within one standard error)",
    ]
    if options.check_runs:
        words.append(
            f"start -> tuned: on {options.check_runs} further runs of each case, seed {tuning.check_seed}; mean over "
            "runs, geometric mean over cases; difference paired, with its 95 % interval"
        )
    for name, found in tuning.filters.items():
        words += [
            f"{name}: {scalar.name} lies at an end of its range, {scalar.low:g} to {scalar.high:g}; another range: "
            f"--free filters.{name}.{scalar.name}=LOW:HIGH"
            for scalar, value, before in zip(found.scalars, found.best.values, found.start.values, strict=True)
            if found.found and value != before and value in (scalar.low, scalar.high)
        ]
    if options.objective == "in_band":
        words += [_band_words(name, found, options) for name, found in tuning.filters.items() if found.found]
    if tuning.lost:
        words.append(
            f"left out: {listed([f'run {run}' for run in tuning.lost], 'and')}, which no candidate of any filter "
            "got through"
        )
    return words


def _band_words(name: str, found: FilterTuning, options: TuneOptions) -> str:
    """Return whether a tuned filter keeps to the band of the ANEES: in the search, and on the held-out runs."""
    low, high = band_of(found.best.figures, options.anees_band)
    words = f"{name}: ANEES in [{low:.3g}, {high:.3g}] in every case"
    if not found.best.score.feasible:
        words = f"{name}: NO candidate has its ANEES in [{low:.3g}, {high:.3g}] in every case; the nearest was taken"
    if found.check is None or not (tuned := found.check.tuned).sound:
        return words
    low, high = band_of(tuned, options.anees_band)
    anees = tuned.anees.mean(axis=1)
    inside = bool(((anees >= low) & (anees <= high)).all())
    spread = f"{anees.min():.3g}" if len(anees) == 1 else f"{anees.min():.3g} to {anees.max():.3g}"
    verdict = "inside" if inside else "OUTSIDE"
    return f"{words}; held out: {spread}, {verdict} [{low:.3g}, {high:.3g}]"


def check_words(found: FilterTuning, options: TuneOptions) -> str:
    """Return the change of the objective on the held-out runs."""
    check = found.check
    if check is None or found.best is found.start:
        return ""
    failed = [int(figures.broken.sum()) for figures in (check.start, check.tuned)]
    failures = f"; {failed[0]} runs failed before, {failed[1]} now" if any(failed) else ""
    if check.difference is None:
        return f"not known{failures}"
    return _difference_words(check.difference, options) + failures


def header_lines(tuning: Tuning, changes: Sequence[str], cases: Sequence[int]) -> list[str]:
    """Return the comment that says how a file was tuned."""
    options, campaign = tuning.options, tuning.campaign
    source = campaign.path.name if campaign.path else campaign.name
    where = "all cases"
    if cases:
        where = f"case{'s' if len(cases) > 1 else ''} {listed([str(number) for number in cases], 'and')}"
    lines = [
        f"Tuned by relnav {__version__} from {source} (hash {campaign.hash[:12]}): "
        f"objective {_objective_words(options)},",
        f"span {options.span}, {where}, {options.runs} runs each on seed {tuning.seed}, at most {options.budget} "
        "candidates a filter.",
    ]
    if changes:
        lines.append(f"While tuning: {', '.join(changes)}.")
    for name, found in tuning.filters.items():
        if not found.found:
            lines.append(f"  {name}: every candidate failed; left as it was")
            continue
        numbers = ", ".join(
            f"{scalar.name} {number_text(before)}{_arrow(before, after)}"
            for scalar, before, after in zip(found.scalars, found.start.values, found.best.values, strict=True)
        )
        lines.append(f"  {name}: {numbers}")
        if found.check is not None and found.best is not found.start:
            lines.append(f"    on {options.check_runs} further runs: {check_words(found, options)}")
    return lines


def _arrow(before: float, after: float) -> str:
    return " as it was" if before == after else f" -> {number_text(after)}"


def _objective_words(options: TuneOptions) -> str:
    if options.objective == "both":
        return f"ln position RMS + {options.weight:g} (ln ANEES)^2"
    if options.objective == "in_band":
        band = "its 95 % chi-square band" if options.anees_band is None else "{:g} to {:g}".format(*options.anees_band)
        return f"position RMS with the ANEES in {band}"
    return {"position": "position RMS", "velocity": "velocity RMS", "consistency": "(ln ANEES)^2"}[options.objective]


def _difference_words(comparison: Comparison, options: TuneOptions) -> str:
    """Return a difference of the objective: per cent where it is a logarithm of an error, else as it is."""
    interval = comparison.difference
    if math.isnan(interval.low):
        return f"not decided: {interval.runs} runs in common, it takes {fewest_runs_to_decide(1)} or more"
    ends = (interval.estimate, interval.low, interval.high)
    if options.objective in ("position", "velocity", "in_band"):
        middle, low, high = (f"{100 * math.expm1(end):+.1f}" for end in ends)
        numbers = f"{middle} % [{low}, {high}]"
    else:
        middle, low, high = (f"{end:+.3f}" for end in ends)
        numbers = f"{middle} [{low}, {high}]"
    return f"{numbers} {comparison.verdict}"


def _before_after(found: FilterTuning, what: str) -> str:
    before, after = found.start.figures, found.best.figures
    if found.check is not None:
        before, after = found.check.start, found.check.tuned
    return f"{_figure(before, what)} -> {_figure(after, what)}"


def _figure(figures: Figures, what: str) -> str:
    sound = figures.of(~figures.broken)
    if not sound.failed.shape[1]:
        return "failed"
    return f"{math.exp(mean_log(getattr(sound, what)).value):.3g}"
