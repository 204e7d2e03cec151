"""U D U^T and the root of the information, against NumPy."""

import numpy as np
import pytest
from checks import SIZES, assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels

EPS = float(np.finfo(float).eps)
NONE = np.zeros(0, dtype=np.int64)


def whole(U, D):
    return U * D[:, None, :] @ U.swapaxes(1, 2)


def inverse(L):
    return np.linalg.inv(L @ L.swapaxes(1, 2))


def given(n, m, runs):
    rng = np.random.default_rng(20)
    P, F, Q = covariances(rng, runs, n), np.eye(n) + 0.3 * rng.normal(size=(runs, n, n)), covariances(rng, runs, n)
    H, R, nu = rng.normal(size=(runs, m, n)), covariances(rng, runs, m), rng.normal(size=(runs, m))
    return rng.normal(size=(runs, n)), P, F, Q, nu, H, R


def plain_update(m, P, nu, H, R):
    S = H @ P @ H.swapaxes(1, 2) + R
    K = np.linalg.solve(S, H @ P).swapaxes(1, 2)
    nis = np.einsum("bi,bi->b", nu, np.linalg.solve(S, nu[:, :, None])[:, :, 0])
    log_likelihood = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * S)[1])
    return m + np.einsum("bij,bj->bi", K, nu), P - K @ H @ P, nis, log_likelihood


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_factors_are_unit_triangular_and_make_the_matrix(n, m, runs):
    P = given(n, m, runs)[1]
    U, D = kernels.ud.factor(P, EPS)
    assert_close(whole(U, D), P)
    assert (np.tril(U) == np.eye(n)).all()
    L, flat = kernels.srif.information(P, EPS)
    assert_close(L @ L.swapaxes(1, 2) @ P, np.broadcast_to(np.eye(n), P.shape), rtol=1e-11)
    assert (np.triu(L, 1) == 0).all() and len(flat) == 0
    assert_close(kernels.srif.covariance(L), P, rtol=1e-11)


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_prediction_and_update_are_those_of_covariances(n, m, runs):
    x, P, F, Q, nu, H, R = given(n, m, runs)
    U, D = kernels.ud.factor(P, EPS)
    L = kernels.srif.information(P, EPS)[0]
    predicted = F @ P @ F.swapaxes(1, 2) + Q
    for mean, found in (
        (lambda found: found[0], kernels.ud.predict(x, U, D, F, Q, EPS)),
        (lambda found: found[0], kernels.srif.predict(x, L, F, Q, EPS)),
    ):
        assert_close(mean(found), np.einsum("bij,bj->bi", F, x))
    assert_close(whole(*kernels.ud.predict(x, U, D, F, Q, EPS)[1:]), predicted)
    assert_close(inverse(kernels.srif.predict(x, L, F, Q, EPS)[1]), predicted, rtol=1e-9)
    mean, P, nis, log_likelihood = plain_update(x, P, nu, H, R)
    by_factors = kernels.ud.update(x, U, D, nu, H, R, NONE, EPS)
    assert by_factors[5] == 0
    by_information = kernels.srif.update(x, L, nu, H, R, EPS)
    for found, covariance in (
        ((by_factors[0], *by_factors[3:5]), whole(*by_factors[1:3])),
        ((by_information[0], *by_information[2:4]), inverse(by_information[1])),
    ):
        for array, expected in zip(found, (mean, nis, log_likelihood), strict=True):
            assert_close(array, expected, rtol=1e-10)
        assert_close(covariance, P, rtol=1e-10)
    by_joseph = kernels.joseph.update(x, given(n, m, runs)[1], nu, H, R, EPS)
    for array, expected in zip(by_joseph[:4], (mean, P, nis, log_likelihood), strict=True):
        assert_close(array, expected, rtol=1e-10)
    assert len(by_joseph[4]) == 0


def test_runs_are_alone():
    x, P, F, Q, nu, H, R = given(4, 2, 40)
    U, D = kernels.ud.factor(P, EPS)
    L = kernels.srif.information(P, EPS)[0]
    check_runs_are_alone(lambda *given: kernels.ud.factor(*given, EPS), (P,))
    check_runs_are_alone(lambda *given: kernels.ud.predict(*given, EPS), (x, U, D, F, Q))
    check_runs_are_alone(lambda *given: kernels.ud.update(*given, NONE, EPS), (x, U, D, nu, H, R))
    check_runs_are_alone(lambda *given: kernels.srif.predict(*given, EPS)[:2], (x, L, F, Q))
    check_runs_are_alone(lambda *given: kernels.srif.update(*given, EPS)[:4], (x, L, nu, H, R))
    check_runs_are_alone(lambda *given: kernels.joseph.update(*given, EPS)[:4], (x, P, nu, H, R))


def test_semidefinite_matrices_have_zeros_and_indefinite_ones_are_told():
    P = np.stack([np.eye(3), np.ones((3, 3)), np.diag([1.0, 0.0, 2.0]), np.zeros((3, 3)), np.diag([1.0, -1.0, 1.0])])
    U, D = kernels.ud.factor(P, EPS)
    np.testing.assert_allclose(whole(U, D)[:4], P[:4], atol=1e-15)
    assert (D[:4] >= 0).all() and np.isnan(D[4]).any()
    assert kernels.srif.information(P, EPS)[1].tolist() == [1, 2, 3]
    P = np.stack([np.eye(2), np.array([[1.0, 2.0], [2.0, 1.0]])])
    lost = kernels.joseph.update(np.zeros((2, 2)), P, np.zeros((2, 1)), np.ones((1, 1, 2)), np.eye(1)[None], EPS)[4]
    assert lost.tolist() == [1]
