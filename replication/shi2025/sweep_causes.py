"""Experiments that show what Table 4 of Shi et al. (2025), the errors by alpha, is made of."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.report.tables import Cell, Column, Number, Row, Table
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.evidence import number_of
from replication.measured import Measured
from replication.papers import papers
from replication.shi2025.rules import ALPHAS
from replication.shi2025.tables import figures
from replication.summary import Experiment


def sampling_floor(measured: Measured) -> Experiment:
    """What 10000 random draws add, beside the closed form sqrt(trace R / (alpha N))."""
    published = {row[0]: row for row in papers()["alpha_kf"].content["table_4"]}
    # Trace of R in the orbit frame: range 4 m along the line of sight, 12 km times the angle across it, twice.
    trace = 4.0**2 + 2 * (12000 * math.radians(0.2 / 3)) ** 2
    rows = []
    floors = []
    for alpha in ALPHAS:
        floor = math.sqrt(trace / (alpha * 10000))
        cells: list[Cell] = [Number(floor, decimals=2)]
        for case in (0, 1):
            random = measured.values("alpha_kf_draws", case, f"random_{alpha:g}", "settled_r_rms_m")
            closed = measured.values("alpha_kf_draws", case, f"kf_{alpha:g}", "settled_r_rms_m")
            extra = np.sign(random**2 - closed**2) * np.sqrt(np.abs(random**2 - closed**2))
            cells.append(number_of(mean_of_runs(extra), 2))
            if case == 0:
                floors.append((alpha, floor, mean_of_runs(extra)))
        cells.append(Number(published[alpha][2], decimals=3))
        rows.append(Row(f"α = {alpha:g}", tuple(cells)))
    table = Table(
        "sampling_floor",
        "What 10000 random draws add to the position error",
        "Closed form sqrt(trace R / (α N)), and sqrt(RMS² of the sampled filter − RMS² of KF(R/α)) on the same "
        f"runs, mean over {measured.runs_in_words('alpha_kf_draws')} with 95 % interval; "
        "last the standard deviation in the paper's Table 4. All in m.",
        "alpha",
        (
            Column("closed form"),
            Column("Gaussian, no bias"),
            Column("mixture and bias"),
            Column("paper's std"),
        ),
        tuple(rows),
    )
    small = floors[2]
    quiet, wide = (
        mean_of_runs(figures(measured, "alpha_kf_sweep", f"kf_{alpha:g}", "r", "std")).estimate
        for alpha in (ALPHAS[-1], ALPHAS[0])
    )
    text = (
        "A sampled mean has a noise of its own, which the filter doesn't know of and carries on. It does not depend "
        "on Q and grows as 1/sqrt(α): the smaller α, the less each sample is worth and the longer the filter "
        "remembers.",
        f"At α = {small[0]:g} that is {small[1]:.2f} m by the formula and {small[2].estimate:.1f} m "
        f"[{small[2].low:.1f}, {small[2].high:.1f}] in our runs with Gaussian noise; with the bias, whose error is "
        "larger and moves with the gain, it can't be told apart.",
        f"The published scatter rises from {published[ALPHAS[-1]][2]:.2f} m at α = {ALPHAS[-1]:g} to "
        f"{published[ALPHAS[0]][2]:.2f} m at {ALPHAS[0]:g}. The noise of 10000 samples alone would rise from "
        f"{floors[-1][1]:.2f} to {floors[0][1]:.2f} m, and KF(R/α), which has no samples, from {quiet:.2f} to "
        f"{wide:.2f} m on our runs, because with less gain the errors of its start last longer. Neither is a "
        "property of the divergence.",
    )
    return Experiment("The scatter of Table 4 needs no divergence", ("A6",), text, table)


def small_alpha_is_slow(measured: Measured) -> Experiment:
    """Closed form over alpha with and without bias: what is bias, what is memory."""
    rows = []
    cases = (("both angles", 0.05, 0.05), ("azimuth alone", 0.05, 0.0), ("elevation alone", 0.0, 0.05), ("none", 0, 0))
    table_four = papers()["alpha_kf"].content["table_4"]
    for alpha, r, _, v, _ in table_four:
        cells: list[Cell] = [Number(r, decimals=3)]
        for quantity in ("r", "v"):
            if quantity == "v":
                cells.append(Number(v, decimals=3))
            for _, azimuth, elevation in cases:
                biases = {"sensors.radar.azimuth_bias_deg": azimuth, "sensors.radar.elevation_bias_deg": elevation}
                both = azimuth > 0 and elevation > 0
                campaign = "alpha_kf_sweep" if both else "alpha_kf_bias"
                case = 0 if both else measured.case(campaign, biases)
                values = figures(measured, campaign, f"kf_{alpha:g}", quantity, "mean", case)
                cells.append(number_of(mean_of_runs(values), 2 if quantity == "r" else 4))
        rows.append(Row(f"α = {alpha:g}", tuple(cells)))
    table = Table(
        "bias_and_memory",
        "KF(R/α) by the angle that carries the bias",
        "Mean over t ≥ 500 s of the position error [m] and of the velocity error [m/s], mean over "
        f"{measured.runs_in_words('alpha_kf_bias')}, 95 % intervals; both angles: "
        f"{measured.runs_in_words('alpha_kf_sweep')} of alpha_kf_sweep. S_a = 1e-6 m²/s³ throughout.",
        "alpha",
        tuple(
            Column(label, group, opens_group=label == "paper")
            for group in ("position", "velocity")
            for label in ("paper", *(name for name, _, _ in cases))
        ),
        tuple(rows),
    )
    text = (
        f"0.05 deg at 12 km is {12000 * math.radians(0.05):.1f} m for each angle that carries it. Which one does is "
        "not in the paper, and it decides the size of the position error more than α does.",
        _velocity_by_alpha(measured),
        "In the paper's own Table 4 the velocity error falls all the way from α = 0.001 to 0.999 (0.028 to 0.016 "
        "m/s), and so does the scatter; the position means lie within 4 % from 0.01 to 0.999. A best range 0.05 to "
        "0.1 can only be read from the position means, whose differences (0.003 m between 0.05 and 0.1) are far "
        "inside the noise of a single run.",
    )
    return Experiment("The bias decides the position, and α is a process noise again", ("A6",), text, table)


def _velocity_by_alpha(measured: Measured) -> str:
    """Return how far the velocity error depends on alpha, with one process noise and tuned."""

    def least_and_most(suffix: str) -> tuple[float, float, float]:
        found = {
            alpha: float(figures(measured, "alpha_kf_sweep", f"kf_{alpha:g}{suffix}", "v", "mean").mean())
            for alpha in ALPHAS
        }
        least = min(found, key=found.__getitem__)
        return least, found[least], max(found.values())

    best, low, high = least_and_most("")
    _, low_tuned, high_tuned = least_and_most("_tuned")
    return (
        f"With one process noise for all, the velocity error of KF(R/α) goes from {low:.4f} m/s, at α = {best:g}, to "
        f"{high:.4f} m/s: α finds the gain that the process noise has missed. With the process noise tuned for each "
        f"α, for the position error as everywhere, all lie between {low_tuned:.4f} and {high_tuned:.4f} m/s."
    )
