"""How many independent samples is a span of correlated epochs worth?"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array

_WINDOW = 5.0  # of the integrated time: Sokal's choice, a bias of 1 % for an exponential correlation


def integrated_time(series: Array, step: float) -> float:
    """Return the integrated autocorrelation time of a stationary process seen in several runs.

    tau = dt (1/2 + sum rho_k), summed up to the first lag of at least 5 tau (Sokal 1997, section 3). It is the time
    constant of an exponential correlation, so a span T is worth T / (2 tau) samples: see `intervals.effective_samples`.

    Args:
        series: (runs, K); runs that are not finite throughout are left out.
        step: Time between samples.

    Returns:
        In the unit of ``step``, at least half of it (no correlation); NaN for fewer than 4 samples or no spread.
    """
    series = series[np.isfinite(series).all(axis=1)]
    runs, K = series.shape
    if runs == 0 or K < 4:
        return float("nan")
    # The mean over all runs: subtracting each run's own would take away the slowest part.
    deviations = series - series.mean()
    spectrum = np.fft.rfft(deviations, 2 * K, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, :K].sum(axis=0) / np.arange(K, 0, -1)
    if not covariance[0] > 0:
        return float("nan")
    tau = 0.5 + np.concatenate([[0.0], np.cumsum(covariance[1:] / covariance[0])])
    enough = np.flatnonzero(np.arange(K) >= _WINDOW * tau)
    return step * max(0.5, float(tau[enough[0]] if len(enough) else tau[K // 2]))
