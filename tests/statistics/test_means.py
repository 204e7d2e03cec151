"""The interval of a mean: Student's and Hall's formulas, its promise of coverage, and what it says of few runs."""

import math

import numpy as np
import pytest
from coverage_tables import coverage_of_a_mean
from scipy import optimize, stats
from taking_turns import taking_turns

from relnav_sim.statistics import means
from relnav_sim.statistics.intervals import mean_interval


def test_a_sample_without_skewness_has_the_interval_of_student() -> None:
    half = np.random.default_rng(0).normal(size=7)
    sample = np.concatenate([half, -half]) + 3
    theirs = stats.ttest_1samp(sample, 0).confidence_interval(0.95)
    found = mean_interval(sample)
    assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)
    assert means.p_value(sample, 2.5) == pytest.approx(stats.ttest_1samp(sample, 2.5).pvalue, rel=1e-6)
    two = mean_interval([1.0, -4.0])
    assert (two.low, two.high) == pytest.approx(tuple(stats.ttest_1samp([1.0, -4.0], 0).confidence_interval(0.95)))


@pytest.mark.parametrize("runs", [3, 10, 50])
def test_a_skewed_sample_has_the_interval_of_hall_on_its_longer_side(runs: int) -> None:
    """The end at which Hall's statistic, with its skewness taken out, is Student's quantile; found by bisection."""
    sample = np.random.default_rng(runs).lognormal(0, 0.8, runs) - 5
    mean, error = sample.mean(), sample.std(ddof=1) / math.sqrt(runs)
    g = stats.skew(sample) / math.sqrt(runs)
    quantile = stats.t.ppf(0.975, runs - 1)

    def beyond(end: float) -> float:
        t = (mean - end) / error
        return t + g * t**2 / 3 + g**2 * t**3 / 27 + g / 6 + quantile

    high = optimize.brentq(beyond, mean, mean + 50 * error, xtol=1e-14)
    found = mean_interval(sample)
    assert g > 0 and found.high == pytest.approx(high, rel=1e-9) and high > mean + quantile * error
    assert found.low == pytest.approx(mean - quantile * error, rel=1e-12)


@pytest.mark.parametrize("runs", [2, 5, 12, 50])
def test_p_values_say_when_the_interval_reaches_a_mean(runs: int) -> None:
    rng = np.random.default_rng(runs)
    for _ in range(20):
        sample = rng.chisquare(2, runs) - 3
        mean = float(rng.normal(-1, 0.5))
        low, high = means.mean_limits(sample, 1 - means.p_value(sample, mean))
        assert mean == pytest.approx(low if mean < sample.mean() else high, abs=1e-6)


def test_intervals_stay_where_figures_can_be() -> None:
    assert mean_interval([0.0, 0.0, 0.1, 5.0]).low == 0
    assert mean_interval([0.0, -0.1, 0.1, 5.0]).low < 0
    assert mean_interval([99.9, 100.0, 98.0], most=100).high == 100


def test_runs_without_a_figure_and_samples_without_spread() -> None:
    assert mean_interval([np.nan, 2.0, 4.0, np.nan]).runs == 2
    one, none, same = mean_interval([3.0]), mean_interval([np.nan]), mean_interval(np.full(9, 2.5))
    assert one.estimate == 3 and np.isnan(one.low) and one.runs == 1
    assert np.isnan(none.estimate) and none.runs == 0
    assert same.low == same.high == same.estimate == 2.5
    infinite, huge = mean_interval([1.0, 2.0, np.inf]), mean_interval([1e200, 3e200, 1e300])
    assert infinite.estimate == np.inf and np.isnan(infinite.high)
    assert huge.low == 0 and 4e299 < huge.high < 1e302
    assert means.p_value(np.full(4, 2.0), 2.0) == 1 and means.p_value(np.full(4, 2.0), 1.0) == 0


LAWS = ("normal", "Student's t(3)", "chi-square of 3", "chi-square of 1", "lognormal, 0.25", "lognormal, 0.5")


@pytest.mark.parametrize(("law", "runs"), taking_turns([(law,) for law in LAWS], [10, 20, 100]))
def test_intervals_hold_the_mean_in_95_percent_within_2(law: str, runs: int) -> None:
    """3000 campaigns: within 2 points of 95 %, and two sigma of the binomial law."""
    assert abs(coverage_of_a_mean(law, runs, 3000) - 0.95) < 0.02 + 2 * math.sqrt(0.95 * 0.05 / 3000)
