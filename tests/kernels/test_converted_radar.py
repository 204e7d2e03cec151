"""Covariances of converted positions against the moments of their own axes, turned as matrices."""

import numpy as np
import pytest
from checks import check_runs_are_alone, cross_matrix

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix
from relnav_sim.astro.tangent_plane import across

M = mounting_matrix(30.0, -20.0, 75.0) @ NADIR_FROM_RTN
P = np.array([[3.0, 1.0, 0.5], [1.0, 2.0, -0.4], [0.5, -0.4, 4.0]]) * 1e-6
SIZES = [(1, 3, 1), (7, 6, 2), (33, 12, 3), (1000, 6, 1)]


def attitude_map():
    """(6, 6), by putting in every product of two components alone."""
    places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    columns = []
    for i, j in places:
        S = np.zeros((3, 3))
        S[i, j] = S[j, i] = 1.0
        turns = [cross_matrix(axis) for axis in np.eye(3)]
        square = sum(S[k, o] * turns[k] @ P @ turns[o].T for k in range(3) for o in range(3) if S[k, o])
        columns.append([square[row, column] for row, column in places])
    return np.array(columns).T.copy()


def problem(runs, n, k, width):
    rng = np.random.default_rng([runs, n, k])
    return rng.standard_normal((runs, n)) * 1000, rng.uniform(0.5, 1.5, (k, width)) * 1e-6


def converted(state, c):
    x, y, z = M @ state[:3]
    p2 = x * x + y * y
    q2 = p2 + z * z
    w = c[0] + c[1] / q2 + c[2] * q2 / p2 + c[3] / p2
    u, v = c[4] + c[5] / q2, c[6] + c[7] / q2
    d, e = c[8] * p2 + c[9] * p2 / q2 + c[10] * q2 + c[11], c[12] * q2 + c[13]
    own = np.array([[w * x * x + d, w * x * y, u * x * z], [0, w * y * y + d, u * y * z], [0, 0, v * z * z + e]])
    return M.T @ (np.triu(own) + np.triu(own, 1).T) @ M + cross_matrix(state[:3]) @ P @ cross_matrix(state[:3]).T


def tangent(state, c):
    r = state[:3]
    q2 = r @ r
    a, b = (M.T @ np.array(axis) for axis in across(tuple(M @ r / np.sqrt(q2))))
    square = (
        np.outer(r, r) * (c[0] + c[1] / q2) + np.outer(a, a) * (c[2] * q2 + c[3]) + np.outer(b, b) * (c[4] * q2 + c[5])
    )
    return square + cross_matrix(r) @ P @ cross_matrix(r).T


@pytest.mark.parametrize(
    ("kernel", "one", "width"),
    [
        (lambda *a: kernels.converted_radar.covariances(*a), converted, 14),
        (lambda *a: kernels.converted_radar.tangent_covariances(*a), tangent, 6),
    ],
    ids=["converted", "tangent"],
)
@pytest.mark.parametrize(("runs", "n", "k"), SIZES)
def test_covariances(kernel, one, width, runs, n, k):
    states, coefficients = problem(runs, n, k, width)
    R = kernel(states, M, coefficients, attitude_map())
    expected = np.array([[one(state, c) for c in coefficients] for state in states])
    np.testing.assert_allclose(R, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(R, R.swapaxes(-1, -2))
    if runs > 1:
        check_runs_are_alone(kernel, (states,), M, coefficients, attitude_map())
