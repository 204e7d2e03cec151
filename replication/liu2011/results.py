"""Liu et al. (2011): tables and causes. The accessible part of the paper has no numbers to stand beside."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.intervals import wilson_interval
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.built import built
from replication.evidence import number_of
from replication.figure_drawing import error_norms
from replication.liu2011.rules import PRIORS_M, QUICK_S, SLACKS, WIDE_M, prior
from replication.measured import Measured
from replication.papers import papers
from replication.summary import Experiment, PaperPart, Plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILTERS = {
    "two_step_unscented": "two-step, unscented start",
    "two_step_closed_form": "two-step, closed-form start",
    "two_step_linearised": "two-step, F P Fᵀ + R",
    "two_step_tight": "two-step, F P Fᵀ + 1e-6 R",
    "two_step_slack_100": "two-step, F P Fᵀ + 100 R",
    "two_step_slack_10000": "two-step, F P Fᵀ + 1e4 R",
    "two_step_loose": "two-step, F P Fᵀ + 1e6 R",
    "ekf": "EKF",
    "ukf": "UKF",
    "iekf": "iterated EKF",
    "kf": "KF on the converted fix",
}


def _cases(measured: Measured) -> list[tuple[str, int]]:
    cases = [(f"{sigma:g} m", measured.case("two_step", prior(sigma))) for sigma in PRIORS_M]
    return [*cases, ("first fix", measured.case("two_step", {"start": {"kind": "first_fix"}}))]


def share_table(measured: Measured) -> Table:
    """Return the share of runs that converge in time, by filter and start error."""
    rows = []
    for filter, label in FILTERS.items():
        cells: list[Cell] = []
        for _, case in _cases(measured):
            times = measured.values("two_step", case, filter, "convergence_s")
            share = wilson_interval(int(np.count_nonzero(times <= QUICK_S)), len(times))
            reached = times[~np.isnan(times)]
            note = f"median {np.median(reached):.0f} s" if len(reached) else ""
            cells.append(Number(share.estimate, share.low, share.high, 2, note=note))
        rows.append(Row(label, tuple(cells)))
    return Table(
        "two_step_share",
        f"Share of runs whose position error stays below 1 m for 10 s from {QUICK_S:g} s at the latest",
        f"95 % intervals (Wilson) of {measured.runs_in_words('two_step')}, and the median time of those that do."
        " Start errors are 1 sigma of the "
        "position per axis, with 0.01, 0.1, 0.3 and 0.3 m/s; first fix: the first radar measurement, converted, and "
        "1 m/s.",
        "filter",
        tuple(Column(label) for label, _ in _cases(measured)),
        tuple(rows),
    )


def error_table(measured: Measured) -> Table:
    """Return the position error of the steady state, by filter and start error."""
    rows = []
    for filter, label in FILTERS.items():
        cells = tuple(
            number_of(mean_of_runs(measured.values("two_step", case, filter, "settled_r_rms_m")), 3)
            for _, case in _cases(measured)
        )
        rows.append(Row(label, cells, "m"))
    return Table(
        "two_step_error",
        "RMS position error after 150 s",
        f"Mean over {measured.runs_in_words('two_step')} with 95 % interval.",
        "filter",
        tuple(Column(label) for label, _ in _cases(measured)),
        tuple(rows),
    )


def start_is_all(measured: Measured) -> Experiment:
    """The filters that do as well without a two-step filter."""
    case = measured.case("two_step", prior(WIDE_M))
    rows = []
    for filter, label in FILTERS.items():
        whole = measured.values("two_step", case, filter, "r_rms_m")
        settled = measured.values("two_step", case, filter, "settled_r_rms_m")
        whole, settled = (np.where(np.isnan(values), math.nan, values) for values in (whole, settled))
        rows.append(
            Row(
                label,
                (
                    Number(float(np.nanmedian(whole)), decimals=2),
                    Number(float(np.nanmedian(settled)), decimals=4),
                    Number(float(np.nanquantile(settled, 0.95)), decimals=4),
                ),
            )
        )
    table = Table(
        "two_step_start",
        f"From {WIDE_M} m and 0.3 m/s: two-step filters and the filters that need no second step",
        "RMS position error [m]: over the whole run, median of the runs; after 150 s, median and the 95 % quantile "
        f"of the runs; {measured.runs_in_words('two_step')}.",
        "filter",
        (Column("whole run"), Column("steady state"), Column("steady state, 95 % of runs")),
        tuple(rows),
    )
    by = {filter: float(row.cells[1].order or 0.0) for filter, row in zip(FILTERS, rows, strict=True)}
    fix = measured.case("two_step", {"start": {"kind": "first_fix"}})
    ekf_fix = float(np.nanmedian(measured.values("two_step", fix, "ekf", "settled_r_rms_m")))
    shares = ", ".join(
        f"{words} {100 * np.mean(measured.values('two_step', case, filter, 'convergence_s') <= QUICK_S):.0f} %"
        for filter, words in SLACKS.items()
    )
    text = (
        f"Of the runs from {WIDE_M} m, a linearised start converges with a slack of {shares}. Only starts whose "
        "covariance is too small fail; the unscented transform finds one that is large enough.",
        f"In the steady state the two-step filter with the unscented start has {by['two_step_unscented']:.4f} m, an "
        f"iterated EKF {by['iekf']:.4f} m, a Kalman filter on converted fixes {by['kf']:.4f} m and an EKF that starts "
        f"at the first radar fix {ekf_fix:.4f} m (medians of the runs).",
    )
    return Experiment("Only too tight a start fails", ("C1", "C2"), text, table)


def part(measured: Measured) -> PaperPart:
    """Return the paper's part of the summary."""
    paper = papers()["two_step_kf"]
    needs = ("two_step",)
    text = "The accessible part of the paper ends before its simulation: no table and no figure can be compared."
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        index=Table(
            "index_two_step_kf",
            "The paper's tables and figures, by number",
            "",
            "in the paper",
            (Column("here", numeric=False),),
            (Row("none accessible", (Words(text),)),),
        ),
        tables=built(measured, (needs, lambda: share_table(measured)), (needs, lambda: error_table(measured))),
        plots=built(measured, (needs, lambda: _plot(measured))),
        experiments=built(measured, (needs, lambda: start_is_all(measured))),
        beyond=(),
    )


def _plot(measured: Measured) -> Plot:
    shown = ("two_step_unscented", "two_step_linearised", "ekf", "ukf", "iekf", "kf")

    def draw() -> Figure:
        time, curves = measured.curves("two_step", measured.case("two_step", prior(WIDE_M)), "norms")
        return error_norms([(FILTERS[name], time, curves[name]) for name in shown], velocity=False)

    return Plot(
        "Start-up",
        "two_step_start",
        f"Position error from a start error of {WIDE_M} m: median of {measured.runs_in_words('two_step')} and "
        "where 90 % of them are.",
        "Position error of the two-step filters, EKF, UKF, iterated EKF and KF over time",
        draw,
    )
