"""Are the residuals of each channel white? A table over the runs of a campaign."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from relnav_sim.campaign.afterwards import ONLY_INNOVATIONS
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.residuals import channel_checks
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.residual_checks import RELEVANT_CORRELATION, ChannelCheck
from relnav_sim.wording import MISSING, listed


def whiteness_table(case: CaseFacts) -> Table | None:
    """Return what the residuals of each channel say of each filter; None where the campaign did not ask."""
    checks = {item.name: {one.name: one for one in channel_checks(case, item)} for item in case.filters}
    channels = list(dict.fromkeys(name for own in checks.values() for name in own))
    if not channels:
        return None
    level = (1 - CONFIDENCE) / max(len(own) for own in checks.values())
    figures: tuple[tuple[str, Callable[[ChannelCheck], Cell]], ...] = (
        ("verdict", lambda one: _verdict(one, level)),
        ("measurements", lambda one: Words(str(one.count), one.count)),
        ("mean residual in formal sigmas", lambda one: Number(one.normalised_mean, decimals=4)),
        ("RMS residual in formal sigmas", lambda one: Number(one.normalised_sigma, decimals=3)),
        ("autocorrelation at lag 1", lambda one: _at(one, 0)),
        ("largest autocorrelation", _largest),
        ("lags outside the band of white noise", lambda one: Number(100 * one.whiteness.outside, decimals=0, note="%")),
        ("p of white noise (Ljung-Box)", lambda one: _probability(one.whiteness.p_value)),
    )
    rows = [
        Row(
            f"{name}, {label}",
            tuple(of(own[name]) if name in own else Words(MISSING) for own in checks.values()),
            opens_block=not place,
        )
        for name in channels
        for place, (label, of) in enumerate(figures)
    ]
    return Table(
        name=f"case_{case.index:03d}_whiteness",
        title=f"Residuals by channel ({case.when})",
        caption="Residuals before the update, z - h(prediction), over the root of their formal variance, at every "
        f"measurement of all completed runs.{_rejected(case)} When consistent: mean 0, RMS 1, and white. "
        "Autocorrelation "
        "between measurements so many apart; in brackets the band of white noise at one lag, 95 %. Correlated: "
        "more than "
        "chance allows (Ljung and Box 1978, all channels of a filter together at 5 %) and above 0.05 at some lag; "
        "white within 0.05: not above it. Biased: a mean beyond chance and above 0.1 sigma. A filter whose noise is "
        "correlated, whose model leaves something out or whose gain is wrong has correlated residuals."
        + (f" {untested}" if (untested := untested_residuals(case)) else ""),
        corner="quantity",
        columns=tuple(Column(item.name) for item in case.filters),
        rows=tuple(rows),
    )


def _rejected(case: CaseFacts) -> str:
    """Return a sentence on what is left out where filters edit their measurements; empty elsewhere."""
    edits = any(item.editing is not None for item in case.filters)
    return " Measurements that a filter rejected are not among them; Measurement editing counts those." if edits else ""


def untested_residuals(case: CaseFacts) -> str:
    """Return a sentence on the filters of a case whose residuals are not kept; empty without any."""
    names = [item.name for item in case.filters if item.by_channel is None]
    return f"Residuals of {listed(names)} are not tested: {ONLY_INNOVATIONS}." if names else ""


def _verdict(one: ChannelCheck, level: float) -> Cell:
    if not one.whiteness.lags:
        return Words("too few measurements")
    findings = {"correlated": one.is_correlated(level), "biased": one.is_biased(level)}
    said = [word for word, found in findings.items() if found]
    if said:
        return Words(", ".join(said), mark="failed")
    return Words("white" if one.whiteness.p_value >= level else f"white within {RELEVANT_CORRELATION:g}")


def _at(one: ChannelCheck, lag: int) -> Cell:
    if not one.whiteness.lags:
        return Number(math.nan)
    bound, found = one.whiteness.bound, float(one.whiteness.correlation[lag])
    return Words(f"{found:.4f} [{-bound:.4f}, {bound:.4f}]", found)


def _largest(one: ChannelCheck) -> Cell:
    if not one.whiteness.lags:
        return Number(math.nan)
    place = int(np.argmax(np.abs(one.whiteness.correlation)))
    return Number(float(one.whiteness.correlation[place]), decimals=4, note=f"at lag {place + 1}")


def _probability(p: float) -> Cell:
    return Number(p, decimals=3 if not p < 0.0005 else 6)
