"""The ratio to the bound is of ensembles: a filter at the bound is at 1 however its runs scatter."""

import math

import numpy as np
import pytest
from coverage_tables import coverage_of_a_ratio
from taking_turns import taking_turns

from relnav_sim.statistics.bound_ratio import ratio_to_bound
from relnav_sim.statistics.intervals import mean_interval


def test_the_ratio_of_root_mean_squares_over_runs_and_epochs() -> None:
    r = np.array([[1.0, 7.0], [5.0, 5.0]])  # mean squares 25 and 25
    found = ratio_to_bound(r, np.array([3.0, 4.0]))
    assert found.estimate == pytest.approx(5 / math.sqrt(12.5))
    assert found.runs == 2 and found.low == pytest.approx(found.high) == pytest.approx(found.estimate)
    assert ratio_to_bound(np.array([[9.0, 1.0, 3.0]] * 3), np.array([np.nan, 1.0, 3.0])).estimate == pytest.approx(1.0)


def test_a_filter_at_the_bound_is_at_1_and_the_mean_of_its_rms_below() -> None:
    """One lasting error a run, |N(0, 1)| of the bound: the mean of each run's RMS is sqrt(2 / pi) = 0.80 of it."""
    error = np.abs(np.random.default_rng(0).standard_normal((4000, 1))) * np.ones(50)
    found = ratio_to_bound(error, np.ones(50))
    assert found.low < 1 < found.high and found.high - found.low < 0.06
    assert error.mean() == pytest.approx(math.sqrt(2 / math.pi), abs=0.03)


def test_the_interval_is_that_of_the_mean_square() -> None:
    r = np.random.default_rng(1).lognormal(0, 0.4, (15, 30))
    squares = mean_interval(np.square(r).mean(axis=1))
    found = ratio_to_bound(r, np.full(30, 0.5))
    assert (found.low, found.high) == pytest.approx((2 * math.sqrt(squares.low), 2 * math.sqrt(squares.high)))


@pytest.mark.parametrize("bound", [np.full(3, np.nan), np.zeros(3), np.empty(0)])
def test_without_a_bound_there_is_no_ratio(bound: np.ndarray) -> None:
    found = ratio_to_bound(np.ones((4, len(bound))), bound)
    assert np.isnan([found.estimate, found.low, found.high]).all()


def test_errors_that_grow_beyond_all_numbers() -> None:
    found = ratio_to_bound(np.array([[1e200], [1.0], [2.0]]), np.ones(1))
    assert found.estimate == np.inf and np.isnan(found.low)


@pytest.mark.parametrize(("runs", "epochs"), taking_turns([(10,), (20,), (100,)], [1, 5, 50]))
def test_the_interval_holds_a_known_ratio(runs: int, epochs: int) -> None:
    """1000 campaigns: within 2 points of 95 %, and three sigma of the binomial law."""
    share, mean = coverage_of_a_ratio(epochs, runs, 1000)
    assert abs(share - 0.95) < 0.02 + 3 * math.sqrt(0.95 * 0.05 / 1000)
    assert mean == pytest.approx(2, rel=0.06 / math.sqrt(runs / 10))
