import numpy as np
import pytest

from relnav_sim.tuning.objective import Figures, mean_log, mean_square_log, objective


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
