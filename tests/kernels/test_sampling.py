"""The sampling kernels against their formulas in NumPy."""

import numpy as np
import pytest
from checks import check_runs_are_alone, covariances

from relnav_sim import kernels
from relnav_sim.kernels.sampling import EXACT, INDEPENDENT, PAIRED

SIZES = [(1, 1, 1), (7, 6, 3), (40, 12, 5)]


@pytest.mark.parametrize(("runs", "n", "d"), SIZES)
def test_regression_on_the_observed_states(runs, n, d):
    rng = np.random.default_rng([runs, n])
    P, m, a, C = covariances(rng, runs, n), rng.standard_normal((runs, n)), rng.standard_normal((runs, d)), None
    C = covariances(rng, runs, d)
    observed = rng.permutation(n)[:d]
    roots, remainder = kernels.sampling.whitened(P, observed)
    for run in range(runs):
        G = P[run][:, observed] @ np.linalg.inv(np.linalg.cholesky(P[run][np.ix_(observed, observed)])).T
        left = P[run] - G @ G.T
        np.testing.assert_allclose(roots[run], G.T, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(remainder[run], left, rtol=1e-10, atol=1e-11)
        mean, covariance = (
            part[0]
            for part in kernels.sampling.regressed(
                m[run : run + 1], roots[run : run + 1], remainder[run : run + 1], a[run : run + 1], C[run : run + 1]
            )
        )
        np.testing.assert_allclose(mean, m[run] + G @ a[run], rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(covariance, G @ C[run] @ G.T + left, rtol=1e-10, atol=1e-10)
    assert not remainder[:, observed].any()


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize(("runs", "n", "k"), SIZES)
def test_squares_of_whitened_residuals(runs, n, k, shared):
    rng = np.random.default_rng([runs, n, 1])
    W = np.tril(rng.standard_normal((1 if shared else runs, k, k)))
    r = rng.standard_normal((runs, k, 300))
    expected = np.square(W @ r).sum(axis=1)
    np.testing.assert_allclose(kernels.sampling.squared(r, W), expected, rtol=1e-12)
    centre, A, e = r[:, :, 0].copy(), rng.standard_normal((runs, k, n)), rng.standard_normal((1, n, 300))
    expected = np.square(W @ (centre[:, :, None] - A @ e)).sum(axis=1)
    np.testing.assert_allclose(kernels.sampling.squared_linear(centre, A, W, e), expected, rtol=1e-9)


@pytest.mark.parametrize("kind", [INDEPENDENT, PAIRED, EXACT])
@pytest.mark.parametrize(("runs", "d", "N"), [(1, 1, 32), (5, 3, 510), (3, 6, 2000)])
def test_moments(runs, d, N, kind):
    rng = np.random.default_rng([runs, N])
    e = rng.standard_normal((1 if kind == EXACT else runs, d, N))
    log_weights = -rng.exponential(3, (runs, N)) + 1000
    mean, covariance, ess = kernels.sampling.moments(-log_weights, e, kind)
    for run in range(runs):
        w = np.exp(log_weights[run] - log_weights[run].max())
        w /= w.sum()
        y = e[0 if kind == EXACT else run]
        factor = {EXACT: 1.0, INDEPENDENT: 1 - (w**2).sum(), PAIRED: 1 - np.square(w[: N // 2] - w[N // 2 :]).sum()}
        offset = y - (y @ w)[:, None]
        np.testing.assert_allclose(mean[run], y @ w, rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(covariance[run], (w * offset) @ offset.T / factor[kind], rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(ess[run], 1 / (w**2).sum(), rtol=1e-12)


def test_a_covariance_that_is_not_definite_stays_alone():
    P = covariances(np.random.default_rng(8), 40, 6)
    P[33, 1, 1] = -1.0
    roots, remainder = kernels.sampling.whitened(P, np.arange(3))
    assert np.isnan(roots[33]).any()
    assert np.isfinite(np.delete(roots, 33, axis=0)).all() and np.isfinite(np.delete(remainder, 33, axis=0)).all()


def test_a_run_is_its_own():
    rng = np.random.default_rng(9)
    runs, n, d, m, N = 40, 6, 3, 2, 300
    P, C, e = covariances(rng, runs, n), covariances(rng, runs, d), rng.standard_normal((runs, d, N))
    check_runs_are_alone(lambda P: kernels.sampling.whitened(P, np.array([4, 0, 1])), (P,))
    roots, remainder = kernels.sampling.whitened(P, np.arange(d))
    regressed = rng.standard_normal((runs, n)), roots, remainder, rng.standard_normal((runs, d)), C
    check_runs_are_alone(kernels.sampling.regressed, regressed)
    r, W, A = rng.standard_normal((runs, m, N)), rng.standard_normal((runs, m, m)), rng.standard_normal((runs, m, d))
    check_runs_are_alone(kernels.sampling.squared, (r, W))
    check_runs_are_alone(kernels.sampling.squared_linear, (r[:, :, 0].copy(), A, W, e))
    check_runs_are_alone(lambda costs, e: kernels.sampling.moments(costs, e, PAIRED), (np.square(r[:, 0]), e))
