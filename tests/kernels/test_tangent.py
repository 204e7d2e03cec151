"""Tangent angles against rotations by SciPy: how far, which way, and what a turn of the sensor adds to the noise.

Axes, gradients and what stands behind: tests/astro/test_tangent_plane.py.
"""

import numpy as np
import pytest
from checks import check_runs_are_alone
from scipy.spatial.transform import Rotation

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix
from relnav_sim.astro.tangent_plane import across

M = mounting_matrix(30.0, -20.0, 75.0) @ NADIR_FROM_RTN
P = np.array([[3.0, 1.0, 0.5], [1.0, 2.0, -0.4], [0.5, -0.4, 4.0]]) * 1e-6


def problem(runs, each, n):
    rng = np.random.default_rng([runs, each, n])
    centres = rng.standard_normal((runs, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    return rng.standard_normal((runs * each, n)) * 1000, centres


def angles(state, centre):
    """The rotation that takes the centre to the line of sight, as a vector across it."""
    s = M @ state[:3]
    axis = np.cross(centre, s)
    angle = np.arctan2(np.linalg.norm(axis), centre @ s)
    towards = np.cross(axis, centre)
    first, second = (np.array(each) for each in across(tuple(centre)))
    towards *= angle / np.linalg.norm(towards)
    turned = Rotation.from_rotvec(axis * angle / np.linalg.norm(axis)).apply(centre)
    np.testing.assert_allclose(turned, s / np.linalg.norm(s), atol=1e-12)
    return [first @ towards, second @ towards]


@pytest.mark.parametrize("ranged", [True, False])
@pytest.mark.parametrize(("runs", "each", "n"), [(1, 1, 3), (7, 5, 6), (33, 1, 12), (200, 5, 6)])
def test_readings(runs, each, n, ranged):
    positions, centres = problem(runs, each, n)
    expected = np.array(
        [angles(state, centre) for state, centre in zip(positions, centres.repeat(each, 0), strict=True)]
    )
    z = kernels.tangent.readings(positions, M, centres, ranged)
    np.testing.assert_allclose(z[:, -2:], expected, rtol=1e-12, atol=1e-13)
    if ranged:
        np.testing.assert_allclose(z[:, 0], np.linalg.norm(positions[:, :3], axis=1), rtol=1e-12)
    again, H = kernels.tangent.linearised(positions, M, centres, ranged)
    np.testing.assert_array_equal(z, again)
    assert H.shape == (*z.shape, n)
    if runs > 1 and each == 1:
        far = np.hstack([positions, centres])  # a run is a row
        check_runs_are_alone(lambda x: kernels.tangent.readings(*parted(x), ranged), (far,))
        check_runs_are_alone(lambda x: kernels.tangent.linearised(*parted(x), ranged), (far,))
        check_runs_are_alone(lambda x: kernels.tangent.by_turn(*parted(x)), (far,))


def test_without_a_reading_the_first_point_of_the_run_is_the_centre():
    positions, _ = problem(4, 5, 6)
    z = kernels.tangent.readings(positions, M, np.full((4, 3), np.nan), False).reshape(4, 5, 2)
    np.testing.assert_allclose(z[:, 0], 0, atol=1e-15)
    first = positions[::5, :3] @ M.T
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    np.testing.assert_allclose(
        z.reshape(-1, 2), kernels.tangent.readings(positions, M, first, False), rtol=1e-12, atol=1e-12
    )


def test_a_turn_of_the_sensor_adds_to_the_noise():
    positions, centres = problem(33, 1, 6)
    own = np.array([np.diag([4.0, 1e-6, 2e-6]), np.diag([9.0, 4e-6, 8e-6])])
    R = kernels.tangent.noise(positions, M, centres, P, own)
    for run, centre in enumerate(centres):
        G = np.array([np.cross(axis, centre) for axis in across(tuple(centre))])
        expected = own.copy()
        expected[:, 1:, 1:] += G @ P @ G.T
        np.testing.assert_allclose(R[run], expected, rtol=1e-12, atol=1e-18)
    far = np.hstack([positions, centres])
    check_runs_are_alone(lambda x: kernels.tangent.noise(*parted(x), P, own), (far,))


def parted(rows):
    return np.ascontiguousarray(rows[:, :-3]), M, np.ascontiguousarray(rows[:, -3:])
