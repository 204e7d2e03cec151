"""The test of forgery on papers of normal logarithms, of which the power of the best tests is known."""

import numpy as np
import pytest
from scipy.stats import beta, betabinom, binom, norm

from relnav_sim.arrays import Array
from replication.inverse.checks import power
from replication.inverse.consistency import columns_of
from replication.inverse.forgery import ForgeryTest
from replication.inverse.levels import Levels, apart
from replication.inverse.table import Number

NUMBERS = tuple(
    Number("table_1", column, f"row {row}", "m", digit=1e-6) for column in ("one", "two", "three") for row in range(3)
)
COLUMNS, ROWS, TAUGHT, HELD = 3, 3, 1500, 1000
COMMON, OWN, NOISE = 0.5, 0.3, 0.1
SLOPE = np.array([1.0, 2.0, 3.0])
"""A column of its own setting moves its rows by unlike amounts, so that ratios in the column tell of its level."""


def covariance() -> Array:
    """Return the covariance of the logarithms: a setting of all columns, one of each column, and noise."""
    every, own = np.ones((9, 9)), np.kron(np.eye(COLUMNS), np.outer(SLOPE, SLOPE))
    return COMMON**2 * every + OWN**2 * own + NOISE**2 * np.eye(9)


def least_deviation() -> float:
    """Return the standard deviation of a level given all that a factor leaves alone, that of generalised least squares.

    All columns have the same.
    """
    ones = np.repeat([1.0, 0.0, 0.0], ROWS)
    return float((ones @ np.linalg.solve(covariance(), ones)) ** -0.5)


@pytest.fixture(scope="module")
def papers() -> Array:
    logarithms = np.random.default_rng(4).multivariate_normal(np.zeros(9), covariance(), 2 * TAUGHT + HELD)
    return np.exp(logarithms)


def test_a_level_deviates_as_little_as_it_can(papers: Array) -> None:
    levels = Levels.learned(NUMBERS, papers[:TAUGHT], 1)
    unseen = papers[-HELD:]
    for half in (0, 1):
        spread = levels.deviations(unseen, half).std(axis=0)
        # the standard deviation of a sample has a relative error of 1 / sqrt(2 n); a network cannot be better
        assert spread.min() > least_deviation() * (1 - 4 / np.sqrt(2 * HELD))
        assert spread.max() < 1.15 * least_deviation()


def test_a_factor_leaves_alone_what_a_level_is_compared_with(papers: Array) -> None:
    places = columns_of(NUMBERS)["table_1 two"]
    moved = papers.copy()
    moved[:, places] *= 2
    level, rest = apart(NUMBERS, places, papers)
    level_then, rest_then = apart(NUMBERS, places, moved)
    np.testing.assert_allclose(level_then - level, np.log(2), atol=1e-4)
    np.testing.assert_allclose(rest_then, rest, atol=1e-4)


@pytest.mark.slow
def test_power_lies_between_that_of_bonferroni_and_of_neyman_and_pearson(papers: Array) -> None:
    """Given column and factor no test has more power; a test that knows the covariance alone has that of Bonferroni."""
    near, calibrating = papers[:TAUGHT], papers[TAUGHT : 2 * TAUGHT]
    found = power(ForgeryTest.learned(NUMBERS, near, calibrating, near[:0], 1), papers[-HELD:])
    # Given what calibrates, the rate of false alarms has a beta distribution (Vovk 2012).
    rare = int(0.05 * (TAUGHT + 1))
    alarms = betabinom(HELD, rare, TAUGHT + 1 - rare)
    assert alarms.ppf(0.001) <= round(found["false_alarm"] * HELD) <= alarms.ppf(0.999)
    rate = beta(rare, TAUGHT + 1 - rare).ppf(0.999)
    for row in found["columns"]:
        for factor, called in row["called_inconsistent"].items():
            off = abs(np.log(float(factor))) / least_deviation()
            best = norm.cdf(off - norm.ppf(1 - rate))
            limit = norm.ppf(1 - 0.05 / 2 / COLUMNS)
            fair = norm.cdf(off - limit) + norm.cdf(-off - limit)
            assert round(called * HELD) <= binom.ppf(0.999, HELD, best)
            assert called > fair - 0.1
