"""Ranges, their rates and derivatives, against NumPy."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels


def problem(points, n):
    return np.random.default_rng([points, n]).standard_normal((points, n)) * np.resize([900.0] * 3 + [0.5] * 3, n)


@pytest.mark.parametrize(("points", "n", "m"), [(1, 3, 1), (7, 6, 2), (33, 12, 2), (1000, 6, 2)])
def test_range_and_rate(points, n, m):
    states = problem(points, n)
    r, v = states[:, :3], states[:, 3:6]
    rho = np.linalg.norm(r, axis=1)
    u = r / rho[:, None]
    H = np.zeros((points, m, n))
    H[:, 0, :3] = u
    z = rho[:, None]
    if m == 2:
        rate = (r * v).sum(axis=1) / rho
        z = np.stack([rho, rate], axis=1)
        H[:, 1, :3] = (v - rate[:, None] * u) / rho[:, None]
        H[:, 1, 3:6] = u
    np.testing.assert_allclose(kernels.ranging.readings(states, m), z, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(kernels.ranging.jacobian(states, m), H, rtol=1e-12, atol=1e-17)
    if points > 1:
        check_runs_are_alone(kernels.ranging.readings, (states,), m)
        check_runs_are_alone(kernels.ranging.jacobian, (states,), m)


@pytest.mark.parametrize("shared", [True, False])
def test_noise_that_grows_with_the_range(shared):
    states = problem(9, 6)
    A = np.random.default_rng(1).standard_normal((1 if shared else 9, 3, 3))
    expected = np.broadcast_to(A, (9, 3, 3)).copy()
    expected[:, 0, 0] *= (1 + 2e-3 * np.linalg.norm(states[:, :3], axis=1)) ** 2
    np.testing.assert_allclose(kernels.ranging.grown(A, states, 2e-3), expected, rtol=1e-12)
    if not shared:
        check_runs_are_alone(kernels.ranging.grown, (A, states), 2e-3)
