"""Effects with intervals against independent computations, and every verdict reached."""

import math

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.verdicts import (
    difference_of_means,
    difference_of_rates,
    fiellers_ratio,
    judged,
    mean_of_runs,
    ratio_of_means,
    ratio_of_medians,
    shared_level,
    together,
    verdict,
)


def interval(low, high):
    return Interval((low + high) / 2, low, high, 0.95, 10)


@pytest.mark.parametrize(
    ("low", "high", "outcome"),
    [(1.0, 2.0, "holds"), (0.5, 1.5, "open"), (0.1, 0.9, "fails"), (2.5, 4.0, "open"), (3.5, 4.0, "fails")],
)
def test_an_effect_is_judged_by_its_whole_interval(low, high, outcome):
    assert judged(interval(low, high), at_least=1.0, at_most=3.0) == outcome


def test_an_effect_without_an_interval_is_open():
    assert judged(Interval(5.0, math.nan, math.nan, 0.95, 1), at_least=1.0) == "open"


def test_the_weakest_part_decides():
    assert together(["holds", "holds"]) == "holds"
    assert together(["holds", "open"]) == "open"
    assert together(["holds", "open", "fails"]) == "fails"
    with pytest.raises(ValueError, match="nothing"):
        together([])


def test_every_verdict_is_reached():
    assert verdict(["holds", "holds"], ["fails"]) == "reproduced"
    assert verdict(["holds", "fails"]) == "reproduced only if"
    assert verdict(["fails"], ["open", "holds"]) == "reproduced only if"
    assert verdict(["fails"], ["open"]) == "not reproduced"
    assert verdict(["open"]) == "not reproduced"


def test_means_have_students_interval():
    values = np.random.default_rng(3).normal(2.0, 0.5, 12)
    low, high = stats.t.interval(0.9, 11, values.mean(), stats.sem(values))
    found = mean_of_runs([*values, math.nan], level=0.9)
    np.testing.assert_allclose((found.low, found.high), (low, high), rtol=1e-12)
    assert found.runs == 12
    paired = difference_of_means(values + 1.0, values)
    np.testing.assert_allclose((paired.low, paired.high), (1.0, 1.0), rtol=1e-12)


def test_the_ratio_of_means_covers_the_true_one():
    rng = np.random.default_rng(11)
    covered = 0
    for _ in range(1000):
        shared = rng.normal(0.0, 0.3, 20)
        b = 2.0 + shared + rng.normal(0.0, 0.1, 20)
        a = 1.0 + 0.5 * shared + rng.normal(0.0, 0.1, 20)
        found = ratio_of_means(a, b)
        covered += found.low <= 0.5 <= found.high
    # Binomial with 1000 trials at 0.95: 3.3 standard deviations.
    assert abs(covered - 950) < 3.3 * math.sqrt(1000 * 0.95 * 0.05)


def test_fiellers_ends_are_where_the_paired_test_stands_at_its_level():
    rng = np.random.default_rng(5)
    b = rng.exponential(1.0, 12)
    a = 0.4 * b + rng.exponential(0.3, 12)
    found = fiellers_ratio(a, b, level=0.9)
    for end in (found.low, found.high):
        assert stats.ttest_1samp(a - end * b, 0).pvalue == pytest.approx(0.1, rel=1e-9)
    assert found.low < found.estimate == a.mean() / b.mean() < found.high


def test_a_ratio_to_what_may_be_nought_has_no_upper_end():
    rng = np.random.default_rng(3)
    rare = np.where(np.arange(100) < 3, 0.005, 0.0)  # in 3 of 100 runs: Student's test does not tell it from zero
    often = np.where(rng.random(100) < 0.5, 0.012, 0.0)
    assert stats.ttest_1samp(rare, 0).pvalue > 0.05
    found = fiellers_ratio(often, rare)
    assert found.high == math.inf
    assert stats.ttest_1samp(often - found.low * rare, 0).pvalue == pytest.approx(0.05, rel=1e-9)
    assert judged(found, at_most=1.0) == "fails"  # as the paired test says, at p < 1e-6
    assert stats.ttest_1samp(often - rare, 0).pvalue < 1e-6
    assert judged(ratio_of_means(often, rare), at_most=1.0) == "open"
    unknown = fiellers_ratio(rare[::-1], rare)
    assert (unknown.low, unknown.high) == (-math.inf, math.inf)
    assert math.isnan(fiellers_ratio(often, np.zeros(100)).low)


def test_fiellers_interval_covers_the_true_ratio_whatever_the_denominator():
    """Exact for Gaussian figures: as often as 95 %, or oftener where it has no end, within 3.3 standard deviations."""
    rng = np.random.default_rng(11)
    least = 0.95 - 3.3 * math.sqrt(0.95 * 0.05 / 1000)
    for size in (0.3, 3.0):
        b = rng.normal(size, 1.0, (1000, 12))
        a = b + rng.normal(size, 0.5, (1000, 12))
        found = [fiellers_ratio(x, y) for x, y in zip(a, b, strict=True)]
        covered = np.mean([one.low <= 2.0 <= one.high for one in found])
        assert covered > least
        if size == 3.0:
            assert covered < 1.95 - least
        # Student's paired test of the true ratio, by SciPy.
        assert covered >= np.mean(stats.ttest_1samp(a - 2.0 * b, 0, axis=1).pvalue > 0.05)


def test_paired_runs_that_are_alike_have_a_ratio_without_spread():
    values = np.random.default_rng(0).uniform(1, 3, 9)
    found = ratio_of_means(0.7 * values, values)
    np.testing.assert_allclose((found.estimate, found.low, found.high), 0.7, rtol=1e-12)


def test_times_that_are_never_reached_make_an_infinite_ratio():
    never = np.full(20, math.inf)
    found = ratio_of_medians(never, np.linspace(1, 2, 20))
    assert found.estimate == found.low == found.high == math.inf
    assert judged(found, at_least=3.0) == "holds"
    assert judged(ratio_of_medians(never, never), at_least=3.0) == "open"


def test_the_ratio_of_medians_brackets_the_estimate():
    rng = np.random.default_rng(5)
    found = ratio_of_medians(rng.exponential(4.0, 200), rng.exponential(1.0, 200))
    assert found.low < found.estimate < found.high
    assert found.low < 4.0 < found.high


def test_the_difference_of_rates_is_newcombes():
    # Newcombe (1998), table II, first column: 56/70 and 48/80 give 0.0524 to 0.3339; equal denominators here:
    # the same formula by hand for 9/10 and 3/10.
    found = difference_of_rates(9, 3, 10)
    (l1, u1), (l2, u2) = (stats.binomtest(k, 10).proportion_ci(0.95, "wilson") for k in (9, 3))
    np.testing.assert_allclose(found.low, 0.6 - math.hypot(0.9 - l1, u2 - 0.3), rtol=1e-9)
    np.testing.assert_allclose(found.high, 0.6 + math.hypot(u1 - 0.9, 0.3 - l2), rtol=1e-9)


def test_alternatives_share_the_error():
    assert shared_level(5) == pytest.approx(0.99)
    assert shared_level(0) == pytest.approx(0.95)
