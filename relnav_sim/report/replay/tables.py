"""The tables of a replay: filters, sensors and channels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.report.replay.figures_of_filters import FilterFigures
from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words, decimals_for
from relnav_sim.statistics.residual_checks import SMOOTHER_SHARE, ChannelCheck

_BAND = "in brackets where 95 % of consistent filters lie"


def scores_table(filters: Sequence[FilterFigures], truth: str, settle_s: float) -> Table:
    """Return the errors of filters that are scored."""
    columns = ("position RMS", "settled", "velocity RMS", "settled", "ANEES", "settled", "final position", "failed")
    rows = []
    for one in filters:
        if one.scores is None:
            continue
        each = one.scores
        numbers = [*each.position_rms_m, *each.velocity_rms_m_s, *each.anees, each.final_position_m]
        cells: list[Cell] = [Number(value, decimals=decimals_for([value], [])) for value in numbers]
        rows.append(Row(one.name, (*cells, Number(each.failed, decimals=0))))
    return Table(
        "scores",
        "Errors",
        f"Estimate minus {truth}; position in m, velocity in m/s; whole run and steady state (t ≥ {settle_s:g} "
        "s). Runs "
        "that failed are left out.",
        "filter",
        tuple(Column(label) for label in columns),
        tuple(rows),
    )


def sensors_table(filters: Sequence[FilterFigures]) -> Table:
    """Return the NIS of each sensor, and whether filter and smoother agree."""
    rows = []
    for one in filters:
        shares = one.checks.smoother.share
        known = shares[np.isfinite(shares)]
        least = float(known.min()) if len(known) else np.nan
        for place, nis in enumerate(one.checks.nis):
            band = (np.nan, np.nan) if nis.band is None else (nis.band.low, nis.band.high)
            cells = (
                Words(nis.sensor),
                Number(nis.updates, decimals=0),
                Number(nis.ratio, *band, decimals=3),
                Words(nis.finding or "no measurement"),
                Number(100 * least, decimals=1) if not place else Words(""),
            )
            rows.append(Row(one.name, cells, opens_block=not place, record=one.name))
    return Table(
        "sensors",
        "Innovations",
        f"NIS summed over all measurements of a sensor, over its expectation; {_BAND}, by the scatter over time where "
        "that is wider than chi-square. Last: share of the estimates, in the component where it is smallest, that "
        "later measurements moved by less than 3 sigma of "
        f"that move; {100 * SMOOTHER_SHARE:g} % or more is agreement.",
        "filter",
        (
            Column("sensor", numeric=False),
            Column("measurements"),
            Column("NIS / dof"),
            Column("finding", numeric=False),
            Column("within 3 sigma of the smoother [%]"),
        ),
        tuple(rows),
    )


def channels_table(filter: FilterFigures, number: int) -> Table:
    """Return the residuals of a filter, a row for each channel."""
    level = filter.checks.level
    return Table(
        f"channels_{number:03d}",
        "Residuals by channel",
        "Residual: measurement minus what the filter expected, before the update. In sigmas: over the standard "
        "deviation "
        f"that the filter stated for it, of which mean 0 and RMS 1 are consistent. Whiteness: lag-1 autocorrelation, "
        f"share of the lags outside ±1.96/√N, and the probability of Ljung and Box that white noise is as correlated; "
        f"below {level:.2g} and with a correlation that matters it counts as a finding.",
        "channel",
        tuple(
            Column(label, numeric=label != "finding")
            for label in (
                "measurements",
                "mean",
                "std",
                "mean [sigma]",
                "RMS [sigma]",
                "lag 1",
                "lags",
                "outside [%]",
                "p-value",
                "finding",
            )
        ),
        tuple(_channel_row(one, level) for one in filter.checks.channels),
    )


def _channel_row(one: ChannelCheck, level: float) -> Row:
    white = one.whiteness
    lag1 = float(white.correlation[0]) if white.lags else np.nan
    findings = [
        word for word, found in (("mean", one.is_biased(level)), ("correlated", one.is_correlated(level))) if found
    ]
    size = decimals_for([one.sigma], [])
    return Row(
        one.name,
        (
            Number(one.count, decimals=0),
            Number(one.mean, decimals=size),
            Number(one.sigma, decimals=size),
            Number(one.normalised_mean, decimals=3),
            Number(one.normalised_sigma, decimals=3),
            Number(lag1, decimals=3),
            Number(white.lags, decimals=0),
            Number(100 * white.outside, decimals=1),
            Number(white.p_value, decimals=4),
            Words(", ".join(findings) or "none"),
        ),
        unit=one.channel.unit,
    )
