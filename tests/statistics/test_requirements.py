"""Verdicts on requirements against counts and intervals worked out from the same numbers in another way."""

import math

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics.findings import on_a_mean, on_a_share
from relnav_sim.statistics.proportions import share_of_runs
from relnav_sim.statistics.requirements import overall


@pytest.mark.parametrize(("hits", "verdict"), [(60, "undecided"), (20, "fail"), (40, "undecided")])
def test_shares_at_95_percent(hits: int, verdict: str) -> None:
    found = on_a_share(share_of_runs(hits, 60), 0.95 if hits > 20 else 0.6, 0.95)
    interval = stats.binomtest(hits, 60).proportion_ci(0.95, "exact")
    limit = 0.95 if hits > 20 else 0.6
    expected = "pass" if interval.low >= limit else "fail" if interval.high < limit else "undecided"
    assert found.verdict == expected
    if hits != 40:
        assert found.verdict == verdict


def test_a_perfect_record_needs_72_runs_to_show_95_percent() -> None:
    limit = 0.95
    assert on_a_share(share_of_runs(72, 72), limit, 0.95).verdict == "pass"
    found = on_a_share(share_of_runs(71, 71), limit, 0.95)
    assert (found.verdict, found.runs_to_decide) == ("undecided", 72)
    assert found.certainty == pytest.approx(1 - limit**71)


def test_means_between_limits() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(1.0, 0.1, 40)
    assert on_a_mean(values, 0.81, 1.21, 0.95).verdict == "pass"
    assert on_a_mean(values, -math.inf, 0.9, 0.95).verdict == "fail"
    assert on_a_mean(values, 1.21, 1.5, 0.95).verdict == "fail"
    near = on_a_mean(values, -math.inf, float(values.mean()) + 0.01, 0.95)
    assert near.verdict == "undecided" and near.runs_to_decide > 40
    p = stats.ttest_1samp(values, values.mean() + 0.01, alternative="less").pvalue
    assert near.certainty == pytest.approx(1 - p, abs=0.03)
    assert on_a_mean(values, -math.inf, 2.0, 0.95).certainty > 0.999
    assert on_a_mean(values, -math.inf, 0.5, 0.95).certainty > 0.999
    assert on_a_mean(values[:1], -math.inf, 2.0, 0.95).verdict == "undecided"


def test_a_wrong_pass_is_as_rare_as_promised() -> None:
    """The mean lies exactly at the limit: at most 2.5 %, within 3 sigma of 600 trials, pass."""
    rng = np.random.default_rng(4)
    passes = sum(on_a_mean(rng.normal(1, 0.2, 15), -math.inf, 1.0, 0.95).verdict == "pass" for _ in range(600))
    assert passes / 600 < 0.025 + 3 * np.sqrt(0.025 * 0.975 / 600)


def test_all_must_pass() -> None:
    assert overall(["pass", "pass"]) == "pass"
    assert overall(["pass", "undecided"]) == "undecided"
    assert overall(["undecided", "fail", "pass"]) == "fail"
