"""The steps of the two-step filter's search, against the same in NumPy."""

import numpy as np
import pytest
from checks import SIZES, assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_the_steps_of_the_searches(n, m, runs):
    rng = np.random.default_rng(15)
    D, G, H = (rng.normal(size=(runs, m, n)) for _ in range(3))
    K = 0.1 * rng.normal(size=(runs, n, m))
    P, V = covariances(rng, runs, n), covariances(rng, runs, m)
    W, U = np.linalg.inv(np.linalg.cholesky(P)), np.linalg.inv(np.linalg.cholesky(V))
    d, x, residual = rng.normal(size=(runs, n)), rng.normal(size=(runs, n)), rng.normal(size=(runs, m))

    def squared(A, v):
        return np.square((A @ v[:, :, None])[:, :, 0]).sum(axis=1)

    both, cost = kernels.two_step.misfit(G, K, x, d, residual, W, U)
    q = (G @ (x - d)[:, :, None])[:, :, 0] - residual
    t = d - x - (K @ q[:, :, None])[:, :, 0]
    assert_close(both, np.concatenate([t, q], axis=1))
    np.testing.assert_allclose(cost, squared(W, t) + squared(U, q), rtol=1e-10)

    T = np.eye(m) - D @ K
    tolerance = 1e-12 * max(1.0, np.linalg.cond(T).max()) ** 2
    E, EP, S = kernels.two_step.linearise(D, K, P, V)
    assert_close(T @ E, D, rtol=tolerance)
    assert_close(EP, E @ P)
    assert_close(S, E @ P @ E.swapaxes(1, 2) + V)

    # The step solves the normal equations of |W (t + move)|^2 + |U (q + E move)|^2 in the coordinates of t.
    steps, length = kernels.two_step.step(D, K, P, V, both, W, U)
    at = np.linalg.inv(P) + E.swapaxes(1, 2) @ np.linalg.inv(V) @ E
    slope = np.linalg.solve(P, t[:, :, None]) + E.swapaxes(1, 2) @ np.linalg.solve(V, q[:, :, None])
    move = -np.linalg.solve(at, slope)
    np.testing.assert_allclose(steps, (move + K @ E @ move)[:, :, 0], rtol=1e-5, atol=1e-6 * np.abs(move).max())
    np.testing.assert_allclose(length, squared(W, move[:, :, 0]) + squared(U, (E @ move)[:, :, 0]), rtol=1e-5)

    B, scatter = kernels.two_step.turned(D, K, H, V)
    assert_close(T.swapaxes(1, 2) @ B, H, rtol=tolerance)
    assert_close(scatter, T @ V @ T.swapaxes(1, 2))


def test_a_run_is_its_own():
    rng = np.random.default_rng(16)
    runs, n, m = 70, 6, 3
    D, P, V = rng.normal(size=(runs, m, n)), covariances(rng, runs, n), covariances(rng, runs, m)
    K, both = 0.1 * rng.normal(size=(runs, n, m)), rng.normal(size=(runs, n + m))
    x, d, beyond = rng.normal(size=(runs, n)), rng.normal(size=(runs, n)), rng.normal(size=(runs, m))
    check_runs_are_alone(kernels.two_step.misfit, (D, K, x, d, beyond, P, V))
    check_runs_are_alone(kernels.two_step.step, (D, K, P, V, both, P, V))
    check_runs_are_alone(kernels.two_step.linearise, (D, K, P, V))
    check_runs_are_alone(kernels.two_step.turned, (D, K, D, V))


def test_a_turn_that_is_singular_gives_no_numbers_and_stays_alone():
    rng = np.random.default_rng(18)
    D, K, P, V = rng.normal(size=(40, 3, 6)), 0.1 * rng.normal(size=(40, 6, 3)), covariances(rng, 40, 6), np.eye(3)
    sound = kernels.two_step.linearise(D, K, P, np.repeat(V[None], 40, axis=0))
    D[7], K[7] = np.eye(3, 6), np.eye(6, 3)  # I - D K = 0
    broken = kernels.two_step.linearise(D, K, P, np.repeat(V[None], 40, axis=0))
    for one, other in zip(broken, sound, strict=True):
        assert np.isnan(one[7]).all()
        np.testing.assert_array_equal(np.delete(one, 7, axis=0), np.delete(other, 7, axis=0))
