from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from relnav_sim.arrays import Array
from replication.inverse.bank import settings
from replication.inverse.checks import coverage, power, power_by_kind
from replication.inverse.claims import Quantity, judged, roughly_met, wilson
from replication.inverse.consistency import Consistency
from replication.inverse.forgery import ForgeryTest
from replication.inverse.inference import Inference, features, interval
from replication.inverse.local import MOVED, neighbours
from replication.inverse.prior import dividing_choices, kinds
from replication.inverse.scatter import column_scatter, power_if_known

SEED, BANK, PAPERS = 5, 4000, 300


@pytest.fixture
def flown(linear: Any) -> tuple[Array, Array]:
    u = settings(linear, SEED, 0, BANK + PAPERS)
    return u, linear.flown(u, [[SEED, n, 1] for n in range(len(u))], 1)[:, 0]


def test_intervals_contain_known_settings_and_are_as_narrow_as_can_be(linear: Any, flown: tuple[Array, Array]) -> None:
    u, numbers = flown
    inference = Inference.learned(linear, u[:BANK], numbers[:BANK], SEED)
    found = coverage(linear, inference, u[BANK:], numbers[BANK:])
    assert found["passed"]
    assert binom.cdf(found["unknowns"][0]["contained"], PAPERS, 0.9) < 0.999  # nor are they too wide
    # a has four readings with noise of 0.1: the 90 % interval is 2 * 1.645 * 0.05 wide, of a prior that is 1 wide.
    assert found["unknowns"][0]["width"] == pytest.approx(2 * 1.645 * 0.05, rel=0.25)
    draws = inference.posterior(features(linear, linear.printed[None])[0])
    low, high = interval(draws, 0.9)
    assert low[0] < 0.53 < high[0]  # three numbers of 0.5 and one of 0.7


@pytest.mark.slow
def test_a_forged_column_is_inconsistent_and_honest_ones_are_not(linear: Any, flown: tuple[Array, Array]) -> None:
    u, numbers = flown
    test = ForgeryTest.learned(linear.numbers, numbers[:450], numbers[450:600], numbers[600:1200], SEED)
    found = power(test, numbers[BANK:])
    assert found["false_alarm"] <= binom.ppf(0.999, PAPERS, 0.05) / PAPERS
    by_column = {row["column"]: row["called_inconsistent"] for row in found["columns"]}
    assert by_column["table_1 one"]["3"] > 0.8  # the other column has a as well
    assert by_column["table_1 one"]["1.25"] < by_column["table_1 one"]["3"]
    shifted = dividing_choices(linear.unknowns, u[BANK:])
    assert list(shifted) == ["of both: plain", "of both: shifted"]
    kinds_found = power_by_kind(test, numbers[BANK:], shifted)
    assert sum(row["papers"] for row in kinds_found) == PAPERS
    whole = np.mean([row["3"] for row in by_column.values()])
    parts = [row["papers"] / PAPERS * row["called_inconsistent"]["3"] for row in kinds_found]
    assert sum(parts) == pytest.approx(whole)


def test_neighbours_have_some_settings_between_those_of_two_papers(linear: Any) -> None:
    """Moves of 0.5 (a - b) have a variance of 0.5 var, and a third of the settings, nearly, make them."""
    same = np.tile([0.2, 0.4, 0.6], (50, 1))
    unmoved = neighbours(linear, same, 130, SEED)
    assert np.abs(unmoved - [3.2, 3.2, 3.2, 3.4, 3.4, 3.2]).max() < 5 * 0.1
    np.testing.assert_array_equal(unmoved, neighbours(linear, same, 130, SEED))
    apart = np.where(np.arange(100)[:, None] % 2 == 0, [0.4, 0.4, 0.1], [0.6, 0.6, 0.1])
    found = neighbours(linear, apart, 3000, SEED)
    # half of the moves are 0, the others +-0.1: between 0.3 and 0.7, and with the noise of 0.1
    means = found[:, :3].mean(axis=1)
    own = 0.1**2 + MOVED * 0.5 * 0.1**2 + 0.1**2 / 3
    assert means.var() == pytest.approx(own, rel=4 * np.sqrt(2 / 3000))


