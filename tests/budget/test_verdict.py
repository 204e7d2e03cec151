"""The verdict beside a Monte Carlo: what a linear filter scatters passes, what it can't be does not."""

import numpy as np
import pytest

from relnav_sim.budget import Budget
from relnav_sim.budget.verdict import verdict

TIMES = np.arange(11.0)


def budget(variance=4.0):
    total = np.full((11, 6), variance / 3)
    means = np.zeros((1, 11, 6))
    return Budget("ekf", ("one",), total[None], means, total, total, TIMES, (), np.ones(1), ("sigma",), ())


@pytest.mark.parametrize("freedom", [1, 3, 100])
def test_a_linear_filter_passes_but_for_one_time_in_a_thousand(freedom):
    """At 1 % of the trials at most: Student's interval of skew numbers keeps its level only roughly."""
    rng = np.random.default_rng(3)
    squares = 4.0 * rng.chisquare(freedom, (2000, 100)) / freedom
    wrong = sum(not verdict(budget(), one, 5.0).agrees for one in squares)
    assert wrong <= 20


def test_a_few_runs_far_off_are_no_linear_filter():
    squares = np.full(100, 3.5)
    squares[:3] = 4000.0  # the interval of the mean goes down to zero
    found = verdict(budget(), squares, 5.0)
    assert found.interval[0] == 0 and not found.agrees


def test_a_small_difference_is_seen_where_runs_scatter_little():
    rng = np.random.default_rng(3)
    squares = 1.1 * 4.0 * rng.chisquare(200, 100) / 200
    found = verdict(budget(), squares, 5.0)
    assert found.band[0] < found.ratio < found.band[1] and not found.agrees


def test_a_failed_run_is_no_linear_filter_and_few_runs_say_nothing():
    squares = np.full(40, 4.0)
    squares[3] = np.nan
    assert not verdict(budget(), squares, 5.0).agrees
    assert verdict(budget(), squares[:9], 5.0) is None
