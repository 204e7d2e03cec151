"""Sigma points and the moments of their images, against sums over all of them in NumPy."""

import numpy as np
import pytest
from checks import SIZES, assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels


@pytest.mark.parametrize(("n", "k", "runs"), SIZES)
def test_moments_of_the_images_are_weighted_sums_over_all_points(n, k, runs):
    rng = np.random.default_rng(1)
    m, P, R = rng.normal(size=(runs, n)), covariances(rng, runs, n), covariances(rng, 1, k)
    alpha, beta, kappa = 0.5, 2.0, 1.0
    scale = alpha**2 * (n + kappa)
    points, offsets, without_factor = kernels.sigma_points.points(m, P, np.sqrt(scale))
    assert without_factor == 0
    L = np.linalg.cholesky(P)
    assert_close(points[:, 1 : n + 1], m[:, None] + np.sqrt(scale) * L.swapaxes(1, 2))
    assert_close(points[:, n + 1 :], m[:, None] - np.sqrt(scale) * L.swapaxes(1, 2))
    assert (points[:, 0] == m).all()
    assert_close(points - m[:, None], np.concatenate([np.zeros((runs, 1, n)), offsets], axis=1))
    for one, other in zip(kernels.sigma_points.points_of_root(m, L, np.sqrt(scale)), (points, offsets), strict=True):
        assert_close(one, other)

    # The textbook's weights, the centre's among them (Wan and van der Merwe 2001).
    images = np.sin(points @ rng.normal(size=(n, k)))
    w = np.full(2 * n + 1, 1 / (2 * scale))
    w[0] = 1 - n / scale
    c = w.copy()
    c[0] += 1 - alpha**2 + beta
    expected = np.einsum("i,bik->bk", w, images)
    d, x = images - expected[:, None], points - m[:, None]
    found = kernels.sigma_points.moments(images, images - images[:, :1], offsets, R, 1 / (2 * scale), beta - alpha**2)
    plain = expected, np.einsum("i,bij,bik->bjk", c, d, d) + R, np.einsum("i,bij,bik->bjk", c, d, x)
    for one, other in zip(found, plain, strict=True):
        assert_close(one, other)
    mean, covariance = kernels.sigma_points.predict(
        images[:, 0].copy(), images[:, 1:] - images[:, :1], R, 1 / (2 * scale), beta - alpha**2
    )
    np.testing.assert_array_equal(mean, found[0])
    np.testing.assert_array_equal(covariance, found[1])


def test_weighted_deviations_are_a_root_of_the_moments():
    rng = np.random.default_rng(2)
    n, kappa, d = 5, 1.5, rng.normal(size=(40, 10, 3))
    weight = 1 / (2 * (n + kappa))
    shift, D = kernels.sigma_points.weighted_deviations(d, weight, kappa / (n + kappa))
    assert_close(shift, weight * d.sum(axis=1))
    about = d - shift[:, None]
    centre = kappa / (n + kappa) * shift[:, :, None] * shift[:, None]
    assert_close(D @ D.swapaxes(1, 2), weight * about.swapaxes(1, 2) @ about + centre)


def test_a_covariance_without_factor_is_counted_and_stays_alone():
    rng = np.random.default_rng(3)
    m, P = rng.normal(size=(40, 4)), covariances(rng, 40, 4)
    P[7] = -np.eye(4)
    points, offsets, without_factor = kernels.sigma_points.points(m, P, 2.0)
    assert without_factor == 1
    assert np.isfinite(np.delete(points, 7, axis=0)).all()
    assert not np.isfinite(offsets[7]).all()


def test_a_run_is_its_own():
    rng = np.random.default_rng(16)
    runs, n, m = 70, 6, 3
    x, P, R = rng.normal(size=(runs, n)), covariances(rng, runs, n), covariances(rng, runs, m)
    d, offsets, centre = rng.normal(size=(runs, 12, m)), rng.normal(size=(runs, 12, n)), rng.normal(size=(runs, m))
    check_runs_are_alone(kernels.sigma_points.points, (x, P), 2.0)
    check_runs_are_alone(kernels.sigma_points.points_of_root, (x, P), 2.0)
    check_runs_are_alone(kernels.sigma_points.predict, (centre, d, R), 0.1, -0.7)
    images = rng.normal(size=(runs, 13, m))
    check_runs_are_alone(kernels.sigma_points.moments, (images, images - images[:, :1], offsets, R), 0.1, -0.7)
    check_runs_are_alone(kernels.sigma_points.weighted_deviations, (d,), 0.1, 0.3)
