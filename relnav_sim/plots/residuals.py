"""Figures of a filter's residuals: over time with their 3 sigma, the NIS, and the autocorrelation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.plots.data import Case, FigureError, facts_of, leading_filter
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.panels import heading, say, time_axis, time_unit
from relnav_sim.plots.run_figures import span_index
from relnav_sim.plots.style import BAND, FORMAL, INK, PALETTE, house_style, margins, new_figure, shown_name
from relnav_sim.plots.words import FigureWords
from relnav_sim.statistics.channel_whiteness import campaign_checks
from relnav_sim.statistics.consistency import chi_square_quantile
from relnav_sim.statistics.residual_checks import ChannelCheck, NisCheck

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from relnav_sim.results.read import Results

_PANEL_INCH = 1.05
_MOST_DOTS = 4000
_COLOUR = PALETTE[0]
_RAISED = 1.35


def residuals_over_time(times_s: Array, channels: Sequence[tuple[ChannelCheck, Array, Array]]) -> Figure:
    """Draw the residuals of one run against time, a panel for each channel, with 3 sigma that the filter states.

    Args:
        times_s: The epochs, (T,), s.
        channels: Each channel with its residuals and their sigmas, (T,), SI; NaN where nothing was read.
    """
    unit, length = time_unit(times_s)
    with house_style():
        figure = new_figure(0.42 + _PANEL_INCH * len(channels))
        panels = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (check, residual, sigma) in zip(panels, channels, strict=True):
            there = np.flatnonzero(np.isfinite(residual))
            scale, shown = _shown_unit(check.channel.unit, sigma)
            panel.set_ylabel(f"[{shown}]")
            heading(panel, shown_name(check.name, 40))
            if not len(there):
                say(panel, "no measurement")
                continue
            drawn = there[:: max(1, len(there) // _MOST_DOTS)]
            times, spread = times_s[drawn] / length, 3 * sigma[drawn] * scale
            panel.fill_between(times, -spread, spread, color=BAND, linewidth=0, alpha=0.7)
            panel.plot(times, residual[drawn] * scale, ".", color=_COLOUR, markersize=1.8, mew=0)
            # A start that is not known yet must not hide the rest.
            reach = _RAISED * max(3 * np.median(sigma[there]), np.quantile(np.abs(residual[there]), 0.99)) * scale
            panel.set_ylim(-reach, reach)
        time_axis(panels[-1], times_s / length, unit)
        margins(figure, 0.55, 0.12, 0.18, 0.36, hspace=0.24, wspace=0.1)
    return figure


def residuals_words(name: str, channels: Sequence[ChannelCheck], run: int) -> FigureWords:
    """Return the words of `residuals_over_time`."""
    parts = [f"{one.name} RMS {one.normalised_sigma:.2f} sigma" for one in channels]
    return FigureWords(
        f"Residuals of {name} in run {run}, before each update. Grey: ± 3 formal sigma.",
        f"Residuals against time, a panel for each channel: {'; '.join(parts)}.",
    )


def nis_over_time(times_s: Array, sensors: Mapping[str, tuple[NisCheck, Array, Integers]]) -> Figure:
    """Draw the NIS of one run over its degrees of freedom against time, a panel for each sensor.

    Args:
        times_s: The epochs, (T,), s.
        sensors: By sensor the check, the NIS and its degrees of freedom, (T,).
    """
    unit, length = time_unit(times_s)
    with house_style():
        figure = new_figure(0.42 + _PANEL_INCH * len(sensors))
        panels = figure.subplots(len(sensors), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (sensor, (_, nis, dof)) in zip(panels, sensors.items(), strict=True):
            there = np.flatnonzero(np.isfinite(nis) & (dof > 0))
            panel.set_ylabel("NIS / dof [-]")
            heading(panel, shown_name(sensor, 40))
            if not len(there):
                say(panel, "no measurement")
                continue
            drawn = there[:: max(1, len(there) // _MOST_DOTS)]
            panel.plot(times_s[drawn] / length, nis[drawn] / dof[drawn], ".", color=_COLOUR, markersize=1.8, mew=0)
            usual = int(np.median(dof[there]))
            for probability in (0.025, 0.975):
                level = chi_square_quantile(probability, usual) / usual
                panel.axhline(level, color=FORMAL, linewidth=0.7, linestyle=":")
            mean = _moving_mean(nis[there], dof[there])
            panel.plot(times_s[there] / length, mean, color=PALETTE[1], linewidth=1.2)
            panel.axhline(1.0, color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
            panel.set_ylim(0, _RAISED * max(np.quantile(nis[there] / dof[there], 0.99), 1.5))
        time_axis(panels[-1], times_s / length, unit)
        margins(figure, 0.5, 0.12, 0.18, 0.36, hspace=0.24, wspace=0.1)
    return figure


def nis_words(name: str, sensors: Sequence[NisCheck], run: int) -> FigureWords:
    """Return the words of `nis_over_time`."""
    parts = [f"{one.sensor} {one.ratio:.3f}" for one in sensors]
    return FigureWords(
        f"NIS of {name} in run {run} over its degrees of freedom. Line: mean over 50 measurements; dashed: the "
        "expectation "
        "1; dotted: where a single one lies in 95 % of all cases.",
        f"NIS over its degrees of freedom against time; means over all: {', '.join(parts)}.",
    )


def autocorrelation(channels: Sequence[ChannelCheck]) -> Figure:
    """Draw the autocorrelation of residuals in sigmas, a panel for each channel, with the bound of white noise."""
    with house_style():
        figure = new_figure(0.42 + _PANEL_INCH * len(channels))
        panels = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
        for panel, check in zip(panels, channels, strict=True):
            heading(panel, shown_name(check.name, 40))
            white = check.whiteness
            panel.set_ylabel("[-]")
            if not white.lags:
                say(panel, "too few measurements")
                continue
            lags = np.arange(1, white.lags + 1)
            panel.axhspan(-white.bound, white.bound, color=BAND, linewidth=0, alpha=0.7)
            panel.vlines(lags, 0.0, white.correlation, color=_COLOUR, linewidth=1.0)
            panel.axhline(0.0, color=INK, linewidth=0.6)
            reach = _RAISED * max(float(np.abs(white.correlation).max()), 2 * white.bound)
            panel.set_ylim(-reach, reach)
            panel.set_xlim(0, white.lags + 1)
        panels[-1].set_xlabel("lag [measurements]")
        margins(figure, 0.5, 0.12, 0.18, 0.36, hspace=0.24, wspace=0.1)
    return figure


def autocorrelation_words(name: str, channels: Sequence[ChannelCheck]) -> FigureWords:
    """Return the words of `autocorrelation`."""
    parts = [
        f"{one.name} {one.whiteness.correlation[0]:.3f} at lag 1, p {one.whiteness.p_value:.2g}"
        for one in channels
        if one.whiteness.lags
    ]
    return FigureWords(
        f"Autocorrelation of the residuals of {name} between measurements so many apart. Grey: where that of "
        "white noise "
        "lies at 95 % of the lags.",
        f"Autocorrelation against lag, a panel for each channel: {'; '.join(parts) or 'too few measurements'}.",
    )


def residual_whiteness(results: Results, case: Case = 0, filter: str | None = None) -> Figure:
    """Draw the autocorrelation of a filter's residuals over all completed runs, a panel for each channel.

    Args:
        results: An opened result.
        case: The case.
        filter: The filter; default: the one with the smallest position RMS.

    Raises:
        FigureError: The campaign did not ask for it (``statistics.whiteness``).
    """
    facts = facts_of(results, case)
    checks = channel_checks(facts, facts.filter(filter or leading_filter(facts)))
    if not checks:
        raise FigureError("the result holds no residuals by channel: its campaign has no statistics.whiteness: true")
    return autocorrelation(checks)


def residual_whiteness_words(case: CaseFacts, name: str) -> FigureWords:
    """Return the words of `residual_whiteness`."""
    words = autocorrelation_words(name, channel_checks(case, case.filter(name)))
    return replace(words, caption=f"{words.caption} All completed runs, {case.when}.")


def channel_checks(case: CaseFacts, item: FilterFacts) -> list[ChannelCheck]:
    """Return the check of each channel over the completed runs and the headline span; none where it is not known."""
    return [] if item.by_channel is None else campaign_checks(item.by_channel, item.ok, span_index(case.span))


def _moving_mean(nis: Array, dof: Integers, width: int = 50) -> Array:
    """Return the mean over so many measurements, fewer at both ends."""
    window = np.ones(min(width, len(nis)))
    return np.asarray(np.convolve(nis, window, "same") / np.convolve(dof, window, "same"))


def _shown_unit(unit: str, sigma: Array) -> tuple[float, str]:
    """Return what to multiply SI values by, and the unit they then have: small angles are easier in arc seconds."""
    if unit != "rad":
        return 1.0, unit
    degrees = np.degrees(float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else 1.0)
    return (np.degrees(1.0), "deg") if degrees > 0.02 else (3600 * np.degrees(1.0), "arcsec")
