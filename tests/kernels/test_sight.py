"""The sight kernels against a transcription of their formulas in NumPy."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix

MOUNTINGS = [NADIR_FROM_RTN, mounting_matrix(30.0, -20.0, 75.0) @ NADIR_FROM_RTN]
P = np.array([[3.0, 1.0, 0.5], [1.0, 2.0, -0.4], [0.5, -0.4, 4.0]]) * 1e-6
VARIANCES = np.array([16.0, 1e-6, 2e-6])


def problem(runs, n):
    rng = np.random.default_rng([runs, n])
    states = rng.standard_normal((runs, n)) * 1000
    return states, rng.standard_normal((runs, 3)) * np.array([1000.0, 3.0, 1.5])


def angles(states, M):
    x, y, z = M @ states[:3]
    return np.array([np.sqrt(x * x + y * y + z * z), np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))])


def derivatives(states, M):
    x, y, z = M @ states[:3]
    p, q = np.hypot(x, y), np.sqrt(x * x + y * y + z * z)
    by_sight = [[x / q, y / q, z / q], [-y / p**2, x / p**2, 0], [z * x / p / q**2, z * y / p / q**2, -p / q**2]]
    return np.hstack([by_sight @ M, np.zeros((3, len(states) - 3))])


def noise(states, M):
    s = M @ states[:3]
    turn = np.array([[0, -s[2], s[1]], [s[2], 0, -s[0]], [-s[1], s[0], 0]])  # dtheta moves s to s + s x dtheta
    G = (derivatives(s, np.eye(3)) @ turn)[1:]
    R = np.diag(VARIANCES)
    R[1:, 1:] += G @ P @ G.T
    return R


@pytest.mark.parametrize("M", MOUNTINGS, ids=["straight", "turned"])
@pytest.mark.parametrize(("runs", "n"), [(1, 3), (7, 6), (33, 12), (1000, 6)])
def test_points_derivatives_and_noise(runs, n, M):
    states, z = problem(runs, n)
    h = np.array([angles(state, M) for state in states])
    H = np.array([derivatives(state, M) for state in states])
    R = np.array([noise(state, M) for state in states])
    np.testing.assert_allclose(kernels.sight.spherical(states, M), h, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(kernels.sight.jacobian(states, M), H, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(kernels.sight.noise(states, M, P, VARIANCES), R, rtol=1e-12, atol=1e-17)
    turns = np.array([0.0, 2 * np.pi, 2 * np.pi])
    residual = np.where(turns > 0, np.angle(np.exp(1j * (z - h))), z - h)
    nu, jacobian, covariance = kernels.sight.linearised(z, states, M, P, VARIANCES)
    np.testing.assert_allclose(nu, residual, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(jacobian, kernels.sight.jacobian(states, M))
    np.testing.assert_array_equal(covariance, kernels.sight.noise(states, M, P, VARIANCES))


def test_without_attitude_error_all_runs_share_the_noise():
    states, z = problem(5, 6)
    R = kernels.sight.linearised(z, states, MOUNTINGS[0], np.zeros((3, 3)), VARIANCES)[2]
    np.testing.assert_array_equal(R, np.diag(VARIANCES)[None])


@pytest.mark.parametrize("M", MOUNTINGS, ids=["straight", "turned"])
def test_bits_of_a_run_do_not_depend_on_the_block(M):
    states, z = problem(100, 6)
    whole = kernels.sight.linearised(z, states, M, P, VARIANCES)
    states_and_noise = kernels.sight.spherical(states, M), kernels.sight.noise(states, M, P, VARIANCES)
    for first, last in [(0, 1), (31, 33), (50, 83), (99, 100)]:
        own, read = states[first:last].copy(), z[first:last].copy()
        for part, alone in zip(whole, kernels.sight.linearised(read, own, M, P, VARIANCES), strict=True):
            np.testing.assert_array_equal(part[first:last], alone)
        np.testing.assert_array_equal(states_and_noise[0][first:last], kernels.sight.spherical(own, M))
        np.testing.assert_array_equal(states_and_noise[1][first:last], kernels.sight.noise(own, M, P, VARIANCES))


def test_a_lost_run_stays_alone():
    states, z = problem(40, 6)
    broken = states.copy()
    broken[7, 1], broken[20, 0] = np.nan, np.inf
    others = np.delete(np.arange(40), [7, 20])
    for part, sound in zip(
        kernels.sight.linearised(z, broken, MOUNTINGS[1], P, VARIANCES),
        kernels.sight.linearised(z, states, MOUNTINGS[1], P, VARIANCES),
        strict=True,
    ):
        np.testing.assert_array_equal(part[others], sound[others])
        assert np.isnan(part[7]).any()


def test_the_sign_of_a_zero_decides_the_side_of_pi():
    behind = np.array([[0.0, -1000.0, 0.0], [0.0, -1000.0, -0.0]])
    azimuth = kernels.sight.spherical(behind, NADIR_FROM_RTN)[:, 1]
    np.testing.assert_array_equal(azimuth, [-np.pi, np.pi])  # y = -z_RTN


def radar_samples(mounting, spread):
    rng = np.random.default_rng(11)
    runs, N = 5, 700
    M = mounting_matrix(*mounting) @ NADIR_FROM_RTN
    centre = rng.standard_normal((runs, 6)) * 10 + [100.0, 3000.0, -400.0, 0, 0, 0]
    root, e = rng.standard_normal((runs, 6, 3)) * spread, rng.standard_normal((runs, 3, N))
    z = kernels.sight.spherical(centre, M) + np.array([3.0, 2e-3, -1e-3])
    W = np.tril(rng.standard_normal((runs, 3, 3))) * [1.0, 500.0, 800.0]
    return z, W, centre, root, e, M


@pytest.mark.parametrize("spread", [10.0, 3000.0], ids=["ahead", "all around"])
@pytest.mark.parametrize("mounting", [(0, 0, 0), (180, 0, 0), (40, -20, 10)], ids=str)
def test_squared_errors_of_a_radar(mounting, spread):
    z, W, centre, root, e, M = radar_samples(mounting, spread)
    found = kernels.sight.squared_errors(z, W, centre, root, e, M)
    for run in range(len(z)):
        states = (centre[run][:, None] + root[run] @ e[run]).T
        x, y, h = M @ states[:, :3].T
        reading = np.array([np.sqrt(x * x + y * y + h * h), np.arctan2(y, x), np.arctan2(-h, np.hypot(x, y))])
        residual = z[run][:, None] - reading
        residual[1:] = np.angle(np.exp(1j * residual[1:]))
        np.testing.assert_allclose(found[run], np.square(W[run] @ residual).sum(axis=0), rtol=1e-9, atol=1e-9)


def test_squared_errors_of_a_run_are_its_own():
    *given, M = radar_samples((40, -20, 10), 3000.0)
    check_runs_are_alone(lambda *given: kernels.sight.squared_errors(*given, M), given)
