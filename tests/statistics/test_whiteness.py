"""Autocorrelation and Ljung and Box's test against closed forms and their own level."""

import numpy as np
import pytest
from scipy.stats import kstest

from relnav_sim.statistics.whiteness import whiteness


def test_correlation_and_statistic_are_those_of_the_definition():
    series = np.array([3.0, -1.0, 4.0, 1.0, -5.0, 9.0, 2.0, -6.0, 5.0, 3.0])
    found = whiteness([series], most_lags=2)
    d = series - series.mean()
    r = [d[:-1] @ d[1:] / (d @ d), d[:-2] @ d[2:] / (d @ d)]
    np.testing.assert_allclose(found.correlation, r, rtol=1e-12)
    assert found.statistic == pytest.approx(10 * 12 * (r[0] ** 2 / 9 + r[1] ** 2 / 8))
    assert found.p_value == pytest.approx(np.exp(-found.statistic / 2))  # chi-square with 2 degrees of freedom
    assert found.bound == pytest.approx(1.959964 / np.sqrt(10), rel=1e-6)


def test_white_noise_passes_at_the_nominal_rate():
    rng = np.random.default_rng(1)
    found = [whiteness([rng.normal(size=1500)]) for _ in range(1000)]
    p_values = [one.p_value for one in found]
    # The statistic is chi-square for large N only; its level of 5 % is then within 3 sigma of a count of 1000.
    assert abs(np.mean(np.array(p_values) < 0.05) - 0.05) < 3 * np.sqrt(0.05 * 0.95 / 1000)
    assert kstest(p_values, "uniform").pvalue > 1e-3
    assert np.mean([one.outside for one in found]) == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize("phi", [0.3, -0.4])
def test_a_first_order_process_fails_with_its_own_correlation(phi):
    rng = np.random.default_rng(2)
    x = np.zeros(20_000)
    for k in range(1, len(x)):
        x[k] = phi * x[k - 1] + rng.normal()
    found = whiteness([x])
    assert found.p_value < 1e-12
    # Bartlett (1946): the variance of r_1 is (1 - phi^2) / N.
    assert abs(found.correlation[0] - phi) < 4 * np.sqrt((1 - phi**2) / len(x))
    assert abs(found.correlation[1] - phi**2) < 0.04


def test_runs_are_pooled_and_never_joined_end_to_end():
    rng = np.random.default_rng(3)
    levels = [1.0, -1.0] * 100
    # Two values each: all that is correlated is inside a run.
    runs = [level + 0.01 * rng.normal(size=60) for level in levels]
    found = whiteness(runs)
    np.testing.assert_allclose(found.correlation, (60 - np.arange(1, 13)) / 60, rtol=1e-3)


def test_an_offset_is_no_correlation():
    series = np.random.default_rng(4).normal(size=5000)
    np.testing.assert_allclose(whiteness([series + 7]).correlation, whiteness([series]).correlation, atol=1e-9)


def test_too_short_and_constant_series():
    short = whiteness([np.arange(4.0)])
    assert short.lags == 0 and np.isnan(short.p_value) and np.isnan(short.outside) and short.count == 4
    assert whiteness([]).count == 0
    assert whiteness([np.ones(100)]).p_value == 1.0
    assert whiteness([np.random.default_rng(5).normal(size=100)]).lags == 20
