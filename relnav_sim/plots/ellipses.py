"""Errors of all runs at one epoch in the planes of the frame, with their ellipse and the one that the filter states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.axes import Axes, describe_axes
from relnav_sim.plots.data import (
    Case,
    FigureError,
    covariances_of,
    errors_of,
    facts_of,
    largest,
    leading_filter,
    sigmas_of,
    speed_unit,
)
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.geometry import PLANES
from relnav_sim.plots.panels import say
from relnav_sim.plots.style import FORMAL, INK, house_style, key, line_styles, margins, new_figure, shown_name
from relnav_sim.plots.words import FigureWords
from relnav_sim.wording import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

Quantity = Literal["position", "velocity"]

SIGMA_95 = math.sqrt(-2 * math.log(0.05))
"""Of the ellipse that holds 95 % of a normal distribution in a plane, 2.45."""
_FEWEST_RUNS = 3


@dataclass(frozen=True)
class _Drawn:
    """What the panels show, in the unit of their axes.

    Attributes:
        errors: Those of the runs (runs, 3).
        formal: Root mean over the runs of their formal covariances (3, 3); None without runs.
        correlated: Whether the formal covariance has its correlations.
        unit: The unit.
    """

    errors: Array
    formal: Array | None
    correlated: bool
    unit: str


def error_ellipses(
    results: Results,
    case: Case = 0,
    filter: str | None = None,
    axes: Axes = "rtn",
    at_s: float | None = None,
    sigma: float | None = None,
    quantity: Quantity = "position",
) -> Figure:
    """Draw the errors of all runs at one epoch in the three planes, with the ellipses of k sigma.

    Solid: the ellipse of the errors' mean and covariance over runs. Dashed: that of the mean over runs of what the
    filter states, about no error, with its correlations where the result holds them (``clock.store_covariance``); else
    from its sigmas alone, so that its axes are those of the panel. An ellipse of k sigma is where e^T P^-1 e = k^2; of
    a normal distribution it holds 1 - exp(-k^2 / 2).

    Args:
        results: An opened result.
        case: The case.
        filter: The filter; default: the one with the smallest position RMS.
        axes: The axes of the panels.
        at_s: The epoch, s: the stored one that is nearest; default: the last one.
        sigma: Size k of the ellipses in sigmas; default: 2.45, which holds 95 %.
        quantity: Position or velocity errors.

    Raises:
        FigureError: ``sigma`` is not positive, ``at_s`` no time of the run, or there is no such quantity.
    """
    k = SIGMA_95 if sigma is None else sigma
    if not (math.isfinite(k) and k > 0):
        raise FigureError(f"sigma must be a positive number, not {sigma!r}")
    if quantity not in ("position", "velocity"):
        raise FigureError(f"quantity must be position or velocity, not {quantity!r}")
    facts = facts_of(results, case, axes)
    name = filter or leading_filter(facts)
    epoch = _epoch(facts, at_s)
    drawn = _drawn(results, facts, name, epoch, quantity)
    colour = line_styles(facts.all_filters)[name].colour
    prefix = "v" if quantity == "velocity" else ""
    with house_style():
        figure = new_figure(3.3)
        panels = figure.subplots(2, 2)
        for panel, (across, up) in zip(panels.flat, PLANES, strict=False):
            if drawn.formal is None:
                say(panel, "no error is known" if facts.filter(name).completed else "every run failed")
            else:
                pair = [across, up]
                _ellipse_panel(panel, drawn.errors[:, pair], drawn.formal[np.ix_(pair, pair)], k, colour)
            panel.set_xlabel(f"{prefix}{'xyz'[across]} error [{drawn.unit}]")
            panel.set_ylabel(f"{prefix}{'xyz'[up]} error [{drawn.unit}]")
        panels[1, 1].axis("off")
        handles = [
            key(colour, "none", 0.0), key(colour, "-", 1.2), key(FORMAL, (0, (4, 1.5)), 1.0), key(INK, "none", 0.0),
        ]  # fmt: skip
        handles[0].set(marker=".", markersize=4)
        handles[3].set(marker="+", markersize=6)
        formal = "formal" if drawn.correlated else "formal,\nno correlations"
        words = [counted(len(drawn.errors), "run"), "errors of the runs", formal, "no error"]
        title = f"{shown_name(name, 24)}\nt = {facts.times_s[epoch]:g} s\n{_size_in_words(k)}"
        panels[1, 1].legend(handles, words, loc="center left", title=title, alignment="left")
        margins(figure, 0.5, 0.14, 0.1, 0.36, hspace=0.5, wspace=0.6)
    return figure


def ellipses_words(case: CaseFacts, name: str, sigma: float, correlated: bool) -> FigureWords:
    """Return the words of `error_ellipses` at the last epoch."""
    formal = "with its correlations" if correlated else "from its sigmas, without correlations"
    what = (
        f"Position errors of {name} in all runs at t = {case.times_s[-1]:g} s. Solid: the {_size_in_words(sigma)} "
        f"ellipse of the errors; dashed: that of the formal covariance, {formal}"
    )
    return FigureWords(f"{what}. {describe_axes(case.axes)}.", f"{what}, in three planes.")


def ellipse(covariance: Array, centre: Array, sigma: float = SIGMA_95) -> Array:
    """Return points (n, 2) of the ellipse of so many sigmas; by default it holds 95 % of a normal distribution."""
    values, vectors = np.linalg.eigh(covariance)
    turn = np.linspace(0, 2 * np.pi, 121)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    outline: Array = centre + (vectors @ (sigma * np.sqrt(np.maximum(values, 0))[:, None] * circle)).T
    return outline


def _epoch(facts: CaseFacts, at_s: float | None) -> int:
    """Return which stored epoch is nearest to a time of the run."""
    if at_s is None:
        return len(facts.times_s) - 1
    if not facts.times_s[0] <= at_s <= facts.times_s[-1]:
        raise FigureError(
            f"at {at_s:g} s there is no epoch; the run is from {facts.times_s[0]:g} to {facts.times_s[-1]:g} s"
        )
    return int(np.argmin(np.abs(facts.times_s - at_s)))


def _drawn(results: Results, facts: CaseFacts, name: str, epoch: int, quantity: Quantity) -> _Drawn:
    item, rows = facts.filter(name), np.array([epoch])
    part = slice(0, 3) if quantity == "position" else slice(3, 6)
    errors = errors_of(results, facts, item, rows)[:, 0, part]
    known = np.isfinite(errors).all(axis=1)
    whole = covariances_of(results, facts, item, rows)
    if whole is None:
        sigmas = sigmas_of(results, facts, item, rows)[known, 0, part]
        covariances = sigmas[:, :, None] ** 2 * np.eye(3)
    else:
        covariances = whole[known, 0, part, part]
    scale, unit = (1.0, "m") if quantity == "position" else speed_unit(largest(np.abs(errors[known])))
    formal = covariances.mean(axis=0) * scale**2 if known.any() else None
    return _Drawn(errors[known] * scale, formal, whole is not None, unit)


def _size_in_words(sigma: float) -> str:
    """Return how large an ellipse is: its sigmas, and what it holds of a normal distribution."""
    held = f"{100 * -math.expm1(-(sigma**2) / 2):.4g} %"
    return held if sigma == SIGMA_95 else f"{sigma:g} sigma ({held})"


def _ellipse_panel(panel: Panel, errors: Array, formal: Array, sigma: float, colour: str) -> None:
    panel.plot(*errors.T, ".", color=colour, markersize=3, mew=0, alpha=0.5, rasterized=len(errors) > 500)
    outlines = [ellipse(formal, np.zeros(2), sigma)]
    panel.plot(*outlines[0].T, color=FORMAL, linewidth=1.0, linestyle=(0, (4, 1.5)))
    if len(errors) >= _FEWEST_RUNS:
        outlines.append(ellipse(np.cov(errors.T), errors.mean(axis=0), sigma))
        panel.plot(*outlines[1].T, color=colour, linewidth=1.2)
    panel.plot(0, 0, "+", color=INK, markersize=6)
    reach = 1.1 * max(largest(np.abs(np.concatenate([errors, *outlines]))), 1e-12)
    panel.set_xlim(-reach, reach)
    panel.set_ylim(-reach, reach)