def test_the_scatter_of_a_column_is_that_of_its_mean_size(linear: Any) -> None:
    """Three sizes of 3.5 with independent noise of 0.1."""
    linear.numbers = tuple(replace(number, signed=False) for number in linear.numbers)
    scatter = column_scatter(linear, np.tile([0.5, 0.5, 0.75], (200, 1)), SEED)["table_1 one"]
    # 20 runs of 200 settings: the relative error of the spread is 1 / sqrt(2 * 19 * 200)
    relative = 1 / np.sqrt(2 * 19 * 200)
    assert np.sqrt(np.mean(scatter**2)) == pytest.approx(0.1 / 3.5 / np.sqrt(3), rel=4 * relative)


def test_the_power_of_a_test_that_knows_the_setting_is_that_of_a_normal_level() -> None:
    """A limit of 2.24 for two columns; a factor of exp(0.224) is as far with a spread of 0.1."""
    found = power_if_known({"one": np.array([0.1]), "two": np.array([0.1, 1e-3])}, (float(np.exp(0.2241)), 1.0), 0.05)
    (beyond, none), (other, none_of_two) = found["one"].values(), found["two"].values()
    assert beyond == pytest.approx(0.5, abs=0.001)
    assert other == pytest.approx((1 + 0.5) / 2, abs=0.001)
    assert none == pytest.approx(0.025)
    assert none_of_two == pytest.approx(0.025)


def test_a_column_that_does_not_go_with_the_other_is_improbable(linear: Any, flown: tuple[Array, Array]) -> None:
    u, numbers = flown
    kind = kinds(linear.unknowns, u)
    np.testing.assert_array_equal(kind, u[:, 2] >= 0.5)
    consistency = Consistency.learned(linear.numbers, features(linear, numbers[:BANK]), kind[:BANK], SEED)
    honest = consistency.p_values(features(linear, numbers[BANK:]))
    assert binom.ppf(0.001, PAPERS, 0.05) <= (honest[:, 0] <= 0.05).sum() <= binom.ppf(0.999, PAPERS, 0.05)
    moved = numbers[BANK:].copy()
    moved[:, 5] += 3.0  # thirty standard deviations from the three numbers of the other column
    assert (consistency.p_values(features(linear, moved))[:, 1] <= 0.05).mean() > 0.9


def test_a_claims_condition_is_found(linear: Any) -> None:
    u = settings(linear, SEED, 0, 4000)
    told = [Quantity("first", "m", 10 * u[:, 0]), Quantity("kind", "", np.floor(2 * u[:, 2]), ("plain", "shifted"))]
    met = np.stack([u[:, 1] > 0.5, u[:, 0] < 0.5], axis=1)
    found = judged(u[:, 0] > 0.8, told, linear.numbers[:2], met)
    assert found["probability"] == pytest.approx(0.2, abs=4 * np.sqrt(0.16 / 4000))
    low, high = found["settings"][0]["interval"]
    assert 8 <= low < 8.3
    assert high > 9.7  # the lower or the upper tail of a twentieth is left out, or both
    assert found["settings"][0]["name"] == "first"
    assert not found["choices"]
    assert len(found["conflicts"]) == 1
    assert "row 1" in found["conflicts"][0]
    none = judged(np.zeros(4000, dtype=bool), told, linear.numbers[:2], met)
    assert none["probability"] == 0
    assert none["interval"][1] == pytest.approx(3.84 / 4003.84, rel=1e-3)  # z^2 / (n + z^2)


def test_shares_have_wilsons_interval() -> None:
    assert wilson(10, 100) == pytest.approx((0.0552, 0.1744), abs=1e-4)  # Brown, Cai and DasGupta 2001
    assert wilson(0, 0) == (0, 1)


def test_numbers_are_met_within_a_factor_of_two(linear: Any) -> None:
    printed = np.array([1.0, 1.0, -1.0, 0.0, 0.001, -0.001])
    found = np.array([[1.9, 2.1, 1.0, 0.002, -0.001, -0.01]])
    assert roughly_met(found, printed, linear.numbers).tolist() == [[True, False, False, True, True, False]]
