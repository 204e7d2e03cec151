import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim.tuning.objective import (
    PENALTY,
    Figures,
    band_of,
    mean_distance_log,
    mean_log,
    mean_square_log,
    objective,
)


def figures(position, anees=None, failed=None):
    position = np.asarray(position, dtype=float)
    anees = np.ones_like(position) if anees is None else np.asarray(anees, dtype=float)
    failed = np.zeros(position.shape, dtype=bool) if failed is None else np.asarray(failed)
    return Figures(position, position / 100, anees, failed)


def test_values_by_hand():
    given = figures([[1, 3], [20, 40]], anees=[[1, 3], [0.5, 0.5]])
    assert objective(given, "position", 1).value == pytest.approx(np.log(2 * 30) / 2)
    assert objective(given, "velocity", 1).value == pytest.approx(np.log(0.02 * 0.30) / 2)
    consistency = (np.log(2) ** 2 + np.log(0.5) ** 2) / 2
    assert objective(given, "consistency", 1).value == pytest.approx(consistency)
    assert objective(given, "both", 0.25).value == pytest.approx(np.log(2 * 30) / 2 + 0.25 * consistency)


def test_no_case_dominates():
    one, other = [[1.0, 1.2], [50.0, 60.0]], [[1.1, 1.32], [50.0, 60.0]]
    scaled = [[1.0, 1.2], [55.0, 66.0]]
    base = objective(figures(one), "position", 1).value
    assert objective(figures(other), "position", 1).value - base == pytest.approx(np.log(1.1) / 2)
    assert objective(figures(scaled), "position", 1).value - base == pytest.approx(np.log(1.1) / 2)


@pytest.mark.parametrize("score", [mean_log, mean_square_log])
def test_shares_of_the_runs_have_the_value_as_mean_and_its_sampling_error(score):
    rng = np.random.default_rng(1)
    x = rng.gamma(20, 0.1, (3, 400))
    found = score(x)
    assert found.per_run.mean() == pytest.approx(found.value)
    # The delta method's standard error against the jackknife's, which are equal to first order in 1/runs.
    without = np.array([score(np.delete(x, run, axis=1)).value for run in range(400)])
    jackknife = np.sqrt(399 / 400 * np.square(without - without.mean()).sum())
    assert found.per_run.std(ddof=1) / np.sqrt(400) == pytest.approx(jackknife, rel=0.02)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_run_without_a_figure_is_infinitely_bad(bad):
    assert objective(figures([[1, bad]]), "position", 1).value == np.inf
    assert objective(figures([[1, 2]], failed=[[False, True]]), "both", 1).value == np.inf


def test_in_a_band_it_is_the_position_and_outside_the_distance_is_added():
    inside = figures([[1, 3], [20, 40]], anees=[[1.0, 1.1], [0.9, 0.95]])
    position = objective(inside, "position", 1)
    found = objective(inside, "in_band", 1, (0.9, 1.1))
    assert found.feasible and found.value == position.value
    np.testing.assert_array_equal(found.per_run, position.per_run)
    outside = figures([[1, 3], [20, 40]], anees=[[1.0, 3.0], [0.4, 0.5]])
    found = objective(outside, "in_band", 1, (0.9, 1.1))
    assert not found.feasible
    assert found.value == pytest.approx(position.value + PENALTY * (np.log(2 / 1.1) + np.log(0.9 / 0.45)) / 2)


def test_the_default_band_is_that_of_as_many_errors_as_runs():
    assert band_of(figures(np.ones((1, 20))), None) == pytest.approx(tuple(chi2.ppf([0.025, 0.975], 120) / 120))


def test_shares_of_the_distance_have_its_sampling_error():
    x = np.random.default_rng(2).gamma(20, 0.1, (3, 400))
    found = mean_distance_log(x, (0.8, 1.5))
    without = np.array([mean_distance_log(np.delete(x, run, axis=1), (0.8, 1.5)).value for run in range(400)])
    jackknife = np.sqrt(399 / 400 * np.square(without - without.mean()).sum())
    assert found.per_run.mean() == pytest.approx(found.value) and found.value > 0
    assert found.per_run.std(ddof=1) / np.sqrt(400) == pytest.approx(jackknife, rel=0.02)
