"""The tables of Shi et al. (2025) in their layout, their numbers beside ours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.axes import source_component
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.results.layout import quantity_unit
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.evidence import number_of
from replication.measured import Measured
from replication.papers import papers
from replication.shi2025.interpretations import TUNED_GAUSSIAN, TUNED_MIXTURE
from replication.tuning_seeds import pooled

QUANTITIES = ("x", "y", "z", "r", "vx", "vy", "vz", "v")
FILTERS = {"ekf": "EKF", "ukf": "UKF", "alpha_kf": "αKF"}
_UNITS = {"m": "m", "m_s": "m/s"}


@dataclass(frozen=True)
class Version:
    """One way to run the paper's filters.

    Attributes:
        label: Its name in the table.
        filters: The filters of the campaign by role.
        quantities: Rows that it has.
        campaign: Name of the campaign, where it is not the table's own.
        cases: Numbers of the cases; several differ by the seed of the tuning alone.
    """

    label: str
    filters: Mapping[str, str]
    quantities: tuple[str, ...] = QUANTITIES
    campaign: str = ""
    cases: tuple[int, ...] = (0,)


_SAME = {role: role for role in FILTERS}
_IMPLIED = {role: f"{role}_implied" for role in FILTERS}


def _versions(number: int) -> tuple[Version, ...]:
    tuned = TUNED_GAUSSIAN if number == 2 else TUNED_MIXTURE
    versions = (
        Version("one process noise", _SAME),
        Version("implied by its bias", _IMPLIED),
        Version("each tuned", _SAME, ("r", "v"), "alpha_kf_tuned", tuned),
    )
    if number != 2:
        return versions
    return (*versions, Version("implied, i = 97.6 deg, e = 0.002", _IMPLIED, ("z", "r", "v"), "alpha_kf_orbit"))


def figures(measured: Measured, campaign: str, filter: str, quantity: str, which: str, case: int = 0) -> Array:
    """Return a mean or std over time (t >= settle_s) for each run, in the axes of the paper.

    Args:
        measured: The results.
        campaign: Name of the campaign.
        filter: Name of the filter.
        quantity: ``x`` to ``v``, in the paper's axes.
        which: ``mean`` or ``std``.
        case: Number of the case.
    """
    component, sign = source_component(quantity, "shi2025")
    column = f"settled_{component}_{which}_{quantity_unit(component)}"
    values = measured.values(campaign, case, filter, column)
    return sign * values if which == "mean" else values


def place(paper: float, values: Array) -> str:
    """Return where a published figure lies among our runs: the share of runs below it."""
    known = values[~np.isnan(values)]
    if not len(known):
        return ""
    below = int(np.count_nonzero(known < paper))
    if below == 0:
        return "below all runs"
    return "above all runs" if below == len(known) else f"above {100 * below / len(known):.0f} % of runs"


def mean_over_runs(
    measured: Measured, campaign: str, filter: str, quantity: str, which: str, cases: Sequence[int] = (0,)
) -> Interval:
    """Return the mean over runs of `figures`; several cases differ by the seed of the tuning alone."""
    found = [mean_of_runs(figures(measured, campaign, filter, quantity, which, case)) for case in cases]
    return found[0] if len(found) == 1 else pooled(found)


def published_table(measured: Measured, number: int, campaign: str) -> Table:
    """Return Table 2 or 3 of the paper: for each quantity the paper's row, ours, and where theirs lies in ours."""
    content = papers()["alpha_kf"].content
    published: Mapping[str, Mapping[str, Sequence[float]]] = content[f"table_{number}"]
    columns = [
        Column(which, label, opens_group=which == "mean") for label in FILTERS.values() for which in ("mean", "std")
    ]
    versions = [item for item in _versions(number) if measured.has(item.campaign or campaign)]
    rows = []
    for quantity in QUANTITIES:
        unit = _UNITS[quantity_unit(quantity)]
        paper = [value for role in FILTERS for value in published[quantity][role]]
        rows.append(
            Row(f"{quantity}, paper", tuple(Number(value, decimals=3) for value in paper), unit, opens_block=True)
        )
        for version in versions:
            if quantity not in version.quantities:
                continue
            cells = tuple(
                number_of(
                    mean_over_runs(
                        measured, version.campaign or campaign, version.filters[role], quantity, which, version.cases
                    ),
                    decimals=3 if quantity in "xyzr" else 4,
                )
                for role in FILTERS
                for which in ("mean", "std")
            )
            rows.append(Row(f"{quantity}, relnav, {version.label}", cells, unit))
        runs = [figures(measured, campaign, role, quantity, which) for role in FILTERS for which in ("mean", "std")]
        places: tuple[Cell, ...] = tuple(Words(place(p, v)) for p, v in zip(paper, runs, strict=True))
        rows.append(Row(f"{quantity}, the paper's number is", places))
    if number == 2:
        rows += _convergence_rows(measured, campaign, content["convergence_s"])
    noise = "Gaussian noise" if number == 2 else "mixture noise"
    runs_text = len(figures(measured, campaign, "ekf", "r", "mean"))
    return Table(
        f"table_{number}",
        f"Table {number} of Shi et al. (2025), {noise}",
        "Mean and standard deviation over time (t ≥ 500 s) of the signed error, and of its norm r and v; the "
        f"paper's numbers are of one run, ours the mean over {runs_text} runs with its 95 % interval. Axes: x "
        "along-track, y minus orbit normal, z nadir. The place of the paper's number is that among our runs with one "
        "process noise.",
        "quantity",
        tuple(columns),
        tuple(rows),
    )


