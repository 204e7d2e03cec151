"""Figures per run that relnav's own summary does not have, from the stored errors of a filter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from relnav_sim.arrays import Array
from replication.kept import LARGEST, WINDOWS

LATE_S = 4000.0
"""Start of the last window of the particle filter's errors: a third of a revolution before the end of 6000 s."""
EARLY_S = 1000.0, 2000.0
"""The first window after the 1000 s from which the paper sees an oscillation."""


def outlier_share(values: Array) -> Array:
    """Return the share of values that a box plot draws as outliers: beyond 1.5 interquartile ranges of the box.

    Args:
        values: One series a row (runs, K).

    Returns:
        The share (runs,); Tukey (1977), Exploratory Data Analysis, section 2D.
    """
    low, high = np.quantile(values, (0.25, 0.75), axis=1, keepdims=True)
    reach = 1.5 * (high - low)
    return np.asarray(((values < low - reach) | (values > high + reach)).mean(axis=1))


def wave_period(time_s: Array, values: Array) -> Array:
    """Return the period of the sinusoid that fits a series best beside a line, for each row (runs,).

    Periods from a quarter to the whole of the span are tried, a two-hundredth of it apart, each by least squares
    (a Lomb-Scargle periodogram with a floating line; Lomb 1976).

    Args:
        time_s: Epochs (K,).
        values: One series a row (runs, K).
    """
    waves = [(period, _left_by(basis, values)) for period, basis in wave_bases(time_s)]
    periods, left = zip(*waves, strict=True)
    return np.asarray(np.array(periods)[np.argmin(left, axis=0)])


def wave_bases(time_s: Array) -> Iterator[tuple[float, Array]]:
    """Yield the periods that are tried, and for each what a line and its wave span, orthonormal, (K, 4)."""
    span = float(time_s[-1] - time_s[0])
    unit = (time_s - time_s.mean()) / span
    for period in np.arange(0.25, 1.1, 0.005) * span:
        phase = 2 * np.pi * time_s / period
        yield period, np.linalg.qr(np.column_stack((np.ones_like(unit), unit, np.cos(phase), np.sin(phase))))[0]


def _left_by(basis: Array, values: Array) -> Array:
    return np.asarray(np.sum(values**2, axis=1) - np.sum((values @ basis) ** 2, axis=1))


def largest_in(time_s: Array, values: Array, start_s: float, end_s: float) -> Array:
    """Return the largest value of each row in a window, its end included (runs,); NaN where the window is empty."""
    inside = values[:, (time_s >= start_s) & (time_s <= end_s)]
    return np.asarray(inside.max(axis=1) if inside.shape[1] else np.full(len(values), np.nan))


def rms_in(time_s: Array, values: Array, start_s: float, end_s: float) -> Array:
    """Return the root mean square of each row in a window, its end included (runs,); NaN where it is empty."""
    inside = values[:, (time_s >= start_s) & (time_s <= end_s)]
    return np.asarray(np.sqrt(np.mean(inside**2, axis=1)) if inside.shape[1] else np.full(len(values), np.nan))


def persistence(time_s: Array, values: Array) -> Array:
    """Return the RMS of each row in the last window over that in the first after 1000 s (runs,).

    1 for an oscillation that goes on, more for one that grows, near 0 for the end of a transient.
    """
    return rms_in(time_s, values, LATE_S, np.inf) / rms_in(time_s, values, *EARLY_S)


def derived(time_s: Array, error: Array, sigma: Array, settle_s: float) -> Mapping[str, Callable[[], Array]]:
    """Return the figures by column, each made when it is called.

    Args:
        time_s: Stored epochs (K,).
        error: Errors, RTN (runs, K, 6), m and m/s.
        sigma: Formal standard deviations (runs, K, 6).
        settle_s: Start of the steady state.
    """
    settled = time_s >= settle_s
    r, v = (np.linalg.norm(error[..., part], axis=-1) for part in (slice(0, 3), slice(3, 6)))
    formal = np.linalg.norm(sigma[..., :3], axis=-1)
    windows = {
        name: (lambda start=start, end=end: largest_in(time_s, r, start, end))
        for name, start, end in zip(LARGEST, WINDOWS[:-1], WINDOWS[1:], strict=True)
    }
    return {
        "outliers_r": lambda: outlier_share(r[:, settled]),
        "outliers_v": lambda: outlier_share(v[:, settled]),
        "wave_period_s": lambda: wave_period(time_s[settled], error[:, settled, 3]),
        "r_persistence": lambda: persistence(time_s, r),
        "v_persistence": lambda: persistence(time_s, v),
        "v_rms_late_m_s": lambda: rms_in(time_s, v, LATE_S, np.inf),
        "sigma_r_first_m": lambda: formal[:, 0],
        "sigma_r_last_m": lambda: formal[:, -1],
        "sigma_r_ratio": lambda: formal[:, -1] / formal[:, 0],
        **windows,
    }
