"""Intervals against SciPy, published values, and their own promise of coverage."""

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics import bootstrap, intervals
from relnav_sim.statistics.intervals import (
    bootstrap_interval,
    chi_square_band,
    effective_samples,
    lag1_band,
    wilson_interval,
)

STATISTICS = {
    "mean": np.mean,
    "median": np.median,
    "rms": lambda x, axis: np.sqrt(np.mean(np.square(x), axis=axis)),
    "std": lambda x, axis: np.std(x, axis=axis, ddof=1),
}


@pytest.mark.parametrize("size", [2, 7, 8, 100])
@pytest.mark.parametrize("method", ["bca", "percentile"])
@pytest.mark.parametrize("statistic", STATISTICS)
@pytest.mark.filterwarnings("ignore::scipy.stats.DegenerateDataWarning", "ignore::RuntimeWarning")
def test_against_scipy_with_the_same_resamples(statistic: str, method: str, size: int) -> None:
    sample = np.random.default_rng(size).lognormal(1, 1, size)
    ours = bootstrap_interval(sample, statistic, 0.9, method, 2000, seed=3)
    theirs = stats.bootstrap(
        (sample,), STATISTICS[statistic], n_resamples=2000, confidence_level=0.9, method=method,
        rng=np.random.default_rng(3), vectorized=True,
    ).confidence_interval  # fmt: skip
    assert ours.estimate == pytest.approx(STATISTICS[statistic](sample, axis=0), rel=1e-14)
    if np.isfinite([theirs.low, theirs.high]).all():
        assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-10)
    else:
        assert np.isfinite([ours.low, ours.high]).all() and size == 2


@pytest.mark.parametrize("size", [2, 3, 6, 7])
@pytest.mark.parametrize("statistic", STATISTICS)
def test_leaving_out_each_run(statistic: str, size: int) -> None:
    if statistic == "std" and size == 2:
        return
    sample = np.random.default_rng(0).standard_normal(size)
    slow = [STATISTICS[statistic](np.delete(sample, i), axis=0) for i in range(size)]
    np.testing.assert_allclose(np.sort(bootstrap.without_each(sample, statistic)), np.sort(slow), rtol=1e-12)


def test_resamples_do_not_depend_on_the_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    sample = np.random.default_rng(0).standard_normal(33)
    whole = bootstrap_interval(sample, seed=8)
    monkeypatch.setattr(bootstrap, "_PIECE", 33 * 7)
    bootstrap._counts.cache_clear()
    assert bootstrap_interval(sample, seed=8) == whole
    assert bootstrap_interval(sample, seed=9) != whole


def test_coverage_of_the_bootstrap() -> None:
    """Of 400 intervals at 90 % some 88 % (n = 40, skewed) or more must hold the truth, less 4.5 sigma of the count."""
    rng = np.random.default_rng(1)
    hits = 0
    for trial in range(400):
        interval = bootstrap_interval(rng.exponential(size=40), level=0.9, resamples=500, seed=trial)
        hits += interval.low <= 1 <= interval.high
    assert hits / 400 > 0.88 - 4.5 * np.sqrt(0.88 * 0.12 / 400)


def test_runs_without_a_figure_and_samples_without_spread() -> None:
    assert bootstrap_interval([np.nan, 2.0, 4.0, np.nan]).runs == 2
    one = bootstrap_interval([3.0])
    assert one.estimate == 3 and np.isnan(one.low) and one.runs == 1
    none = bootstrap_interval([np.nan])
    assert np.isnan(none.estimate) and none.runs == 0
    for statistic in STATISTICS:
        same = bootstrap_interval(np.full(9, 2.5), statistic)
        assert same.low == same.high == same.estimate
    infinite = bootstrap_interval([1.0, 2.0, np.inf])
    assert infinite.estimate == np.inf and not infinite.high < np.inf


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Newcombe 1998, Statistics in Medicine 17, table I, method 3
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_against_published_values(successes: int, trials: int, low: float, high: float) -> None:
    found = wilson_interval(successes, trials)
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)
    assert found.estimate == successes / trials
    mirrored = wilson_interval(trials - successes, trials)
    assert (1 - mirrored.high, 1 - mirrored.low) == pytest.approx((found.low, found.high), abs=1e-15)


def test_wilson_against_scipy_and_at_the_ends() -> None:
    for successes in range(12):
        found = wilson_interval(successes, 11, 0.9)
        theirs = stats.binomtest(successes, 11).proportion_ci(0.9, "wilson")
        assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
    nothing = wilson_interval(0, 0)
    assert (nothing.low, nothing.high) == (0, 1) and np.isnan(nothing.estimate)
    with pytest.raises(ValueError, match="3 of 2"):
        wilson_interval(3, 2)


def test_chi_square_bands() -> None:
    band = chi_square_band(50, 6)  # Bar-Shalom et al. 2001, section 5.4.2, scaled by n
    assert (band.low, band.high) == pytest.approx((0.846, 1.166), abs=5e-4)
    nis = chi_square_band(50, 3, normalised=False)
    assert (nis.low, nis.high) == pytest.approx(tuple(stats.chi2.ppf([0.025, 0.975], 150) / 50))
    longer = chi_square_band(50, 6, effective_samples=20)
    assert 1 - band.low > 1 - longer.low > 0 and longer.high < band.high
    assert effective_samples(6000, 60) == 50 and effective_samples(10, 60) == 1
    assert lag1_band(10_000).high == pytest.approx(0.0196, abs=1e-5)
    with pytest.raises(ValueError, match="at least one"):
        chi_square_band(0, 6)


@pytest.mark.parametrize("size", [16, 17, 100])
@pytest.mark.parametrize("statistic", STATISTICS)
def test_counted_resamples_give_the_figures_of_the_resamples_themselves(statistic: str, size: int) -> None:
    sample = np.random.default_rng(size).lognormal(1, 1, size)
    slow = bootstrap._one_by_one(sample, statistic, 300, 7)
    np.testing.assert_allclose(bootstrap.replicates(sample, statistic, 300, 7), slow, rtol=1e-12)


@pytest.mark.parametrize("size", [1, 5, 6, 7, 60, 61])
def test_the_median_and_its_exact_interval(size: int) -> None:
    values = np.random.default_rng(size).permutation(np.arange(1.0, size + 1))
    found = intervals.median_interval(values)
    assert found.estimate == np.median(values) and found.runs == size
    if size < 6:
        assert np.isnan([found.low, found.high]).all()
        return
    theirs = stats.quantile_test(values, p=0.5).confidence_interval(0.95)
    assert (found.low, found.high) == (theirs.low, theirs.high)


def test_the_median_of_times_that_are_never_reached() -> None:
    found = intervals.median_interval([3.0, np.inf, 5.0, np.inf, np.inf, np.inf, np.inf, np.inf])
    assert found.estimate == np.inf and found.low == 3 and found.high == np.inf
    assert np.isnan(intervals.median_interval([]).estimate)
