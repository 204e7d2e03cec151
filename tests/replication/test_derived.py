"""Figures from stored errors, beside cases whose answer is known."""

import numpy as np
import pytest
from scipy.stats import norm

from relnav_sim.statistics.verdicts import mean_of_runs
from replication.derived import largest_in, outlier_share, persistence, rms_in, wave_period
from replication.tuning_seeds import pooled


def test_outliers_of_a_normal_law():
    values = np.random.default_rng(1).normal(size=(4, 20000))
    quartile = norm.ppf(0.75)
    expected = 2 * norm.sf(4 * quartile)  # 0.70 %
    # Standard error of a share of 20000: 0.06 %; four runs, three standard errors.
    assert outlier_share(values).mean() == pytest.approx(expected, abs=3 * np.sqrt(expected / 80000))


def test_the_period_of_a_sinusoid_is_found_beside_a_drift_and_noise():
    time = np.arange(500.0, 6001.0, 20.0)
    periods = np.array([2000.0, 3000.0, 3500.0])
    noise = np.random.default_rng(2).normal(size=(3, len(time)))
    values = 3 + 1e-3 * time + 2 * np.cos(2 * np.pi * time / periods[:, None] + 0.7) + 0.1 * noise
    # The grid of periods is 27.5 s apart.
    np.testing.assert_allclose(wave_period(time, values), periods, atol=30)


def test_windows():
    time = np.arange(0.0, 6001.0, 10.0)
    values = np.abs(np.vstack((np.full_like(time, 2.0), time)))
    np.testing.assert_allclose(largest_in(time, values, 1000, 1500), [2.0, 1500.0])
    np.testing.assert_allclose(rms_in(time, values, 1000, 1000), [2.0, 1000.0])
    assert np.isnan(largest_in(time, values, 7000, 8000)).all()
    assert persistence(time, values)[0] == pytest.approx(1.0)
    assert persistence(time, values)[1] > 3


def test_an_interval_over_tunings_covers_where_that_of_one_tuning_does_not():
    """Figures with a deviation of 1 over runs and of 0.5 over tunings: 95 % intervals of 500 experiments."""
    random = np.random.default_rng(3)
    covered = {"pooled": 0, "one": 0}
    experiments, runs = 500, 30
    for _ in range(experiments):
        tunings = random.normal(scale=0.5, size=3)
        noise = random.normal(size=runs)  # the same runs for every tuning
        each = [mean_of_runs(noise + shift) for shift in tunings]
        for name, interval in (("pooled", pooled(each)), ("one", each[0])):
            covered[name] += interval.low <= 0 <= interval.high
    # Rubin's interval with three tunings; standard error of a share of 500 near 0.95: 1 %.
    assert covered["pooled"] >= 0.95 * experiments - 3 * np.sqrt(experiments * 0.05 * 0.95)
    assert covered["one"] < 0.7 * experiments


def test_tunings_that_agree_change_no_interval():
    values = np.random.default_rng(4).normal(size=20)
    one = mean_of_runs(values)
    both = pooled([one, one, one])
    assert (both.low, both.high) == pytest.approx((one.low, one.high))
