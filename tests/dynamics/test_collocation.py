import numpy as np
import pytest

from relnav_sim.dynamics.collocation import gauss_rule, rule_for
from relnav_sim.kernels import collocation


def test_two_nodes_are_hammer_and_hollingsworths_method():
    root = np.sqrt(3)
    A = np.array([[1 / 4, 1 / 4 - root / 6], [1 / 4 + root / 6, 1 / 4]])
    rule = gauss_rule(2, 1)
    np.testing.assert_allclose(rule.inner, A @ A, atol=1e-15)
    np.testing.assert_allclose(rule.velocity, [0.5, 0.5])
    np.testing.assert_allclose(rule.position, [0.5, 0.5] @ A, atol=1e-15)


@pytest.mark.parametrize("turn", [1e-4, 1e-3, 0.03, 0.1, 0.5])
def test_growth_and_oscillation_to_rounding_error(turn):
    rule = rule_for(turn)
    s = len(rule.nodes)
    rate = np.array([turn**2, -(turn**2)])
    r, v, nodes, f = np.ones((1, 2)), np.full((1, 2), turn), np.empty((s, 1, 2)), np.empty((s, 1, 2))
    for sweep in range(rule.sweeps):
        collocation.place_nodes(rule.tableau, 1.0, r, v, f, sweep, 2, nodes)
        f[:] = rate * nodes
    collocation.finish(rule.tableau, 1.0, f, 2, r, v, nodes)
    expected = np.array([[np.exp(turn), np.cos(turn) + np.sin(turn)]])
    slope = turn * np.array([[np.exp(turn), np.cos(turn) - np.sin(turn)]])
    np.testing.assert_allclose(r, expected, rtol=4e-16)
    np.testing.assert_allclose(v, slope, rtol=1e-15)
