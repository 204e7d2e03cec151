"""Paired comparison: the sign-flip test against all sign vectors, its interval against the test, families of pairs."""

import itertools
import math

import numpy as np
import pytest
from coverage_tables import wrong_verdicts
from scipy import stats

from relnav_sim.statistics.intervals import (
    fewest_runs_to_decide,
    mean_interval,
    paired_difference,
    paired_differences,
)
from relnav_sim.statistics.sign_flip import sign_flips


def test_paired_difference_sees_what_separate_intervals_hide() -> None:
    rng = np.random.default_rng(4)
    common = rng.gamma(2, 1, 60)
    a, b = common + rng.normal(0, 0.05, 60), common + 0.1 + rng.normal(0, 0.05, 60)
    assert mean_interval(a).high > mean_interval(b).low
    found = paired_difference(a, b)
    assert found.verdict == "better"
    assert found.difference.low < -0.1 < found.difference.high
    assert paired_difference(b, a).verdict == "worse"
    assert paired_difference(a, b, smaller_is_better=False).verdict == "worse"
    assert paired_difference(a, a).verdict == "undecided"
    assert paired_difference(a, a).runs_to_decide is None
    assert paired_difference(a[:1], b[:1]).verdict == "undecided"
    hole = a.copy()
    hole[:10] = np.nan
    assert paired_difference(hole, b).difference.runs == 50
    with pytest.raises(ValueError, match="same runs"):
        paired_difference(a, b[1:])


def test_runs_to_decide_do_decide() -> None:
    """At the number of runs it names, a difference of that size is told apart about 8 times of 10."""
    rng = np.random.default_rng(5)
    runs = paired_difference(*_standardised(rng, 0.3)).runs_to_decide
    assert runs == np.ceil(((stats.norm.ppf(0.975) + stats.norm.ppf(0.8)) / 0.3) ** 2)
    told = sum(paired_difference(rng.normal(0.3, 1, runs), np.zeros(runs)).verdict == "worse" for _ in range(200))
    assert abs(told / 200 - 0.8) < 4.5 * np.sqrt(0.8 * 0.2 / 200)


def _standardised(rng: np.random.Generator, mean: float) -> tuple[np.ndarray, np.ndarray]:
    x = rng.standard_normal(50)
    return (x - x.mean()) / x.std(ddof=1) + mean, np.zeros(50)


@pytest.mark.parametrize("runs", [2, 6, 9, 13])
def test_p_values_against_all_sign_vectors(runs: int) -> None:
    """Whole numbers too, with many ties and with differences that are zero."""
    rng = np.random.default_rng(runs)
    samples = np.stack([rng.standard_t(3, runs) + 0.5, rng.integers(-2, 4, runs).astype(float), rng.chisquare(1, runs)])
    for sample, found in zip(samples, sign_flips(samples, 0.95), strict=True):
        theirs = stats.permutation_test(
            (sample,), lambda x, axis: x.mean(axis=axis), permutation_type="samples", n_resamples=np.inf
        )
        assert found.p_value == theirs.pvalue


def test_differences_that_cancel_are_ties_however_they_are_rounded() -> None:
    tenths = np.array([0.1, 0.2, -0.3, 0.4, 0.5, -0.6, 0.7, 0.8])
    (found,), (whole,) = sign_flips(tenths[None], 0.95), sign_flips(np.round(10 * tenths)[None], 0.95)
    assert found.p_value == whole.p_value


def test_the_share_of_rejections_over_all_sign_vectors_is_exact() -> None:
    """Of the 2^8 equally likely samples of these sizes, those with a p-value up to 0.05 are no more than 0.05."""
    sizes = np.random.default_rng(0).lognormal(0, 2, 8)
    samples = sizes * np.array(list(itertools.product([-1.0, 1.0], repeat=8)))
    p = np.array([found.p_value for found in sign_flips(samples, 0.95)])
    for level in (0.01, 0.05, 0.2):
        assert level - 2 / 256 < (p <= level).mean() <= level


def test_a_subgroup_of_flips_is_as_exact() -> None:
    """Of 800 random sign vectors of 40 runs of very different size, 5 % within 3.5 sigma have a p-value up to 0.05."""
    rng = np.random.default_rng(5)
    samples = rng.lognormal(0, 2, 40) * rng.choice([-1.0, 1.0], (800, 40))
    share = np.mean([found.p_value <= 0.05 for found in sign_flips(samples, 0.95)])
    assert abs(share - 0.05) < 3.5 * math.sqrt(0.05 * 0.95 / 800)


