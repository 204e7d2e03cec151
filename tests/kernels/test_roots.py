"""Square roots of covariances: factors, triangular forms and the update from them, against NumPy."""

import numpy as np
import pytest
from checks import SIZES, assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels


@pytest.mark.parametrize(("n", "q", "runs"), SIZES)
def test_cholesky_factors_and_what_they_solve(n, q, runs):
    rng = np.random.default_rng(10)
    P, B = covariances(rng, runs, n), rng.normal(size=(runs, n, q))
    L, poor, count = kernels.roots.cholesky(P)
    assert_close(L, np.linalg.cholesky(P))
    assert not poor.any()
    assert count == 0
    assert_close(P @ kernels.roots.solve(P, B)[0], B, rtol=1e-10)
    assert_close(L @ kernels.roots.whiten(P, B)[0], B)
    np.testing.assert_array_equal(
        kernels.roots.solve(P, B[:1])[0], kernels.roots.solve(P, np.repeat(B[:1], runs, axis=0))[0]
    )


def test_a_matrix_as_good_as_singular_is_told():
    rng = np.random.default_rng(11)
    P = covariances(rng, 40, 3)
    P[5, 2], P[5, :, 2] = P[5, 1], P[5, :, 1]
    P[5, 2, 2] = P[5, 1, 1]
    P[6] = -np.eye(3)
    P[7] = 0.0
    for found in (kernels.roots.cholesky(P), kernels.roots.solve(P, P), kernels.roots.whiten(P, P)):
        assert np.flatnonzero(found[1]).tolist() == [5, 6, 7]
        assert found[2] == 3
        assert np.isfinite(np.delete(found[0], [5, 6, 7], axis=0)).all()


@pytest.mark.parametrize(("n", "q", "runs"), SIZES)
def test_triangular_form_is_that_of_qr(n, q, runs):
    rng = np.random.default_rng(12)
    A, B = rng.normal(size=(runs, n, n)), 1e-9 * rng.normal(size=(1, n, q))
    L = kernels.roots.triangular(A, B)
    M = np.concatenate([A, np.repeat(B, runs, axis=0)], axis=2)
    R = np.linalg.qr(M.swapaxes(1, 2))[1]
    expected = (R * np.sign(np.einsum("bii->bi", R))[:, :, None]).swapaxes(1, 2)
    # Both are backward stable; the condition number of M stands between them.
    np.testing.assert_allclose(L, expected, rtol=0, atol=1e-13 * np.linalg.cond(M).max() * n)
    assert_close(L @ L.swapaxes(1, 2), M @ M.swapaxes(1, 2))
    assert (np.triu(L, 1) == 0).all()
    assert (np.einsum("bii->bi", L) >= 0).all()


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_update_from_roots_is_the_kalman_update(n, m, runs):
    rng = np.random.default_rng(13)
    X, H = rng.normal(size=(runs, n, n + 2)), rng.normal(size=(runs, m, n))
    N = np.linalg.cholesky(covariances(rng, 1, m))
    nu, reading = rng.normal(size=(runs, m)), np.ones((runs, m))
    P, R = X @ X.swapaxes(1, 2), N @ N.swapaxes(1, 2)
    gain, root, L, white, nis, log_likelihood, dead, count = kernels.roots.update(X, H @ X, N, nu, reading)
    S = H @ P @ H.swapaxes(1, 2) + R
    K = np.linalg.solve(S, H @ P).swapaxes(1, 2)
    assert_close(L @ L.swapaxes(1, 2), S)
    assert_close(gain @ L.swapaxes(1, 2), P @ H.swapaxes(1, 2))
    assert_close(gain @ white[:, :, None], K @ nu[:, :, None], rtol=1e-10)
    assert_close(root @ root.swapaxes(1, 2), P - K @ S @ K.swapaxes(1, 2), rtol=1e-10)
    expected = np.einsum("bi,bi->b", nu, np.linalg.solve(S, nu[:, :, None])[:, :, 0])
    np.testing.assert_allclose(nis, expected, rtol=1e-10)
    np.testing.assert_allclose(
        log_likelihood, -0.5 * (expected + m * np.log(2 * np.pi) + np.linalg.slogdet(S)[1]), rtol=1e-10
    )
    assert not dead.any()
    assert count == 0


def test_update_from_roots_tells_a_channel_without_variance():
    rng = np.random.default_rng(14)
    X, H = rng.normal(size=(40, 3, 3)), rng.normal(size=(40, 2, 3))
    H[9] = 0.0
    dead, count = kernels.roots.update(X, H @ X, np.zeros((1, 2, 2)), np.ones((40, 2)), np.ones((40, 2)))[-2:]
    assert np.flatnonzero(dead).tolist() == [9]
    assert count == 1


def test_squares():
    rng = np.random.default_rng(17)
    W, a, U, b = (rng.normal(size=shape) for shape in ((40, 6, 6), (40, 6), (40, 3, 3), (40, 3)))
    images = np.concatenate([np.einsum("bij,bj->bi", W, a), np.einsum("bij,bj->bi", U, b)], axis=1)
    expected = np.square(images).sum(axis=1)
    np.testing.assert_allclose(kernels.roots.squares(W, a, U, b), expected, rtol=1e-12)
    check_runs_are_alone(kernels.roots.squares, (W, a, U, b))


def test_a_run_is_its_own():
    rng = np.random.default_rng(16)
    runs, n, m = 70, 6, 3
    P, B, Y = covariances(rng, runs, n), rng.normal(size=(runs, n, n)), rng.normal(size=(runs, m, n))
    check_runs_are_alone(kernels.roots.cholesky, (P,))
    check_runs_are_alone(kernels.roots.solve, (P, B))
    check_runs_are_alone(kernels.roots.whiten, (P, B))
    check_runs_are_alone(kernels.roots.triangular, (P, rng.normal(size=(runs, n, 3))))
    N, nu, reading = covariances(rng, runs, m), rng.normal(size=(runs, m)), np.ones((runs, m))
    check_runs_are_alone(lambda *given: kernels.roots.update(*given, reading[: len(given[0])]), (P, Y, N, nu))
