"""Everything about Shi et al. (2025): index, tables, figures, causes, and what lies beyond."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from relnav_sim.replication import alpha_kf_causes as causes
from relnav_sim.replication import figure_drawing as drawing
from relnav_sim.replication.alpha_kf_rules import ALPHAS, R_MEAN, V_MEAN, future_rules
from relnav_sim.replication.effects import judge
from relnav_sim.replication.evidence import found_in_words, number_of, runs_of
from relnav_sim.replication.figure_files import save
from relnav_sim.replication.measured import Measured
from relnav_sim.replication.paper_tables import figures, place, published_table, table_four
from relnav_sim.replication.papers import papers
from relnav_sim.replication.summary import Experiment, PaperPart, Plot
from relnav_sim.report.tables import Column, Number, Row, Table, Words
from relnav_sim.statistics.verdicts import mean_of_runs

_THREE = {"alpha_kf": "αKF", "ekf": "EKF", "ukf": "UKF"}
_BEYOND = "alpha_kf_beyond"
_PAPERS_OWN = {
    "alpha_kf": "αKF, one process noise",
    "alpha_kf_tuned": "αKF, tuned",
    "kf_tuned": "KF, tuned",
    "adaptive_alpha_tuned": "adaptive alpha filter, tuned",
}
_BETTER = {
    "ekf_second_order": "EKF with quadratic gravity",
    "ekf_j2": "EKF with J2 dynamics",
    "adaptive_alpha_j2": "adaptive alpha filter with J2 dynamics",
}
_SPREAD = "Blue: run 0; grey: where 95 % of the runs are at each epoch."


def part(measured: Measured, folder: Path) -> PaperPart:
    """Return the paper's part of the summary; its figures are written to a folder."""
    paper = papers()["alpha_kf"]
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        learned=_learned(measured),
        index=_index(),
        tables=(
            published_table(measured, 2, "alpha_kf_gaussian"),
            published_table(measured, 3, "alpha_kf_mixture"),
            table_four(measured),
        ),
        plots=_plots(measured, folder),
        experiments=experiments(measured),
        beyond=(_best_filters(measured), _future(measured)),
    )


def experiments(measured: Measured) -> tuple[Experiment, ...]:
    """Return the experiments that show the causes."""
    return (
        causes.alpha_is_a_gain(measured),
        causes.process_noise_orders_the_filters(measured),
        causes.unscented_is_extended(measured),
        causes.sampling_floor(measured),
        causes.small_alpha_is_slow(measured),
        causes.counted_operations(),
    )


def _index() -> Table:
    rows = (
        (
            "Fig. 1, Fig. 2",
            "Definition of the radar's angles; signal flow. No numbers: docs/frames.md, docs/sensors.md.",
        ),
        ("Table 1", "Sensor errors: the campaigns' sensors sections, a third of each."),
        ("Table 2", "Table 2 below, with convergence times."),
        ("Figs. 3, 5", "Errors over 6000 s, Gaussian noise."),
        ("Figs. 4, 6", "The first 100 s, at full rate."),
        ("Figs. 7, 8, 9", "P of αKF, EKF and UKF: in one figure, because they lie on each other."),
        ("Table 3", "Table 3 below."),
        ("Figs. 10, 11", "Errors with mixture noise."),
        ("Table 4", "Table 4 below."),
        ("Figs. 12, 13", "Box plots by alpha."),
        ("Figs. 14, 15", "Mean and standard deviation against alpha."),
    )
    return Table(
        "index_alpha_kf",
        "The paper's tables and figures, by number",
        "",
        "in the paper",
        (Column("here", numeric=False),),
        tuple(Row(number, (Words(text),)) for number, text in rows),
    )


def _places(measured: Measured, campaign: str, table: str, quantity: str) -> str:
    """Return where the paper's mean errors lie among our runs, filter by filter."""
    row, unit = papers()["alpha_kf"].content[table][quantity], "m" if quantity == "r" else "m/s"
    parts = [
        f"{_THREE[role]} {row[role][0]:.3f} {unit} ({place(row[role][0], runs)})"
        for role in _THREE
        if len(runs := figures(measured, campaign, role, quantity, "mean"))
    ]
    return f"The paper's mean {quantity} among our runs: {', '.join(parts)}."


def _times(measured: Measured) -> str:
    """Return where the paper's times to converge lie among our runs."""
    published = papers()["alpha_kf"].content["convergence_s"]
    parts = []
    for role, label in _THREE.items():
        times = measured.values("alpha_kf_gaussian", 0, role, "convergence_relative_s")
        known = np.where(np.isnan(times), np.inf, times)
        parts.append(f"{label} {published[role]} s ({place(published[role], known)})")
    return f"The paper's times to converge among ours (below 3 settled RMS): {', '.join(parts)}."


