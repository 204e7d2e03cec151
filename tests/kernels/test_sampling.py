"""The sampling kernels against their formulas in NumPy."""

import numpy as np
import pytest

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix
from relnav_sim.kernels.sampling import EXACT, INDEPENDENT, PAIRED

SIZES = [(1, 1, 1), (7, 6, 3), (40, 12, 5)]


def covariances(rng, runs, n):
    A = rng.standard_normal((runs, n, n + 3))
    return A @ A.swapaxes(1, 2) / n


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
def test_projection_and_whitening(runs, n, k, shared):
    rng = np.random.default_rng([runs, n, 1])
    P, H = covariances(rng, runs, n), rng.standard_normal((1 if shared else runs, k, n))
    seen = kernels.sampling.projected(P, H)
    np.testing.assert_allclose(seen, H @ P @ H.swapaxes(1, 2), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(seen, seen.swapaxes(1, 2))
    R = covariances(rng, runs, k)
    W = kernels.sampling.whitener(R, 0.25)
    np.testing.assert_allclose(W.swapaxes(1, 2) @ W, 0.25 * np.linalg.inv(R), rtol=1e-9, atol=1e-10)
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


def test_bits_of_a_run_do_not_depend_on_the_block():
    z, W, centre, root, e, M = radar_samples((40, -20, 10), 3000.0)
    whole = kernels.sight.squared_errors(z, W, centre, root, e, M)
    moments = kernels.sampling.moments(whole, e, INDEPENDENT)
    for run in range(len(z)):
        own = slice(run, run + 1)
        alone = kernels.sight.squared_errors(z[own], W[own], centre[own], root[own], e[own], M)
        np.testing.assert_array_equal(alone[0], whole[run])
        for part, single in zip(moments, kernels.sampling.moments(alone, e[own], INDEPENDENT), strict=True):
            np.testing.assert_array_equal(single[0], part[run])


def test_a_lost_run_stays_alone():
    z, W, centre, root, e, M = radar_samples((0, 0, 0), 10.0)
    sound = kernels.sight.squared_errors(z, W, centre, root, e, M)
    centre[2, 0] = np.nan
    errors = kernels.sight.squared_errors(z, W, centre, root, e, M)
    assert np.isnan(errors[2]).all()
    np.testing.assert_array_equal(np.delete(errors, 2, axis=0), np.delete(sound, 2, axis=0))
    mean, covariance, ess = kernels.sampling.moments(errors, e, EXACT)
    assert np.isnan(mean[2]).all() and np.isnan(covariance[2]).all() and np.isnan(ess[2])
    assert np.isfinite(np.delete(ess, 2)).all()


def test_a_covariance_that_is_not_definite_stays_alone():
    P = covariances(np.random.default_rng(8), 40, 6)
    P[33, 1, 1] = -1.0
    roots, remainder = kernels.sampling.whitened(P, np.arange(3))
    assert np.isnan(roots[33]).any()
    assert np.isfinite(np.delete(roots, 33, axis=0)).all() and np.isfinite(np.delete(remainder, 33, axis=0)).all()