@pytest.mark.parametrize("runs", [1, 2, 5, 6, 9, 12, 16, 40])
def test_zero_lies_in_the_interval_exactly_where_the_verdict_is_undecided(runs: int) -> None:
    rng = np.random.default_rng(runs)
    for trial in range(60):
        level = (0.95, 0.8, 0.99)[trial % 3]
        family = {n: rng.standard_t(3, runs) + rng.choice([0.0, 0.4, 1.0]) for n in range(1 + trial % 5)}
        for found in paired_differences(family, level).values():
            zero_outside = found.difference.low > 0 or found.difference.high < 0
            assert zero_outside == (found.verdict != "undecided") == (found.p_value <= 1 - level)
            assert runs >= 2 or found.p_value == 1


@pytest.mark.parametrize("runs", [7, 12, 30])
def test_the_interval_is_what_the_test_does_not_reject(runs: int) -> None:
    sample = np.random.default_rng(runs).standard_t(3, runs)
    found = paired_difference(sample, np.zeros(runs)).difference
    for end, inward in ((found.low, 1e-9), (found.high, -1e-9)):
        inside, outside = (paired_difference(sample, np.full(runs, end + by)).p_value for by in (inward, -inward))
        assert outside <= 0.05 < inside


def test_too_few_runs_decide_nothing() -> None:
    for runs, verdict in ((5, "undecided"), (6, "worse")):
        found = paired_difference(np.full(runs, 2.0), np.full(runs, 1.0))
        assert (found.verdict, found.p_value) == (verdict, 2.0 ** (1 - runs))
        assert np.isnan(found.difference.low) == (runs == 5)
    assert [fewest_runs_to_decide(n * (n - 1) // 2) for n in (2, 3, 4, 5, 6, 7, 20)] == [6, 7, 8, 9, 10, 10, 13]
    few = paired_differences({n: np.arange(1.0, 10.0) for n in range(15)})
    assert {(found.verdict, found.runs_to_decide) for found in few.values()} == {("undecided", 10)}
    for runs in (2, 5, 6):  # though they never differ
        assert np.isnan(paired_difference(np.ones(runs), np.ones(runs)).difference.high) == (runs < 6)
    assert paired_difference(np.ones(6), np.ones(6)).difference.high == 0


def test_a_decided_pair_narrows_the_intervals_of_the_others() -> None:
    rng = np.random.default_rng(6)
    sample = rng.normal(size=30)
    family = paired_differences({"sure": np.arange(30.0) + 5, "a": sample, "b": sample + 0.01})
    assert family["a"].difference.level == pytest.approx(1 - 0.05 / 2)
    assert paired_difference(sample, np.zeros(30)).difference.level == pytest.approx(0.95)


def test_many_comparisons_have_p_values_fine_enough() -> None:
    sample = np.random.default_rng(0).normal(1.0, 0.3, 40)
    (found,) = sign_flips(sample[None], 0.95, family=3000)
    assert found.p_value <= 0.05 / 3000 and found.limits(1 - 0.05 / 3000)[0] > 0


def test_figures_beyond_all_numbers_decide_nothing() -> None:
    found = paired_difference(np.array([1.0, 2.0, np.inf, 3.0, 4.0, 5.0, 6.0]), np.zeros(7))
    assert found.verdict == "undecided" and found.p_value == 1 and found.runs_to_decide is None


@pytest.mark.slow
@pytest.mark.parametrize("runs", [10, 20, 100])
@pytest.mark.parametrize("law", ["normal", "Student's t(3)", "chi-square of 3", "chi-square of 1", "lognormal, 1"])
def test_no_more_than_5_percent_of_campaigns_have_a_wrong_verdict(law: str, runs: int) -> None:
    """Six filters that are alike; three sigma of the binomial law above 5 %."""
    campaigns = 1000 if runs == 10 else 300
    any_of_15, one = wrong_verdicts(law, runs, campaigns, seed=runs)
    most = 0.05 + 3 * math.sqrt(0.05 * 0.95 / campaigns)
    assert any_of_15 <= most and one <= most