def _sweep_places(measured: Measured, quantity: str) -> str:
    """Return how many of Table 4's means lie inside our runs."""
    column = 1 if quantity == "r" else 3
    words = []
    for row in papers()["alpha_kf"].content["table_4"]:
        runs = figures(measured, "alpha_kf_sweep", f"alpha_{row[0]:g}", quantity, "mean")
        words.append(f"{row[0]:g}: {place(row[column], runs)}")
    return f"The paper's mean {quantity} among our runs, by alpha: {'; '.join(words)}."


def _plots(measured: Measured, folder: Path) -> tuple[Plot, ...]:
    gaussian, mixture, start = "alpha_kf_gaussian", "alpha_kf_mixture", "alpha_kf_start"
    sweep = {f"alpha_{alpha:g}": f"{alpha:g}" for alpha in ALPHAS}
    rows = papers()["alpha_kf"].content["table_4"]
    published = {"position": [row[1] for row in rows], "velocity": [row[3] for row in rows]}
    drawn: list[tuple[str, str, Callable[[], Any], str]] = [
        (
            "Fig. 3",
            "alpha_kf_fig_3",
            lambda: drawing.error_curves(measured, gaussian, _THREE, velocity=False),
            f"Position errors with Gaussian noise and one process noise for all. {_SPREAD} The panels of a row are "
            "alike "
            "because the filters are; the paper's differ because their settings do. "
            + _places(measured, gaussian, "table_2", "r"),
        ),
        (
            "Fig. 5",
            "alpha_kf_fig_5",
            lambda: drawing.error_curves(measured, gaussian, _THREE, velocity=True),
            f"Velocity errors of the same runs. {_SPREAD} The slow wave of half a revolution, which the paper sees "
            "as well, is "
            "what Clohessy-Wiltshire leaves out of J2. " + _places(measured, gaussian, "table_2", "v"),
        ),
        (
            "Fig. 4",
            "alpha_kf_fig_4",
            lambda: drawing.error_curves(measured, start, _THREE, velocity=False, reach=(15.0, 15.0, 15.0)),
            f"The first 100 s: position. {_SPREAD} {_times(measured)}",
        ),
        (
            "Fig. 6",
            "alpha_kf_fig_6",
            lambda: drawing.error_curves(measured, start, _THREE, velocity=True, reach=(1.0, 1.0, 1.0)),
            f"The first 100 s: velocity. {_SPREAD} The paper prints no number for it.",
        ),
        (
            "Figs. 7, 8 and 9",
            "alpha_kf_fig_7_8_9",
            lambda: drawing.sigma_curves(measured, start, {**_THREE, "ukf_quiet": "UKF, quiet"}),
            "Roots of the diagonal of P. EKF and UKF lie on each other, the alpha filter is where R / α puts it; the "
            "only "
            "filter that stands apart, later, is a UKF with a process noise 10000 times smaller. The paper prints no "
            "number.",
        ),
        (
            "Fig. 10",
            "alpha_kf_fig_10",
            lambda: drawing.error_curves(measured, mixture, _THREE, velocity=False),
            f"Position errors with mixture noise. {_SPREAD} {_places(measured, mixture, 'table_3', 'r')}",
        ),
        (
            "Fig. 11",
            "alpha_kf_fig_11",
            lambda: drawing.error_curves(measured, mixture, _THREE, velocity=True),
            f"Velocity errors with mixture noise. {_SPREAD} {_places(measured, mixture, 'table_3', 'v')}",
        ),
        (
            "Figs. 12 and 13",
            "alpha_kf_fig_12_13",
            lambda: drawing.alpha_boxes(measured, "alpha_kf_sweep", sweep, published),
            "Position and velocity error by alpha, over all epochs after the start and all runs: box from quartile to "
            "quartile, line at the median, whiskers to the extremes. Triangles: means of the paper's Table 4. "
            + _sweep_places(measured, "r"),
        ),
        (
            "Figs. 14 and 15",
            "alpha_kf_fig_14_15",
            lambda: drawing.alpha_trend(_trend(measured)),
            "Mean and standard deviation over time against alpha. Bands: 95 % intervals over runs. With 10000 random "
            "draws the scatter is that of KF(R/α) and the noise of the samples on top. " + _sweep_places(measured, "v"),
        ),
    ]
    return tuple(
        Plot(number, save(folder, name, draw()), caption, f"{number} of Shi et al. (2025), replicated")
        for number, name, draw, caption in drawn
    )


def _trend(measured: Measured) -> list[dict[str, Any]]:
    rows = papers()["alpha_kf"].content["table_4"]
    names = ("r mean", "r std", "v mean", "v std")
    curves: list[dict[str, Any]] = [
        {"label": "paper, one run", "alpha": ALPHAS, **{n: [row[i + 1] for row in rows] for i, n in enumerate(names)}}
    ]
    for label, campaign, pattern, case in (
        ("256 fixed samples", "alpha_kf_sweep", "alpha_{:g}", 0),
        ("KF(R/α), tuned for each α", "alpha_kf_sweep", "kf_{:g}_tuned", 0),
        ("10000 random draws", "alpha_kf_draws", "random_{:g}", 1),
    ):
        curve: dict[str, Any] = {"label": label, "alpha": ALPHAS, "low": {}, "high": {}}
        for name in names:
            quantity, which = name.split()
            means = [
                mean_of_runs(figures(measured, campaign, pattern.format(alpha), quantity, which, case))
                for alpha in ALPHAS
            ]
            curve[name] = [mean.estimate for mean in means]
            curve["low"][name], curve["high"][name] = [m.low for m in means], [m.high for m in means]
        curves.append(curve)
    return curves


