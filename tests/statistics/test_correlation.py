"""The integrated time of processes whose correlation is known."""

import numpy as np
import pytest

from relnav_sim.statistics.correlation import integrated_time
from relnav_sim.statistics.intervals import chi_square_band, effective_samples


@pytest.mark.parametrize("tau", [2.0, 10.0, 40.0])
def test_gauss_markov(tau: float) -> None:
    step, runs, K = 1.0, 60, 4000
    rng = np.random.default_rng(int(tau))
    a = np.exp(-step / tau)
    x = np.empty((runs, K))
    x[:, 0] = rng.standard_normal(runs)
    for k in range(1, K):
        x[:, k] = a * x[:, k - 1] + np.sqrt(1 - a * a) * rng.standard_normal(runs)
    expected = 0.5 + a / (1 - a)
    # Sokal 1997, eq. 3.19: relative variance 2 (2 M + 1) / n with a window of M = 5 tau; 4 sigma, and 1 % of bias
    tolerance = 4 * np.sqrt(2 * (2 * 5 * expected + 1) / (runs * K)) + 0.01
    assert integrated_time(5 + 3 * x, step) == pytest.approx(expected, rel=tolerance)
    # A square is correlated over half the time; its mean lies in its chi-square band as often as the band says.
    own = integrated_time(x**2, step)
    assert own == pytest.approx(0.5 + a * a / (1 - a * a), rel=2 * tolerance)
    band = chi_square_band(1, 1, effective_samples(K * step, own))
    inside = ((x**2).mean(axis=1) >= band.low) & ((x**2).mean(axis=1) <= band.high)
    assert inside.mean() > 0.95 - 4 * np.sqrt(0.95 * 0.05 / runs)


def test_white_noise_and_nothing() -> None:
    white = np.random.default_rng(0).standard_normal((50, 500))
    assert integrated_time(white, 2.0) == pytest.approx(1.0, abs=0.1)
    white[:49, 3] = np.nan
    assert np.isfinite(integrated_time(white, 2.0))
    assert np.isnan(integrated_time(np.full((3, 10), np.nan), 1.0))
    assert np.isnan(integrated_time(np.ones((3, 10)), 1.0))
    assert np.isnan(integrated_time(np.ones((3, 2)), 1.0))
