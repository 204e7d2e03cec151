"""Roots of the Cramér-Rao bound, against the recursion as it stands in the textbook."""

import numpy as np
import pytest

from relnav_sim import kernels


def draw(K, models, n, m, seed=1):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(models, n, n)) + 2 * np.eye(n)
    F = np.eye(n) + 0.1 * rng.normal(size=(K, models, n, n))
    return root, F, 0.3 * rng.normal(size=(K, models, n, n)), rng.normal(size=(K, m, n))


@pytest.mark.parametrize(("K", "models", "n", "m"), [(1, 1, 1, 1), (5, 1, 6, 3), (5, 3, 8, 8), (3, 2, 12, 2)])
def test_covariance_roots_against_inverses(K, models, n, m):
    root, F, noise_root, W = draw(K, models, n, m)
    roots = kernels.bound.covariance_roots(root, F, noise_root, W)
    for model in range(models):
        P = root[model].T @ root[model]
        for k in range(K):
            predicted = F[k, model] @ P @ F[k, model].T + noise_root[k, model].T @ noise_root[k, model]
            P = np.linalg.inv(np.linalg.inv(predicted) + W[k].T @ W[k])
            found = roots[k, model].T @ roots[k, model]
            scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
            assert (np.abs(found - P) / scale).max() < 1e-11  # what the inverses leave
            assert np.array_equal(np.triu(roots[k, model]), roots[k, model])


def test_a_model_is_alone_and_so_is_nan():
    root, F, noise_root, W = draw(4, 3, 6, 3)
    together = kernels.bound.covariance_roots(root, F, noise_root, W)
    for model in range(3):
        own = slice(model, model + 1)
        alone = kernels.bound.covariance_roots(
            root[own], np.ascontiguousarray(F[:, own]), np.ascontiguousarray(noise_root[:, own]), W
        )
        np.testing.assert_array_equal(alone[:, 0], together[:, model])
    F[2, 1] = np.nan
    broken = kernels.bound.covariance_roots(root, F, noise_root, W)
    np.testing.assert_array_equal(broken[:, ::2], together[:, ::2])
    np.testing.assert_array_equal(broken[:2], together[:2])
    assert np.isnan(np.diagonal(broken[2:, 1], axis1=1, axis2=2)).all()


def test_nothing_known_stays_so():
    """States without spread and without noise keep a covariance of zero, whatever is read."""
    none = np.zeros((1, 3, 3))
    roots = kernels.bound.covariance_roots(none, np.eye(3)[None, None], none[None], np.ones((1, 2, 3)))
    np.testing.assert_array_equal(roots, np.zeros((1, 1, 3, 3)))


@pytest.mark.parametrize(("K", "m", "n"), [(1, 1, 1), (6, 6, 6), (4, 3, 8), (30, 12, 12)])
def test_information_roots_against_sums(K, m, n):
    rows = np.random.default_rng(2).normal(size=(K, m, n))
    roots = kernels.bound.information_roots(np.eye(n), rows)
    squares = np.eye(n) + np.cumsum(rows.swapaxes(1, 2) @ rows, axis=0)
    np.testing.assert_allclose(roots.swapaxes(1, 2) @ roots, squares, rtol=1e-12, atol=1e-12 * squares.max())
    np.testing.assert_array_equal(np.triu(roots), roots)