def _best_filters(measured: Measured) -> Table:
    """Relnav's best filters on the paper's scenarios, with the bound where it is stored."""
    rows = []
    for noise, published, campaign in (
        ("Gaussian", "table_2", "alpha_kf_gaussian"),
        ("mixture", "table_3", "alpha_kf_mixture"),
    ):
        content = papers()["alpha_kf"].content[published]
        r, v = content["r"]["alpha_kf"], content["v"]["alpha_kf"]
        rms = [math.hypot(*pair) for pair in (r, v)]
        paper = (
            Number(r[0], decimals=3),
            Number(rms[0], decimals=3),
            Number(v[0], decimals=3),
            Number(rms[1], decimals=4),
        )
        rows.append(Row(f"{noise}: paper's αKF", paper, opens_block=True))
        case = measured.case(_BEYOND, {"sensors.radar.noise": {"kind": noise.lower()}})
        places = [(campaign, 0, filter, label) for filter, label in _PAPERS_OWN.items()]
        places += [(_BEYOND, case, filter, label) for filter, label in _BETTER.items()]
        for where, number, filter, label in places:
            columns = (R_MEAN, "settled_r_rms_m", V_MEAN, "settled_v_rms_m_s")
            cells = tuple(
                number_of(mean_of_runs(measured.values(where, number, filter, c)), 3 if "_r_" in c else 5)
                for c in columns
            )
            rows.append(Row(f"{noise}: {label}", cells))
        bound = _bound_row(measured, case)
        if bound is not None:
            rows.append(Row(f"{noise}: bound, perfect model", bound))
    return Table(
        "beyond_alpha_kf",
        "The same scenario with relnav's filters",
        "t ≥ 500 s, mean over runs with 95 % interval; the paper's RMS is made of its mean and standard deviation. The "
        "bound is the posterior Cramér-Rao bound of a filter whose dynamics are perfect.",
        "noise: filter",
        (Column("r mean [m]"), Column("r RMS [m]"), Column("v mean [m/s]"), Column("v RMS [m/s]")),
        tuple(rows),
    )


def _bound_row(measured: Measured, case: int) -> tuple[Words | Number, ...] | None:
    """Return the bound's RMS over the settled time, or None where results hold none."""
    results = measured.results(campaign)
    read = getattr(results, "bound", None)
    bound = read(0) if read is not None else None
    if bound is None:
        return None
    settled = results.time_s(0) >= 500
    r, v = (math.sqrt(float(np.mean(bound[settled, k] ** 2))) for k in (6, 7))
    return (Words("–"), Number(r, decimals=3), Words("–"), Number(v, decimals=5))


def _future(measured: Measured) -> Table:
    """The paper's future work, an alpha found online, by the same rules."""
    rows = []
    for rule in future_rules():
        judgement = judge(rule, measured)
        rows.append(
            Row(
                f"{rule.claim} with the adaptive alpha filter",
                (
                    Words(judgement.verdict),
                    Words(found_in_words(judgement)),
                    Number(float(runs_of(judgement.evidence)), decimals=0),
                ),
            )
        )
    return Table(
        "future_alpha_kf",
        "The paper's future work by the same rules: alpha found at each epoch",
        "adaptive_alpha_kf in the alpha filter's place. Gaussian noise: scheme student_t; mixture: responsibilities.",
        "claim",
        (Column("verdict", numeric=False), Column("found", numeric=False), Column("runs")),
        tuple(rows),
    )


def _learned(measured: Measured) -> tuple[str, ...]:
    r = figures(measured, "alpha_kf_gaussian", "kf_tuned", "r", "mean")
    alpha = figures(measured, "alpha_kf_gaussian", "alpha_kf_tuned", "r", "mean")
    quiet = figures(measured, "alpha_kf_gaussian", "ekf_implied", "z", "mean")
    return (
        "The alpha filter is a Kalman filter with R / α. A linear Kalman filter gives the same estimate at a "
        "thousandth "
        "of the cost, without sampling noise.",
        f"Tuned, a plain Kalman filter has a mean position error of {r.mean():.3f} m, the tuned alpha filter "
        f"{alpha.mean():.3f} m: α and Q are two names for one knob.",
        "The published filters differ by their process noise. The radial bias gives it away: an EKF with "
        f"S_a = 1.5e-8 m²/s³ has one of {quiet.mean():.2f} m here, the paper's has 1.497 m.",
        "Whoever wants to beat all three columns of Table 2 changes the dynamics, not the divergence: see below.",
    )
