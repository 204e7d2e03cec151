"""Shares against SciPy's exact test and against simulated campaigns whose epochs hang together."""

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics.proportions import runs_for_share, share_of_epochs, share_of_runs


@pytest.mark.parametrize("runs", [1, 7, 60])
def test_shares_of_runs_against_scipy(runs: int) -> None:
    for successes in {0, 1, runs // 2, runs - 1, runs}:
        share = share_of_runs(successes, runs)
        found, test = share.interval(0.9), stats.binomtest(successes, runs)
        theirs = test.proportion_ci(0.9, "exact")
        assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
        greater = stats.binomtest(successes, runs, 0.8, alternative="greater").pvalue
        less = stats.binomtest(successes, runs, 0.8, alternative="less").pvalue
        assert 1 - share.certainty_at_least(0.8) == pytest.approx(greater, abs=1e-12)
        assert 1 - share.certainty_below(0.8) == pytest.approx(less, abs=1e-12)


def test_independent_epochs_count_nearly_in_full() -> None:
    hits = np.random.default_rng(0).binomial(200, 0.9, 400)
    share = share_of_epochs(hits, np.full(400, 200))
    assert share.estimate == hits.sum() / 80_000
    assert 0.75 * 80_000 < share.trials <= 80_000  # the spread over 400 runs is known to 7 % (2 sigma of the variance)


def test_epochs_that_all_go_together_count_once_a_run() -> None:
    hits = 200 * np.random.default_rng(1).binomial(1, 0.9, 400)
    share = share_of_epochs(hits, np.full(400, 200))
    assert share.trials == pytest.approx(400, rel=0.05)


def test_runs_of_unequal_length_against_the_ratio_estimate_by_jackknife() -> None:
    rng = np.random.default_rng(5)
    epochs = rng.integers(1, 300, 80)
    hits = rng.binomial(epochs, rng.beta(20, 2, 80))
    share = share_of_epochs(hits, epochs)
    left_out = (hits.sum() - hits) / (epochs.sum() - epochs)
    jackknife = 79 / 80 * np.square(left_out - left_out.mean()).sum()
    freedom = (stats.t.ppf(0.975, epochs.sum() - 1) / stats.t.ppf(0.975, 79)) ** 2
    expected = share.estimate * (1 - share.estimate) / jackknife * freedom
    assert share.trials == pytest.approx(expected, rel=0.1)  # the two estimates of the variance differ by 1 / runs


def test_intervals_of_correlated_epochs_keep_their_promise() -> None:
    """30 runs whose own shares scatter: at least 95 %, less 3 sigma of 600 trials, hold the truth; Wilson over epochs
    would hold it in a third."""
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(600):
        own = rng.beta(9, 1, 30)
        found = share_of_epochs(rng.binomial(100, own), np.full(30, 100)).interval()
        hits += found.low <= 0.9 <= found.high
    assert hits / 600 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 600)


def test_perfect_runs_prove_no_more_than_their_number_allows() -> None:
    share = share_of_epochs(np.full(100, 5000), np.full(100, 5000))
    found = share.interval()
    assert (found.estimate, found.high, found.runs) == (1, 1, 100)
    assert found.low == pytest.approx(0.025 ** (1 / 100))
    needed = runs_for_share(share, 0.997)
    assert needed == np.ceil(np.log(0.025) / np.log(0.997))
    assert share_of_epochs(np.full(needed, 10), np.full(needed, 10)).interval().low >= 0.997


def test_runs_that_would_decide() -> None:
    share = share_of_runs(57, 60)
    needed = runs_for_share(share, 0.9)
    assert share_of_runs(round(0.95 * needed), needed).interval().low == pytest.approx(0.9, abs=0.003)
    assert runs_for_share(share_of_runs(9, 10), 0.9) is None
    assert runs_for_share(share_of_runs(0, 10), 0.9) == 2  # none of 2: at most 0.84


def test_nothing_counted_says_nothing() -> None:
    for share in (share_of_runs(0, 0), share_of_epochs([], []), share_of_epochs([0, 0], [0, 0])):
        found = share.interval()
        assert np.isnan(found.estimate) and (found.low, found.high) == (0, 1)
        assert share.certainty_at_least(0.5) == share.certainty_below(0.5) == 0
        assert runs_for_share(share, 0.5) is None
    with pytest.raises(ValueError, match="no share"):
        share_of_runs(3, 2)
    with pytest.raises(ValueError, match="one number per run"):
        share_of_epochs([3], [2])
