"""The verdict on consistency, on a linear filter whose model is right and on covariances that are wrong by design."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.measurements.linear import LinearMeasurement
from relnav_sim.results import layout
from relnav_sim.statistics.consistency import normalised_errors
from relnav_sim.statistics.consistency_verdict import consistency_of, overconfident_parts
from relnav_sim.statistics.decision import Candidate
from relnav_sim.statistics.intervals import NO_INTERVAL, mean_interval

CAMPAIGNS, RUNS, EPOCHS = 150, 20, 40
F = np.block([[np.eye(3), 10 * np.eye(3)], [np.zeros((3, 3)), 0.95 * np.eye(3)]])
Q = np.diag(np.repeat([1e-2, 1e-4], 3))
R = np.eye(3)
P0 = np.diag(np.repeat([4.0, 1e-2], 3))


@pytest.fixture(scope="module")
def flown():
    """Errors (runs, epochs, 6) of a Kalman filter whose model is that of the truth, and its covariances."""
    rng = np.random.default_rng(7)
    runs = CAMPAIGNS * RUNS
    x = rng.normal(size=(runs, 6)) * np.sqrt(np.diag(P0))
    truth, z = np.empty((runs, EPOCHS, 6)), np.empty((runs, EPOCHS, 3))
    for k in range(EPOCHS):
        x = x @ F.T + rng.normal(size=(runs, 6)) * np.sqrt(np.diag(Q))
        truth[:, k], z[:, k] = x, x[:, :3] + rng.normal(size=(runs, 3))
    filter = create_filter("kf", LinearDynamics(F, Q), LinearMeasurement(np.eye(3, 6), R))
    history = run_filter(filter, z, np.zeros(6), P0)
    return history.mean - truth, history.covariance


def anees(flown, scale=(1.0, 1.0)):
    """ANEES of each run, (campaigns, runs, 3), where the formal sigmas of position and velocity are scaled."""
    error, covariance = flown
    D = np.diag(np.repeat(scale, 3))
    nees = normalised_errors(error, D @ covariance @ D)[0].mean(axis=-1) / [[6], [3], [3]]
    return nees.T.reshape(CAMPAIGNS, RUNS, 3)


def test_a_right_filter_is_called_wrong_no_oftener_than_by_chance(flown):
    found = [consistency_of(each).verdict for each in anees(flown)]
    wrong = sum(verdict in ("overconfident", "conservative") for verdict in found)
    assert wrong <= binom.ppf(0.999, CAMPAIGNS, 0.05)


def test_an_overconfident_position_is_found_behind_a_conservative_velocity(flown):
    """The position's sigma is too small by 1.25, the velocity's too large by as much or so: the whole is near 1."""
    campaigns = anees(flown, (1 / 1.25, 1.6))
    assert abs(campaigns[..., 0].mean() - 1) < 0.1
    found = [consistency_of(each) for each in campaigns]
    assert all((one.verdict, one.block) == ("overconfident", "position") for one in found)
    assert np.mean([one.factor for one in found]) == pytest.approx(1.25, rel=0.02)


def test_a_conservative_part_is_named_where_none_is_overconfident(flown):
    one = consistency_of(anees(flown, (1.0, 1.4))[0])
    assert (one.verdict, one.block) == ("conservative", "velocity")


def test_the_whole_state_stands_for_its_parts():
    runs = np.random.default_rng(2).normal(2.0, 0.1, (30, 1)) * [1.0, 1.02, 0.98]
    one = consistency_of(runs)
    assert (one.verdict, one.block) == ("overconfident", "full")
    assert one.factor == pytest.approx(np.sqrt(runs[:, 0].mean()))


def test_few_runs_and_none():
    few = np.array([0.1, 0.9, 2.2])[:, None] * np.ones(3)
    assert consistency_of(few).verdict == "may be consistent"
    assert consistency_of(np.full((4, 3), np.nan)) is None


def test_one_run_tells_nothing():
    assert consistency_of(np.full((1, 3), 1.02)).verdict == "may be consistent"
    assert consistency_of(np.full((1, 3), 9.0)).verdict == "may be consistent"


def test_a_conservative_part_hides_no_other_that_may_be_overconfident():
    """Four runs: a position of sigma 2 to 0.7 times too small, a velocity surely too large."""
    runs = np.array([[1.0, 4.0, 0.2], [0.9, 2.0, 0.21], [1.1, 6.0, 0.19], [1.0, 0.5, 0.2]])
    assert consistency_of(runs).verdict == "may be consistent"


def test_consistent_is_said_of_no_part_whose_interval_leaves_out_one():
    """Twelve runs whose sigma is 12 % too small: significant at 95 %, not for three looks."""
    runs = np.outer(1.25 + 0.335 * np.linspace(-1.6, 1.6, 12) / 0.99, np.ones(3))
    assert consistency_of(runs).verdict == "may be consistent"


@pytest.mark.parametrize(
    ("position", "velocity", "refused"),
    [
        (1.0, 1.0, (0.0, 0.0)),
        (1.35, 1.35, (0.0, 0.05)),
        (1.6, 1.4, (0.9, 1.0)),
        (1.4, 1.6, (0.9, 1.0)),
        (1.7, 1.7, (0.97, 1.0)),
    ],
)
def test_a_filter_is_refused_by_the_part_whose_sigma_is_known_to_be_too_small(flown, position, velocity, refused):
    """Limit 1.5, sigmas known by design; the whole state of the third and the fourth is at 1.5 alone in half of all."""
    campaigns = anees(flown, (1 / position, 1 / velocity))
    least, most = refused
    share = np.mean([bool(candidate(each).too_overconfident) for each in campaigns])
    assert least <= share <= most


def test_a_part_is_overconfident_whatever_the_others_are():
    """Position at twice its sigma; the others have no ANEES, or one of nought, with which there is no verdict."""
    position = 4 + 0.1 * np.random.default_rng(2).standard_normal(20)
    for whole, velocity in ((np.nan, np.nan), (1.3, 0.0)):
        runs = np.column_stack([np.full(20, whole), position, np.full(20, velocity)])
        assert consistency_of(runs) is None
        assert overconfident_parts(runs)[-1] == "position"
        assert candidate(runs).too_overconfident == ("position",)
        assert candidate(runs).most_overconfident == "position"


def candidate(runs):
    errors = {}
    for name, values in zip(layout.BLOCKS, runs.T, strict=True):
        one = mean_interval(values)
        errors[name] = replace(one, low=one.low**0.5, estimate=one.estimate**0.5, high=one.high**0.5)
    return Candidate("a", NO_INTERVAL, errors_over_sigma=errors, overconfident=overconfident_parts(runs))
