"""The figures of Shi et al. (2025), with the places of their numbers among our runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from replication import figure_drawing as drawing
from replication.measured import Measured
from replication.papers import papers
from replication.shi2025.interpretations import ALPHAS
from replication.shi2025.tables import figures, mean_over_runs, place
from replication.summary import Plot

_THREE = {"alpha_kf": "αKF", "ekf": "EKF", "ukf": "UKF"}


def _spread(measured: Measured, campaign: str) -> str:
    return f"Blue: run 0; grey: where 95 % of {measured.runs_in_words(campaign)} are at each epoch."


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
    if not measured.has("alpha_kf_gaussian"):
        return ""
    published = papers()["alpha_kf"].content["convergence_s"]
    parts = []
    for role, label in _THREE.items():
        times = measured.values("alpha_kf_gaussian", 0, role, "convergence_relative_s")
        known = np.where(np.isnan(times), np.inf, times)
        parts.append(f"{label} {published[role]} s ({place(published[role], known)})")
    return f"The paper's times to converge among ours (below 3 times its steady-state RMS): {', '.join(parts)}."


def _sweep_places(measured: Measured, quantity: str) -> str:
    """Return how many of Table 4's means lie inside our runs."""
    column = 1 if quantity == "r" else 3
    words = []
    for row in papers()["alpha_kf"].content["table_4"]:
        runs = figures(measured, "alpha_kf_sweep", f"alpha_{row[0]:g}", quantity, "mean")
        words.append(f"{row[0]:g}: {place(row[column], runs)}")
    return f"The paper's mean {quantity} among our runs, by alpha: {'; '.join(words)}."


def _formal_range(measured: Measured) -> str:
    """Return from where to where the formal position sigma falls."""
    words = []
    for role, label in _THREE.items():
        first, last = (
            measured.values("alpha_kf_start", 0, role, f"sigma_r_{which}_m").mean() for which in ("first", "last")
        )
        words.append(f"{label} {first:.1f} to {last:.2f} m")
    return f"Position sigma at the first fix and after 100 s: {', '.join(words)}."


def plots(measured: Measured) -> tuple[Plot, ...]:
    """Return the paper's figures with what the pages say of them."""
    gaussian, mixture, start = "alpha_kf_gaussian", "alpha_kf_mixture", "alpha_kf_start"
    sweep = {f"alpha_{alpha:g}": f"{alpha:g}" for alpha in ALPHAS}
    rows = papers()["alpha_kf"].content["table_4"]
    published = {"position": [row[1] for row in rows], "velocity": [row[3] for row in rows]}
    drawn: list[tuple[str, str, str, Callable[[], Any], Callable[[], str]]] = [
        (
            "Fig. 3",
            "alpha_kf_fig_3",
            gaussian,
            lambda: drawing.error_curves(measured, gaussian, _THREE, velocity=False),
            lambda: (
                f"Position errors, Gaussian noise, one process noise for all. {_spread(measured, gaussian)} "
                + _places(measured, gaussian, "table_2", "r")
            ),
        ),
        (
            "Fig. 5",
            "alpha_kf_fig_5",
            gaussian,
            lambda: drawing.error_curves(measured, gaussian, _THREE, velocity=True),
            lambda: (
                f"Velocity errors of the same runs. {_spread(measured, gaussian)} "
                + _places(measured, gaussian, "table_2", "v")
            ),
        ),
        (
            "Fig. 4",
            "alpha_kf_fig_4",
            start,
            lambda: drawing.error_curves(measured, start, _THREE, velocity=False, reach=(15.0, 15.0, 15.0)),
            lambda: f"The first 100 s: position. {_spread(measured, start)} {_times(measured)}",
        ),
        (
            "Fig. 6",
            "alpha_kf_fig_6",
            start,
            lambda: drawing.error_curves(measured, start, _THREE, velocity=True, reach=(1.0, 1.0, 1.0)),
            lambda: f"The first 100 s: velocity. {_spread(measured, start)}",
        ),
        (
            "Figs. 7, 8 and 9",
            "alpha_kf_fig_7_8_9",
            start,
            lambda: drawing.sigma_curves(measured, start, {**_THREE, "ukf_quiet": "UKF, S_a = 1e-10"}),
            lambda: (
                "Roots of the diagonal of P, formal sigma. EKF and UKF coincide; the alpha filter is where R / α "
                f"puts it. {_formal_range(measured)}"
            ),
        ),
        (
            "Fig. 10",
            "alpha_kf_fig_10",
            mixture,
            lambda: drawing.error_curves(measured, mixture, _THREE, velocity=False),
            lambda: (
                f"Position errors with mixture noise. {_spread(measured, mixture)} "
                + _places(measured, mixture, "table_3", "r")
            ),
        ),
        (
            "Fig. 11",
            "alpha_kf_fig_11",
            mixture,
            lambda: drawing.error_curves(measured, mixture, _THREE, velocity=True),
            lambda: (
                f"Velocity errors with mixture noise. {_spread(measured, mixture)} "
                + _places(measured, mixture, "table_3", "v")
            ),
        ),
        (
            "Figs. 12 and 13",
            "alpha_kf_fig_12_13",
            "alpha_kf_sweep",
            lambda: drawing.alpha_boxes(measured, "alpha_kf_sweep", sweep, published),
            lambda: (
                "Position and velocity error by alpha, all epochs of the steady state and all runs: box from "
                "quartile to quartile, line at the median, whiskers to the last value within 1.5 interquartile ranges, "
                "dots: outliers, thinned out. " + _sweep_places(measured, "r")
            ),
        ),
        (
            "Figs. 14 and 15",
            "alpha_kf_fig_14_15",
            "alpha_kf_sweep",
            lambda: drawing.alpha_trend(_trend(measured)),
            lambda: (
                "Mean and standard deviation over time against alpha. Bands: 95 % intervals over "
                f"{measured.runs_in_words('alpha_kf_sweep', 'alpha_kf_draws')}. " + _sweep_places(measured, "v")
            ),
        ),
    ]
    return tuple(
        Plot(number, name, caption(), f"{number} of Shi et al. (2025), replicated", draw)
        for number, name, campaign, draw, caption in drawn
        if measured.has(campaign)
    )


def _trend(measured: Measured) -> list[dict[str, Any]]:
    rows = papers()["alpha_kf"].content["table_4"]
    names = ("r mean", "r std", "v mean", "v std")
    curves: list[dict[str, Any]] = [
        {"label": "paper, one run", "alpha": ALPHAS, **{n: [row[i + 1] for row in rows] for i, n in enumerate(names)}}
    ]
    for label, campaign, pattern, cases in (
        ("512 fixed samples", "alpha_kf_sweep", "alpha_{:g}", (0,)),
        ("KF(R/α), tuned for each α", "alpha_kf_sweep_tuned", "kf_{:g}", (0, 1, 2)),
        ("10000 random draws", "alpha_kf_draws", "random_{:g}", (1,)),
    ):
        if not measured.has(campaign):
            continue
        curve: dict[str, Any] = {"label": label, "alpha": ALPHAS, "low": {}, "high": {}}
        for name in names:
            quantity, which = name.split()
            means = [
                mean_over_runs(measured, campaign, pattern.format(alpha), quantity, which, cases) for alpha in ALPHAS
            ]
            curve[name] = [mean.estimate for mean in means]
            curve["low"][name], curve["high"][name] = [m.low for m in means], [m.high for m in means]
        curves.append(curve)
    return curves
