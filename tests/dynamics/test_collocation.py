import numpy as np
import pytest

from relnav_sim.dynamics.collocation import gauss_rule, integrate, rule_for


def test_two_nodes_are_hammer_and_hollingsworths_method():
    root = np.sqrt(3)
    A = np.array([[1 / 4, 1 / 4 - root / 6], [1 / 4 + root / 6, 1 / 4]])
    rule = gauss_rule(2, 1)
    np.testing.assert_allclose(rule.inner, A @ A, atol=1e-15)
    np.testing.assert_allclose(rule.velocity, [0.5, 0.5])
    np.testing.assert_allclose(rule.position, [0.5, 0.5] @ A, atol=1e-15)


@pytest.mark.parametrize("turn", [1e-4, 1e-3, 0.03, 0.1, 0.5])
def test_growth_and_oscillation_to_rounding_error(turn):
    rate = np.array([turn**2, -(turn**2)])[:, None]
    r, v = np.array([[1.0], [1.0]]), np.array([[turn], [turn]])
    path = integrate(rule_for(turn), lambda nodes: rate * nodes, r, v, 1.0)
    expected = np.array([[np.exp(turn)], [np.cos(turn) + np.sin(turn)]])
    slope = turn * np.array([[np.exp(turn)], [np.cos(turn) - np.sin(turn)]])
    np.testing.assert_allclose(path.position, expected, rtol=4e-16)
    np.testing.assert_allclose(path.velocity, slope, rtol=1e-15)