def _convergence_rows(measured: Measured, campaign: str, published: Mapping[str, float]) -> list[Row]:
    rows = [
        Row(
            "convergence, paper",
            tuple(Number(float(published[role]), decimals=0, span=2) for role in FILTERS),
            "s",
            opens_block=True,
        )
    ]
    for label, column in (
        ("below 3 steady-state RMS for 50 s", "convergence_relative_s"),
        ("below 5 m for 50 s", "convergence_s"),
    ):
        cells: list[Cell] = []
        for role in FILTERS:
            times = measured.values(campaign, 0, role, column)
            reached = times[~np.isnan(times)]
            low, middle, high = np.quantile(reached, (0.05, 0.5, 0.95)) if len(reached) else (math.nan,) * 3
            note = "median, 5 to 95 % of runs" if len(reached) == len(times) else f"{len(reached)} of {len(times)} runs"
            cells.append(Number(float(middle), float(low), float(high), 1, span=2, note=note))
        rows.append(Row(f"convergence, relnav, {label}", tuple(cells), "s"))
    return rows


def table_four(measured: Measured) -> Table:
    """Return Table 4: the paper's alphas with theirs, ours at one process noise, tuned, and with 10000 draws."""
    content = papers()["alpha_kf"].content
    heads = {"r_mean": "r mean", "r_std": "r std", "v_mean": "v mean", "v_std": "v std"}
    columns = tuple(Column(head, opens_group=index == 0) for index, head in enumerate(heads.values()))
    versions = (
        ("one process noise", "alpha_kf_sweep", "alpha_{}", (0,)),
        ("tuned for each alpha", "alpha_kf_sweep_tuned", "kf_{}", (0, 1, 2)),
        ("10000 random draws", "alpha_kf_draws", "random_{}", (1,)),
    )
    rows = []
    for alpha, *paper in content["table_4"]:
        rows.append(Row(f"α = {alpha:g}, paper", tuple(Number(value, decimals=3) for value in paper), opens_block=True))
        for label, campaign, pattern, cases in versions:
            if not measured.has(campaign):
                continue
            cells = []
            for head in heads:
                quantity, which = head.split("_")
                mean = mean_over_runs(measured, campaign, pattern.format(f"{alpha:g}"), quantity, which, cases)
                cells.append(number_of(mean, decimals=3 if quantity == "r" else 4))
            rows.append(Row(f"α = {alpha:g}, relnav, {label}", tuple(cells)))
    return Table(
        "table_4",
        "Table 4 of Shi et al. (2025): the divergence coefficient, with mixture noise and 0.05 deg of bias",
        f"r in m, v in m/s. Ours: mean over {measured.runs_in_words('alpha_kf_sweep', 'alpha_kf_draws')} with its 95 % "
        "interval, 500-6000 s.",
        "alpha",
        columns,
        tuple(rows),
    )
