"""Interpolation against SciPy's polynomials, closed-form orbits, and its order of convergence."""

import numpy as np
import pytest
from orbit_files import circular
from scipy.interpolate import BarycentricInterpolator, KroghInterpolator

from relnav_sim.recorded.interpolation import Interpolation


def test_lagrange_is_scipys_polynomial_through_the_same_rows() -> None:
    times = np.array([0.0, 55.0, 130.0, 180.0, 246.0, 300.0])
    states = circular(times)
    at = np.array([140.0, 150.0, 179.0])
    expected = BarycentricInterpolator(times, states)(at)
    found = Interpolation("LAGRANGE", 5).states(times, states, at)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def test_hermite_is_scipys_polynomial_and_its_derivative() -> None:
    times = np.array([0.0, 55.0, 130.0, 180.0])
    states = circular(times)
    at = np.array([60.0, 100.0, 129.0])
    stacked = np.empty((8, 3))
    stacked[::2], stacked[1::2] = states[:, :3], states[:, 3:]
    polynomial = KroghInterpolator(np.repeat(times, 2), stacked)
    found = Interpolation("HERMITE", 7).states(times, states, at)
    np.testing.assert_allclose(found[:, :3], polynomial(at), rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[:, 3:], polynomial.derivative(at), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "method", [Interpolation("LAGRANGE", 5), Interpolation("HERMITE", 7), Interpolation("LINEAR", 1)]
)
def test_rows_are_met_to_the_bit(method: Interpolation) -> None:
    times = np.arange(0.0, 900.0, 60.0)
    states = circular(times)
    assert np.array_equal(method.states(times, states, times), states)


@pytest.mark.parametrize(
    ("method", "steps_s"),
    [
        (Interpolation("LINEAR", 1), (60.0, 30.0)),
        (Interpolation("LAGRANGE", 3), (120.0, 60.0)),
        (Interpolation("LAGRANGE", 7), (240.0, 120.0)),
        (Interpolation("HERMITE", 3), (120.0, 60.0)),
        (Interpolation("HERMITE", 7), (480.0, 240.0)),
    ],
)
def test_error_falls_with_the_power_of_the_degree(method: Interpolation, steps_s: tuple[float, float]) -> None:
    def error(step: float) -> float:
        times = np.arange(-20, 21) * step
        at = np.linspace(-2 * step, 2 * step, 41)
        return float(np.abs(method.states(times, circular(times), at) - circular(at))[:, :3].max())

    order = np.log2(error(steps_s[0]) / error(steps_s[1]))
    assert order == pytest.approx(method.degree + 1, abs=0.25)


def test_even_degrees_of_hermite_take_one_row_more() -> None:
    assert [Interpolation("HERMITE", degree).rows for degree in (3, 4, 5, 6, 7)] == [2, 3, 3, 4, 4]


def test_accelerations_are_those_of_the_orbit() -> None:
    times = np.arange(0.0, 1200.0, 60.0)
    at = np.array([5.0, 333.0, 600.0, 1100.0])
    states = circular(at)
    n_squared = np.sum(states[:, 3:] ** 2, axis=1) / np.sum(states[:, :3] ** 2, axis=1)
    found = Interpolation("HERMITE", 7).accelerations(times, circular(times), at)
    # At the ends the rows lie to one side: the seventh derivative of v n^8 h^7, times at most 1.
    np.testing.assert_allclose(found, -n_squared[:, None] * states[:, :3], rtol=0, atol=1e-8)


def test_error_at_withheld_rows_bounds_that_between_rows() -> None:
    times = np.arange(0.0, 3600.0, 120.0)
    states = circular(times)
    between = np.arange(600.0, 3000.0, 7.0)
    for method in (Interpolation("LAGRANGE", 5), Interpolation("HERMITE", 5)):
        position, velocity = method.error(times, states)
        actual = method.states(times, states, between) - circular(between)
        for found, told in ((actual[:, :3], position), (actual[:, 3:], velocity)):
            largest = np.linalg.norm(found, axis=1).max()
            assert largest < told < 40 * largest


def test_too_few_rows_tell_no_error() -> None:
    times = np.arange(0.0, 240.0, 60.0)
    assert np.isnan(Interpolation("LAGRANGE", 3).error(times, circular(times))).all()
