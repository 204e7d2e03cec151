"""Sigma points, mixtures, roots and the steps of the iterated filters, in kernels, against plain NumPy."""

import numpy as np
import pytest

from relnav_sim import kernels

SIZES = [(1, 1, 1), (2, 1, 3), (6, 3, 1), (6, 3, 50), (8, 3, 33), (12, 6, 32), (6, 3, 500)]


def spread(rng, *shape):
    """Covariances (..., n, n)."""
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ A.swapaxes(-1, -2) + 0.1 * np.eye(shape[-1])


def assert_close(found, expected, rtol=1e-12):
    """Equal to 1e-12 of the largest entry of the run."""
    scale = np.abs(expected).reshape(len(expected), -1).max(axis=1).reshape(-1, *[1] * (expected.ndim - 1))
    np.testing.assert_array_less(np.abs(found - expected), rtol * np.maximum(scale, 1.0) * np.ones(expected.shape))


def assert_run_by_itself(kernel, arguments, per_run):
    """Every run's bits are those of a call with that run alone, and NaN in one run stays there."""
    whole = kernel(*arguments)
    runs = max(len(one) for one, by_run in zip(arguments, per_run, strict=True) if by_run)
    for run in (0, runs // 2, runs - 1):
        alone = kernel(
            *(np.ascontiguousarray(a[run : run + 1]) if p else a for a, p in zip(arguments, per_run, strict=True))
        )
        for one, all_of_them in zip(alone, whole, strict=True):
            if isinstance(one, np.ndarray):
                np.testing.assert_array_equal(one[0], all_of_them[run])
    broken = [a.copy() if p else a for a, p in zip(arguments, per_run, strict=True)]
    for a, p in zip(broken, per_run, strict=True):
        if p:
            a[runs // 2] = np.nan
    others = np.arange(runs) != runs // 2
    for one, all_of_them in zip(kernel(*broken), whole, strict=True):
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one[others], all_of_them[others])


# Sigma points


@pytest.mark.parametrize(("n", "k", "runs"), SIZES)
def test_moments_of_the_images_are_weighted_sums_over_all_points(n, k, runs):
    rng = np.random.default_rng(1)
    m, P, R = rng.normal(size=(runs, n)), spread(rng, runs, n), spread(rng, 1, k)
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
    m, P = rng.normal(size=(40, 4)), spread(rng, 40, 4)
    P[7] = -np.eye(4)
    points, offsets, without_factor = kernels.sigma_points.points(m, P, 2.0)
    assert without_factor == 1
    assert np.isfinite(np.delete(points, 7, axis=0)).all()
    assert not np.isfinite(offsets[7]).all()


# Mixtures


def mixture(rng, runs, c, n):
    w = rng.uniform(0.1, 1, size=(runs, c))
    return w / w.sum(axis=1, keepdims=True), rng.normal(size=(runs, c, n)), spread(rng, runs, c, n)


def plain_moments(w, x, P):
    mean = np.einsum("c,cn->n", w, x)
    return mean, sum(one * (p + np.outer(a - mean, a - mean)) for one, a, p in zip(w, x, P, strict=True))


@pytest.mark.parametrize(("n", "c", "runs"), [(1, 1, 1), (3, 2, 40), (8, 4, 33), (6, 8, 300)])
def test_moments_of_mixtures(n, c, runs):
    given = mixture(np.random.default_rng(4), runs, c, n)
    found = kernels.components.moment_match(*given)
    expected = [plain_moments(*one) for one in zip(*given, strict=True)]
    for one, other in zip(found, zip(*expected, strict=True), strict=True):
        assert_close(one, np.array(other))


def test_models_mix_by_the_chain():
    rng = np.random.default_rng(5)
    w, x, P = mixture(rng, 30, 3, 4)
    chain = rng.uniform(size=(3, 3))
    chain /= chain.sum(axis=1, keepdims=True)
    log_weights, means, covariances = kernels.components.mix(np.log(w), chain, x, P)
    assert_close(np.exp(log_weights), w @ chain)
    for run in range(30):
        for j in range(3):
            share = w[run] * chain[:, j] / (w[run] @ chain[:, j])
            mean, covariance = plain_moments(share, x[run], P[run])
            assert_close(means[run, j][None], mean[None])
            assert_close(covariances[run, j][None], covariance[None])


def test_expected_reading_of_a_mixture():
    rng = np.random.default_rng(6)
    w, _, P = mixture(rng, 30, 3, 5)
    offsets, H, R = rng.normal(size=(30, 3, 2)), rng.normal(size=(30, 3, 2, 5)), spread(rng, 30, 3, 2)
    found = kernels.components.expected_reading(w, offsets, H, P, R)
    S = H @ P @ H.swapaxes(2, 3) + R
    expected = [plain_moments(*one) for one in zip(w, offsets, S, strict=True)]
    for one, other in zip(found, zip(*expected, strict=True), strict=True):
        assert_close(one, np.array(other))


def test_weights_follow_bayes_and_a_broken_component_weighs_nothing():
    rng = np.random.default_rng(7)
    w, x, P = mixture(rng, 30, 4, 3)
    before = mixture(rng, 30, 2, 3)
    log_likelihood = rng.normal(size=(30, 4)) - 500
    P[3, 2, 0, 1] = np.nan
    likelihood = np.exp(log_likelihood + 500)
    likelihood[3, 2] = 0
    log_weights, total = kernels.components.reweigh(np.log(w), x, P, log_likelihood, before[1], before[2])
    joint = w * likelihood
    assert_close(np.exp(log_weights), joint / joint.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(total, np.log(joint.sum(axis=1)) - 500, rtol=1e-12)
    np.testing.assert_array_equal(P[3, 2], before[2][3, 1])
    np.testing.assert_array_equal(x[3, 2], before[1][3, 1])


def plain_reduce(w, x, P, components):
    """Runnalls' greedy merging, all pairs anew each time."""
    parts = [(a, b, c) for a, b, c in zip(w, x, P, strict=True)]

    def merged(one, other):
        total = one[0] + other[0]
        return total, *plain_moments(
            np.array([one[0], other[0]]) / total, np.array([one[1], other[1]]), (one[2], other[2])
        )

    def log_det(part):
        return np.linalg.slogdet(part[2])[1]

    while len(parts) > components:
        pairs = [(i, j) for i in range(len(parts)) for j in range(i + 1, len(parts))]
        costs = []
        for i, j in pairs:
            both = merged(parts[i], parts[j])
            costs.append(both[0] * log_det(both) - parts[i][0] * log_det(parts[i]) - parts[j][0] * log_det(parts[j]))
        i, j = pairs[int(np.argmin(costs))]
        parts[i] = merged(parts[i], parts[j])
        del parts[j]
    parts.sort(key=lambda part: -part[0])
    return [np.array(one) for one in zip(*parts, strict=True)]


@pytest.mark.parametrize(("n", "c", "components", "runs"), [(1, 2, 1, 3), (4, 8, 3, 20), (3, 12, 4, 5)])
def test_merging_takes_the_cheapest_pairs(n, c, components, runs):
    given = mixture(np.random.default_rng(8), runs, c, n)
    found = kernels.merging.reduce(*given, components)
    for run in range(runs):
        for one, expected in zip(found, plain_reduce(*(part[run] for part in given), components), strict=True):
            assert_close(one[run][None], expected[None])


def test_merging_keeps_the_moments_and_stands_singular_components():
    w, x, P = mixture(np.random.default_rng(9), 30, 40, 3)
    P[:, ::3, :, 2] = P[:, ::3, 2] = 0.0
    before = kernels.components.moment_match(w, x, P)
    after = kernels.components.moment_match(*kernels.merging.reduce(w, x, P, 5))
    for one, other in zip(after, before, strict=True):
        assert_close(one, other)
    assert_run_by_itself(lambda *given: kernels.merging.reduce(*given, 5), (w, x, P), (True, True, True))


# Roots


@pytest.mark.parametrize(("n", "q", "runs"), SIZES)
def test_cholesky_factors_and_what_they_solve(n, q, runs):
    rng = np.random.default_rng(10)
    P, B = spread(rng, runs, n), rng.normal(size=(runs, n, q))
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
    P = spread(rng, 40, 3)
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
    X, H, N = rng.normal(size=(runs, n, n + 2)), rng.normal(size=(runs, m, n)), np.linalg.cholesky(spread(rng, 1, m))
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


# Iterated filters


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_the_steps_of_the_searches(n, m, runs):
    rng = np.random.default_rng(15)
    D, G, H = (rng.normal(size=(runs, m, n)) for _ in range(3))
    K = 0.1 * rng.normal(size=(runs, n, m))
    P, V, R = spread(rng, runs, n), spread(rng, runs, m), spread(rng, 1, m)
    W, U = np.linalg.inv(np.linalg.cholesky(P)), np.linalg.inv(np.linalg.cholesky(V))
    d, x, residual = rng.normal(size=(runs, n)), rng.normal(size=(runs, n)), rng.normal(size=(runs, m))

    def squared(A, v):
        return np.square((A @ v[:, :, None])[:, :, 0]).sum(axis=1)

    HP, S, nu = kernels.iterated.linearised_reading(H, P, R, d, residual)
    assert_close(HP, H @ P)
    assert_close(S, H @ P @ H.swapaxes(1, 2) + R)
    assert_close(nu, residual + (H @ d[:, :, None])[:, :, 0])

    both, cost = kernels.iterated.misfit(G, K, x, d, residual, W, U)
    q = (G @ (x - d)[:, :, None])[:, :, 0] - residual
    t = d - x - (K @ q[:, :, None])[:, :, 0]
    assert_close(both, np.concatenate([t, q], axis=1))
    np.testing.assert_allclose(cost, squared(W, t) + squared(U, q), rtol=1e-10)

    T = np.eye(m) - D @ K
    tolerance = 1e-12 * max(1.0, np.linalg.cond(T).max()) ** 2
    E, EP, S = kernels.iterated.linearise(D, K, P, V)
    assert_close(T @ E, D, rtol=tolerance)
    assert_close(EP, E @ P)
    assert_close(S, E @ P @ E.swapaxes(1, 2) + V)

    # The step solves the normal equations of |W (t + move)|^2 + |U (q + E move)|^2 in the coordinates of t.
    steps, length = kernels.iterated.step(D, K, P, V, both, W, U)
    at = np.linalg.inv(P) + E.swapaxes(1, 2) @ np.linalg.inv(V) @ E
    slope = np.linalg.solve(P, t[:, :, None]) + E.swapaxes(1, 2) @ np.linalg.solve(V, q[:, :, None])
    move = -np.linalg.solve(at, slope)
    np.testing.assert_allclose(steps, (move + K @ E @ move)[:, :, 0], rtol=1e-5, atol=1e-6 * np.abs(move).max())
    np.testing.assert_allclose(length, squared(W, move[:, :, 0]) + squared(U, (E @ move)[:, :, 0]), rtol=1e-5)

    B, scatter = kernels.iterated.turned(D, K, H, V)
    assert_close(T.swapaxes(1, 2) @ B, H, rtol=tolerance)
    assert_close(scatter, T @ V @ T.swapaxes(1, 2))


# A run by itself


def test_bits_of_a_run_depend_on_it_alone():
    rng = np.random.default_rng(16)
    runs, n, m, c = 70, 6, 3, 4
    x, P, R = rng.normal(size=(runs, n)), spread(rng, runs, n), spread(rng, 1, m)
    d, offsets, centre = rng.normal(size=(runs, 13, m)), rng.normal(size=(runs, 12, n)), rng.normal(size=(runs, m))
    points, moments = kernels.sigma_points.points, kernels.sigma_points.moments
    assert_run_by_itself(lambda *given: points(*given, 2.0), (x, P), (True, True))
    assert_run_by_itself(
        lambda *given: moments(*given, 0.1, -0.7), (d, d - d[:, :1], offsets, R), (True, True, True, False)
    )
    w, means, covariances = mixture(rng, runs, c, n)
    assert_run_by_itself(kernels.components.moment_match, (w, means, covariances), (True, True, True))
    chain = np.full((c, c), 1 / c)
    mixed = (np.log(w), chain, means, covariances)
    assert_run_by_itself(kernels.components.mix, mixed, (True, False, True, True))
    assert_run_by_itself(kernels.roots.cholesky, (P,), (True,))
    assert_run_by_itself(kernels.roots.solve, (P, offsets[:, :n].copy()), (True, True))
    assert_run_by_itself(
        lambda *given: (kernels.roots.triangular(*given),), (P, rng.normal(size=(1, n, 3))), (True, False)
    )
    Y = rng.normal(size=(runs, m, n))
    updated = (P, Y, R, centre, np.ones((runs, m)))
    assert_run_by_itself(kernels.roots.update, updated, (True, True, False, True, True))
    K, V = 0.1 * rng.normal(size=(runs, n, m)), spread(rng, runs, m)
    both = rng.normal(size=(runs, n + m))
    assert_run_by_itself(kernels.iterated.step, (Y, K, P, V, both, P, V), (True,) * 7)
