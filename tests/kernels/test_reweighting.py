"""The steps of reweighted updates against their formulas in NumPy."""

import numpy as np
import pytest

from relnav_sim import kernels


def problem(runs, n, m, shared):
    rng = np.random.default_rng([runs, n, m])
    count = 1 if shared else runs
    A, B = rng.standard_normal((count, m, m + 2)), rng.standard_normal((runs, n, n + 2))
    return (
        rng.standard_normal((runs, m)),
        rng.standard_normal((count, m, n)),
        A @ A.swapaxes(1, 2),
        rng.standard_normal((runs, n)),
        B @ B.swapaxes(1, 2),
        rng.uniform(0.01, 1.2, (runs, m)),
    )


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize(("runs", "n", "m"), [(1, 1, 1), (33, 6, 3), (100, 12, 6)])
def test_whitened_residuals_and_scaled_noise(runs, n, m, shared):
    nu, H, R, dx, P, weights = problem(runs, n, m, shared)
    root, white, rows, singular = kernels.reweighting.whitened(nu, H, R)
    e, spread = kernels.reweighting.residuals(white, rows, dx, P)
    noise = kernels.reweighting.scaled(root, weights)
    assert not singular.any()
    for run in range(runs):
        own = 0 if shared else run
        L = np.linalg.cholesky(R[own])
        W = np.linalg.solve(L, H[own])
        np.testing.assert_allclose(root[run], L, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(e[run], np.linalg.solve(L, nu[run] - H[own] @ dx[run]), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(spread[run], np.diag(W @ P[run] @ W.T), rtol=1e-9)
        np.testing.assert_allclose(noise[run], L @ np.diag(1 / weights[run]) @ L.T, rtol=1e-10, atol=1e-11)


def test_a_singular_noise_is_told_and_stays_alone():
    nu, H, R, *_ = problem(40, 6, 3, shared=False)
    sound = kernels.reweighting.whitened(nu, H, R)
    R[5, 2], R[5, :, 2] = R[5, 1], R[5, :, 1]
    R[5, 2, 2] = R[5, 1, 1]
    R[35, 0, 0] = np.nan
    found = kernels.reweighting.whitened(nu, H, R)
    assert np.flatnonzero(found[3]).tolist() == [5, 35]
    for part, before in zip(found, sound, strict=True):
        np.testing.assert_array_equal(np.delete(part, [5, 35], axis=0), np.delete(before, [5, 35], axis=0))


def test_bits_of_a_run_do_not_depend_on_the_block():
    nu, H, R, dx, P, weights = problem(70, 6, 3, shared=False)
    root, white, rows, _ = kernels.reweighting.whitened(nu, H, R)
    whole = *kernels.reweighting.residuals(white, rows, dx, P), kernels.reweighting.scaled(root, weights)
    for first, last in [(0, 1), (31, 34), (69, 70)]:
        part = slice(first, last)
        own = kernels.reweighting.whitened(nu[part], H[part], R[part])
        np.testing.assert_array_equal(own[0], root[part])
        found = (
            *kernels.reweighting.residuals(own[1], own[2], dx[part], P[part]),
            kernels.reweighting.scaled(own[0], weights[part]),
        )
        for one, other in zip(found, whole, strict=True):
            np.testing.assert_array_equal(one, other[part])
