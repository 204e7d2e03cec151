"""The figures of a report, one function each, all callable on an opened result.

Every function returns a ``matplotlib.figure.Figure`` in the house style; captions are in ``captions``. A case
is given by its number, label or id, or by its facts where they have been read already. Failed runs are left
out of every figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.report.axes import AXIS_COMPONENTS, Array, Axes, axis_names, turned_sigmas, turned_states
from relnav_sim.report.facts import CaseFacts, FilterFacts, case_facts
from relnav_sim.report.panels import (
    boxes,
    heading,
    log_axis,
    say,
    time_axis,
    time_unit,
)
from relnav_sim.report.style import (
    ENVELOPE,
    INK,
    ONE_RUN,
    house_style,
    legend_above,
    legend_height,
    line_styles,
    margins,
    new_figure,
    shown_name,
)
from relnav_sim.statistics.intervals import bootstrap_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_MOST_POINTS = 1200
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"
_ZERO_RATIO = 1e-5
_SLOW_M_S = 0.2  # below this, axes of velocity are in mm/s


def drawn_epochs(times_s: Array) -> slice:
    """Return which of the stored epochs a figure draws: all, or every k-th where there are very many."""
    return slice(None, None, max(1, -(-len(times_s) // _MOST_POINTS)))


def errors_with_envelope(results: Results, case: int | str | CaseFacts, filter_name: str, axes: Axes = "rtn") -> Figure:
    """Draw the error of one filter against time, per axis, with the filter's own 3-sigma envelope.

    The grey band is mean +- 3 standard deviations of the error over the runs: what the filter does. The
    dashed lines are 3 times the root mean over runs of its covariance diagonal: what it claims. A consistent
    filter's band fills its envelope. The thin line is the run with the median position RMS, for the look of
    one flight; with fewer than three runs there is no band.

    Args:
        results: An opened result.
        case: The case.
        filter_name: The filter's name in the campaign.
        axes: The axes of the panels; facts given as the case bring their own.
    """
    facts = case_facts(results, case, axes)
    item = facts.filter(filter_name)
    keep = drawn_epochs(facts.times_s)
    errors = turned_states(results.error(facts.index, filter_name)[:, keep][item.ok], facts.axes)
    sigmas = turned_sigmas(results.sigma(facts.index, filter_name)[:, keep][item.ok], facts.axes)
    unit, length = time_unit(facts.times_s)
    times, settled = facts.times_s[keep] / length, facts.times_s[keep] >= facts.settle_s
    with house_style():
        labels = _envelope_labels(item, facts)
        figure = new_figure(3.45 + legend_height(labels))
        panels = figure.subplots(3, 2, sharex=True)
        handles: list[Any] = []
        for index, name in enumerate(AXIS_COMPONENTS):
            panel, velocity = panels[index % 3, index // 3], index >= 3
            unit_of = "m/s" if velocity else "m"
            if item.completed:
                error, claimed = errors[..., index], np.sqrt(np.mean(sigmas[..., index] ** 2, axis=0))
                reach = _reach(error, claimed, settled)
                if velocity and reach < _SLOW_M_S:
                    error, claimed, reach, unit_of = 1e3 * error, 1e3 * claimed, 1e3 * reach, "mm/s"
                row = item.median_row(facts.span)
                handles = _envelope(panel, times, error, claimed, row, reach)
            else:
                say(panel, "every run failed")
            panel.set_ylabel(f"{name} [{unit_of}]")
            heading(panel, axis_names(facts.axes)[index % 3] + (" velocity" if velocity else ""))
        for panel in panels[-1]:
            time_axis(panel, times, unit)
        margins(figure, 0.46, 0.16, 0.18 + legend_height(labels), 0.36, hspace=0.24, wspace=0.55)
        if handles:
            legend_above(figure, handles, labels)
    return figure


def rms_over_time(results: Results, case: int | str | CaseFacts) -> Figure:
    """Draw the RMS over runs of position and velocity error against time, one line per filter, log axis.

    Dotted lines are what each filter claims: the root mean over runs of its covariance's trace.
    """
    facts = case_facts(results, case)
    keep = drawn_epochs(facts.times_s)
    unit, length = time_unit(facts.times_s)
    times = facts.times_s[keep] / length
    styles = line_styles(facts.all_filters)
    with house_style():
        labels = [shown_name(name) for name in facts.names]
        figure = new_figure(2.8 + legend_height(labels))
        panels = figure.subplots(2, 1, sharex=True)
        handles: list[Any] = []
        for place, item in enumerate(facts.filters):
            look = styles[item.name]
            # Filters that coincide stay visible: each line is thinner than the one below it.
            width = 2.4 - 1.5 * place / max(1, len(facts.filters) - 1)
            errors = results.error(facts.index, item.name)[:, keep][item.ok]
            sigmas = results.sigma(facts.index, item.name)[:, keep][item.ok]
            for panel, part in zip(panels, (slice(0, 3), slice(3, 6)), strict=True):
                (line,) = panel.plot(
                    times, _rms(errors[..., part]), color=look.colour, linestyle=look.dashes, linewidth=width
                )
                panel.plot(times, _rms(sigmas[..., part]), color=look.colour, linestyle=":", linewidth=0.9)
            handles.append(line)
        for panel, label in zip(panels, ("position RMS [m]", "velocity RMS [m/s]"), strict=True):
            if any(item.completed for item in facts.filters):
                _leave_out_zeros(panel)
                log_axis(panel, "y")
            else:
                say(panel, "every run failed")
            panel.set_ylabel(label)
        time_axis(panels[-1], times, unit)
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.12, wspace=0.1)
        legend_above(figure, handles, labels)
    return figure


def box_plots(results: Results, case: int | str | CaseFacts) -> Figure:
    """Draw how the runs of each filter spread: position and velocity RMS, ANEES and convergence time.

    Boxes hold the middle half of the runs with the median as a line, whiskers reach 1.5 box lengths; up to
    60 runs also show as dots.
    """
    facts = case_facts(results, case)
    columns = (
        ("position RMS [m]", [item.errors("rms", facts.span, "r") for item in facts.filters]),
        _velocities([np.where(item.ok, item.errors("rms", facts.span, "v"), np.nan) for item in facts.filters]),
        ("ANEES [-]", [item.consistency("anees", facts.span) for item in facts.filters]),
        ("convergence time [s]", [item.convergence_s for item in facts.filters]),
    )
    styles = line_styles(facts.all_filters)
    names = [shown_name(name, 14) for name in facts.names]
    with house_style():
        figure = new_figure(1.1 + 2 * max(0.45, 0.2 * len(names)))
        panels = figure.subplots(2, 2, sharey=True)
        for panel, (label, values) in zip(panels.flat, columns, strict=True):
            finite = [
                figures[item.ok & np.isfinite(figures)] for item, figures in zip(facts.filters, values, strict=True)
            ]
            if label.startswith("ANEES"):
                panel.axvline(1.0, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
            boxes(panel, finite, [styles[name].colour for name in facts.names])
            panel.set_xlabel(label)
        panels[0, 0].set_yticks(range(len(names)), names)
        panels[0, 0].set_ylim(len(names) - 0.5, -0.5)
        left = 0.2 + 0.06 * max((len(name) for name in names), default=0)
        margins(figure, left, 0.14, 0.08, 0.36, hspace=0.52, wspace=0.16)
    return figure


def accuracy_by_case(results: Results, cases: Sequence[int | str | CaseFacts]) -> Figure:
    """Draw the position RMS of every filter in every case, with its 95 % interval over runs.

    Cases stand on the horizontal axis by their number from 1.
    """
    from matplotlib.ticker import MaxNLocator

    facts = [case_facts(results, case) for case in cases]
    names = results.filters
    styles = line_styles(names)
    numbers = np.array([case.number for case in facts], dtype=float)
    with house_style():
        labels = [shown_name(name) for name in names]
        figure = new_figure(2.3 + legend_height(labels))
        panel = figure.subplots()
        handles: list[Any] = []
        for index, name in enumerate(names):
            value, low, high = np.array([_headline(case, name) for case in facts]).T
            handles.append(
                panel.errorbar(
                    numbers + (index - (len(names) - 1) / 2) * 0.7 / len(names),
                    value,
                    yerr=[np.nan_to_num(value - low), np.nan_to_num(high - value)],
                    color=styles[name].colour,
                    marker="os^Dv<>"[index % 7],
                    markersize=max(1.8, 3.6 - 0.03 * len(facts)),
                    linestyle="none",
                    elinewidth=0.9,
                )
            )
        log_axis(panel, "y")
        panel.set_ylabel("position RMS [m]")
        panel.set_xlabel("case number")
        panel.set_xlim(numbers.min() - 0.6, numbers.max() + 0.6)
        panel.grid(visible=False, axis="x")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
        margins(figure, 0.55, 0.16, 0.06 + legend_height(labels), 0.36, hspace=0.1, wspace=0.1)
        legend_above(figure, handles, labels)
    return figure


def _headline(case: CaseFacts, name: str) -> tuple[float, float, float]:
    if name not in case.names:
        return (np.nan, np.nan, np.nan)
    item = case.filter(name)
    found = bootstrap_interval(item.errors("rms", case.span, "r")[item.ok])
    return found.estimate, found.low, found.high


def _leave_out_zeros(panel: Panel) -> None:
    """Keep a start without error, 1e-13 and the like after rounding, from stretching the axis."""
    sizes = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in panel.lines])
    shown = sizes[sizes > _ZERO_RATIO * np.max(sizes, initial=0.0, where=np.isfinite(sizes))]
    if shown.size:
        panel.set_ylim(0.8 * shown.min(), 1.25 * shown.max())


def _velocities(figures: list[Array]) -> tuple[str, list[Array]]:
    """Return figures in m/s with the label of their axis, in mm/s where all are small."""
    if np.nanmax(np.concatenate([*figures, np.zeros(1)])) < _SLOW_M_S:
        return "velocity RMS [mm/s]", [1e3 * values for values in figures]
    return "velocity RMS [m/s]", figures


def _envelope_labels(item: FilterFacts, case: CaseFacts) -> list[str]:
    if not item.completed:
        return []
    lines = [f"filter's ± 3 {SIGMA}", f"run {item.median_run(case.span)}"]
    return [f"± 3 std of {item.completed} runs", *lines] if item.completed > 2 else lines


def _envelope(panel: Panel, times: Array, error: Array, claimed: Array, row: int, reach: float) -> list[Any]:
    handles: list[Any] = []
    if len(error) > 2:
        mean, spread = error.mean(axis=0), 3 * error.std(axis=0, ddof=1)
        handles.append(panel.fill_between(times, mean - spread, mean + spread, color="#c9ccd1", linewidth=0))
    (dashed,) = panel.plot(times, 3 * claimed, color=ENVELOPE, linewidth=0.9, linestyle=(0, (4, 1.5)))
    panel.plot(times, -3 * claimed, color=ENVELOPE, linewidth=0.9, linestyle=(0, (4, 1.5)))
    (line,) = panel.plot(times, error[row], color=ONE_RUN, linewidth=0.6)
    if reach > 0 and np.isfinite(reach):
        panel.set_ylim(-reach, reach)
    return [*handles, dashed, line]


def _reach(error: Array, claimed: Array, settled: NDArray[np.bool_]) -> float:
    """Return the half height of a panel: everything after settling, with a little air."""
    part = settled if settled.any() else np.ones_like(settled)
    done = np.abs(error).max(axis=0)
    if len(error) > 2:
        done = np.abs(error.mean(axis=0)) + 3 * error.std(axis=0, ddof=1)
    return float(1.08 * np.nanmax(np.maximum(done, 3 * claimed)[part]))


def _rms(parts: Array) -> Array:
    """Return the RMS over runs (axis 0) of the norms of (runs, time, 3); NaN, thus not drawn, where it is 0."""
    if not len(parts):
        return np.full(parts.shape[1], np.nan)
    sizes: Array = np.sqrt(np.mean(np.sum(parts**2, axis=-1), axis=0))
    return np.where(sizes > 0, sizes, np.nan)
