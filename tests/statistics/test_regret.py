"""Regret: the numbers by hand, its intervals against a plain bootstrap and by coverage, and the decision."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from relnav_sim.report.regret import in_sentences
from relnav_sim.statistics import simultaneous_regret as module
from relnav_sim.statistics.bootstrap import drawn_counts
from relnav_sim.statistics.regret import Regret
from relnav_sim.statistics.simultaneous_regret import simultaneous_regret


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(module, "RESAMPLES", 1000)


def test_two_filters_against_a_plain_bootstrap(few):
    """One difference: log ratio of the means, its delta-method error, the critical value from a loop over resamples."""
    rng = np.random.default_rng(3)
    x = rng.gamma(4, 1, (2, 14)) * [[1.0], [1.3]]
    regret, low, high = (part[0] for part in simultaneous_regret(x[None]))

    def ratio_and_error(a, b):
        y = a / a.mean() - b / b.mean()
        return np.log(a.mean() / b.mean()), np.sqrt(np.square(y).sum()) / len(y)

    d, error = ratio_and_error(x[1], x[0])
    t = []
    for (counts,) in (np.split(one, 1) for one in np.concatenate(list(drawn_counts(14, 1000, 0)))[:, None]):
        rows = np.repeat(np.arange(14), counts.ravel().astype(int))
        there, its = ratio_and_error(x[1, rows], x[0, rows])
        t.append(abs(there - d) / its)
    half = np.sort(t)[949] * error
    np.testing.assert_allclose(regret, [0, x[1].mean() / x[0].mean() - 1])
    np.testing.assert_allclose([low[1], high[1]], [max(0, np.expm1(d - half)), np.expm1(d + half)], rtol=1e-9)
    np.testing.assert_allclose([low[0], high[0]], [0, max(0, np.expm1(half - d))], rtol=1e-9, atol=1e-12)


def test_certainties(few):
    rng = np.random.default_rng(4)
    common = rng.gamma(9, 1, 20)
    x = np.stack([common, common, 5 * common * rng.uniform(0.9, 1.1, 20)])[None]
    regret, low, high = (part[0] for part in simultaneous_regret(x))
    assert regret[:2].tolist() == low[:2].tolist() == high[:2].tolist() == [0, 0]  # the same runs, the same errors
    assert low[2] > 3 and high[2] < 5
    nearly = np.stack([common, common * (1 + 1e-9 * rng.standard_normal(20))])[None]
    _, _, high = simultaneous_regret(nearly)
    assert 0 < high.max() < 1e-8  # nothing cancels where two filters nearly agree


def test_failed_runs(few):
    rng = np.random.default_rng(5)
    x = rng.gamma(9, 1, (4, 3, 12))
    x[1, 2, 5] = np.inf  # one filter fails in one run
    x[2, :, 3] = np.inf  # every filter fails in one run, as without a first fix
    x[3, [0, 1, 2], [0, 1, 2]] = np.inf  # none completes all runs
    regret, low, high = simultaneous_regret(x)
    assert regret[1, 2] == low[1, 2] == high[1, 2] == np.inf and np.isfinite(high[1, :2]).all()
    kept = np.delete(x[2], 3, axis=1).mean(axis=1)
    np.testing.assert_allclose(regret[2], kept / kept.min() - 1)
    assert np.isnan(regret[3]).all() and np.isnan(low[3]).all() and np.isnan(high[3]).all()
    lonely = np.full((1, 2, 6), np.inf)
    lonely[0, 0] = 1.0
    assert [part[0, 0] for part in simultaneous_regret(lonely)] == [0, 0, 0]


@pytest.mark.parametrize("runs", [1, 2])
def test_too_few_runs_have_no_upper_end(few, runs):
    regret, low, high = simultaneous_regret(np.random.default_rng(6).gamma(9, 1, (1, 3, runs)))
    assert np.isfinite(regret).all() and (low == 0).all() and np.isinf(high).all()


def coverage(trials, cases, filters, runs, spread, heavy=False):
    """Return in how many trials every interval of a table holds the true regret, half of the filters being the best."""
    rng = np.random.default_rng(7)
    mean = np.where(np.arange(filters) < (filters + 1) // 2, 1.0, 1.1)[:, None]
    held = 0
    for _ in range(trials):
        common = np.exp(rng.normal(0, 0.3, (cases, 1, runs)))
        own = rng.exponential(1, (cases, filters, runs)) if heavy else 1 + rng.normal(0, 1, (cases, filters, runs))
        _, low, high = simultaneous_regret(mean * common * np.abs(1 + spread * (own - 1)))
        true = (mean / mean.min() - 1).ravel()
        held += bool(((low <= true) & (true <= high)).all())
    return held


def test_all_intervals_hold_together(few):
    assert coverage(60, 2, 3, 15, 0.1) >= binom.ppf(1e-3, 60, 0.95)


@pytest.mark.slow
@pytest.mark.parametrize("table", [(1, 2, 10, 0.1), (3, 5, 20, 0.2), (4, 8, 40, 0.1), (3, 4, 60, 0.3, True)])
def test_all_intervals_hold_together_in_larger_tables(table, monkeypatch):
    monkeypatch.setattr(module, "RESAMPLES", 4000)
    assert coverage(300, *table) >= binom.ppf(1e-3, 300, 0.95)


def made(regret, low=None, high=None, **more):
    """Return a `Regret` of filters a, b, c in three cases."""
    regret = np.array(regret, dtype=float)
    low, high = (regret * f if part is None else np.array(part, float) for part, f in ((low, 0.9), (high, 1.1)))
    none = np.zeros(regret.shape, dtype=np.int64)
    given = {"failed": none, "diverged": none, "left_out": np.zeros(3, dtype=np.int64)} | more
    return Regret(
        ("a", "b", "c")[: len(regret)], ("nominal", "field", "bias"), (0, 1, 2), 1 + regret, regret, low, high,
        runs=np.arange(20), component="r", span="settled", **given,
    )  # fmt: skip


def test_the_nominal_winner_that_loses_is_named_beside_the_minimax_filter():
    found = made([[0, 1.0, 0.1], [0.1, 0.2, 0.0], [0.5, 0.0, 0.9]])
    assert (found.nominal_winner, found.minimax, found.undecided) == ("a", "b", ())
    assert [one.estimate for one in found.worst] == [1.0, 0.2, 0.9] and found.worst_case("c") == "bias"
    first, second = in_sentences(found)
    assert first == (
        "a has the smallest position RMS in the nominal case and loses under field: regret 100 % [90.0, 110] against c."
    )
    assert second == (
        "The minimax filter is b: its worst regret is 20 % [18.0, 22.0] (field), that of a 100 % [90.0, 110]. "
        "In the nominal case it costs 10 % [9.00, 11.0]."
    )


def test_a_winner_that_does_not_lose_and_one_that_is_not_told_apart():
    (first, second) = in_sentences(
        made([[0, 0.1, 0.1], [0.3, 0.1, 0.0], [0.5, 0.0, 0.9]], high=[[0, 0.4, 0.1], [0.3, 0.1, 0], [0.5, 0, 0.9]])
    )
    assert first.startswith(
        "a has the smallest position RMS in the nominal case and is the minimax filter: its worst regret"
    )
    assert second == "No significant difference from a in worst regret: b."
    tied = made(
        [[0, 0.30, 0], [0.01, 0.25, 0], [0.5, 0, 0]],
        [[0, 0.2, 0], [0, 0.2, 0], [0.4, 0, 0]],
        [[0.1, 0.4, 0], [0.1, 0.4, 0], [0.6, 0, 0]],
    )
    first, second = in_sentences(tied)[:2]
    assert "(no significant difference from b)" in first and "the difference is not significant" in second


def test_failures_and_cases_without_an_answer_are_said():
    inf, nan = math.inf, math.nan
    failed = np.array([[0, 2, 0], [0, 0, 0], [0, 0, 1]])
    sentences = in_sentences(
        made([[0, inf, nan], [0.1, 0, nan], [0.2, 0.3, nan]], failed=failed, left_out=np.array([0, 3, 0]))
    )
    assert (
        sentences[0]
        == "a has the smallest position RMS in the nominal case and fails under field, failed in 2 of 20 runs."
    )
    assert "that of a infinite" in sentences[1]
    assert "No filter completed every run under bias: no regret there, and none in the worst." in sentences
    assert "Every filter failed in 3 of 20 runs under field; these count for none." in sentences
    lost = made([[0, inf, 0], [inf, 0, 0]])
    assert lost.minimax is None and in_sentences(lost)[0].startswith("No filter has a finite worst regret")
    diverged = np.array([[0, 20, 0], [0, 20, 0], [0, 0, 0]])
    (said,) = (
        s
        for s in in_sentences(made([[0, 0, 0], [0.1, 0.1, 0.2], [0.2, 0.2, 0.2]], diverged=diverged))
        if "diverged" in s
    )
    assert said.startswith("Under field the best filter, a, counts as diverged in 20 of 20 runs")
