"""Linear and quadratic maps and the chain rule, against NumPy."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels


@pytest.mark.parametrize(("points", "m", "n"), [(1, 1, 1), (7, 6, 12), (1000, 3, 6)])
def test_one_matrix_times_many_vectors(points, m, n):
    rng = np.random.default_rng([points, m, n])
    H, x = rng.standard_normal((m, n)), rng.standard_normal((points, n))
    np.testing.assert_allclose(kernels.maps.linear(H, x), x @ H.T, rtol=1e-12, atol=1e-13)
    if points > 1:
        check_runs_are_alone(lambda x: kernels.maps.linear(H, x), (x,))


@pytest.mark.parametrize(("n", "points"), [(1, 1), (2, 33), (6, 1), (6, 1000), (12, 50)])
def test_quadratic_map(n, points):
    rng = np.random.default_rng(n)
    F, D, x = rng.normal(size=(n, n)), rng.normal(size=(n, n, n)), rng.normal(size=(points, n))
    D += D.swapaxes(1, 2)
    moved, slope = kernels.maps.quadratic(F, D, x), kernels.maps.quadratic_jacobians(F, D, x)
    expected = x @ F.T + np.einsum("mij,bi,bj->bm", D, x, x)
    size = np.abs(x) @ np.abs(F.T) + np.einsum("mij,bi,bj->bm", np.abs(D), np.abs(x), np.abs(x))
    np.testing.assert_array_less(np.abs(moved - expected), 1e-14 * size)
    np.testing.assert_allclose(slope, F + 2 * np.einsum("mij,bj->bmi", D, x), rtol=1e-12, atol=1e-13)
    if points > 1:
        check_runs_are_alone(lambda x: kernels.maps.quadratic(F, D, x), (x,))
        check_runs_are_alone(lambda x: kernels.maps.quadratic_jacobians(F, D, x), (x,))


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize(("m", "k", "n", "e"), [(1, 1, 1, 1), (3, 3, 6, 2), (2, 3, 6, 0), (6, 4, 12, 5)])
def test_chain_rule(m, k, n, e, shared):
    rng = np.random.default_rng(3)
    A, count = rng.standard_normal((9, m, k)), 1 if shared else 9
    B, C = rng.standard_normal((count, k, n)), rng.standard_normal((count, m, e))
    whole = kernels.maps.chained(A, B, C)
    np.testing.assert_allclose(whole[:, :, :n], A @ B, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(whole[:, :, n:], np.broadcast_to(C, (9, m, e)))
    if not shared:
        check_runs_are_alone(lambda A, B: kernels.maps.chained(A, B, np.zeros((1, m, 0))), (A, B))
