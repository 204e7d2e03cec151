"""Particles moved and weighed, against NumPy, SciPy and mpmath."""

import mpmath
import numpy as np
import pytest
from checks import check_runs_are_alone
from scipy.special import logsumexp

from relnav_sim import kernels

SIZES = [(1, 1, 2), (3, 2, 63), (2, 6, 64), (4, 6, 500), (2, 12, 1000)]
"""Runs, states and particles."""


def some(runs, n, N, seed=0):
    rng = np.random.default_rng(seed)
    return 100 + rng.standard_normal((runs, n, N)), np.log(rng.dirichlet(np.ones(N), runs)), rng


# Moves


@pytest.mark.parametrize(("runs", "n", "N"), SIZES)
@pytest.mark.parametrize("shared", [True, False])
def test_affine(runs, n, N, shared):
    x, _, rng = some(runs, n, N)
    F, c = rng.standard_normal((1 if shared else runs, n, n)), rng.standard_normal((runs, n))
    F[:, 0, 1:] = 0.0
    np.testing.assert_allclose(
        kernels.particles.affine(x, F, c), F @ x + c[:, :, None], rtol=1e-12, atol=1e-12 * 100 * n
    )


@pytest.mark.parametrize(("runs", "n", "N"), SIZES)
@pytest.mark.parametrize("roots", ["shared", "by run", "by particle"])
def test_noise(runs, n, N, roots):
    x, _, rng = some(runs, n, N)
    r = max(1, n - 1)
    G = rng.standard_normal({"shared": (1, 1), "by run": (runs, 1), "by particle": (runs, N)}[roots] + (n, r))
    xi = rng.standard_normal((runs, r, N))
    every = np.broadcast_to(G, (runs, N, n, r))
    expected = x + np.einsum("bpij,bjp->bip", every, xi)
    kernels.particles.add_noise(x, G, xi)
    np.testing.assert_allclose(x, expected, rtol=1e-12)


@pytest.mark.parametrize(("count", "n"), [(2, 1), (3, 6), (32, 3), (1000, 4), (33, 12)])
def test_roots(count, n):
    rng = np.random.default_rng(n)
    A = rng.standard_normal((count, n, n)) * np.geomspace(1e4, 1e-7, n)[:, None]
    Q = A @ A.swapaxes(1, 2) + np.eye(n) * np.einsum("bii->bi", A @ A.swapaxes(1, 2))[:, None]
    found, regular = kernels.particles.roots(Q)
    assert regular.all()
    deviation = np.sqrt(np.einsum("bii->bi", Q))
    expected = deviation[:, :, None] * np.linalg.cholesky(Q / (deviation[:, :, None] * deviation[:, None]))
    np.testing.assert_allclose(found / deviation[:, :, None], expected / deviation[:, :, None], rtol=1e-12, atol=1e-13)
    Q[0], Q[-1] = np.nan, np.ones((n, n))
    broken, regular = kernels.particles.roots(Q)
    assert not regular[0] and regular[-1] == (n == 1) and regular[1:-1].all()
    assert np.array_equal(broken[1:-1], found[1:-1])


# Weights and moments


@pytest.mark.parametrize(("runs", "n", "N"), SIZES)
def test_weights_and_moments(runs, n, N):
    x, log_weights, rng = some(runs, n, N)
    factors = -np.square(rng.standard_normal((runs, N))) * 5 - 1000
    found, mean, covariance, evidence, ess, lost = kernels.particles.weigh(x, log_weights, factors)
    unnormalised = log_weights + factors
    np.testing.assert_allclose(evidence, logsumexp(unnormalised, axis=1), rtol=1e-14)
    np.testing.assert_allclose(found, unnormalised - evidence[:, None], rtol=1e-12, atol=1e-11)
    weights = np.exp(found)
    np.testing.assert_allclose(ess, 1 / np.square(weights).sum(axis=1), rtol=1e-12)
    assert not lost.any()
    for run in range(runs):
        np.testing.assert_allclose(mean[run], np.average(x[run], axis=1, weights=weights[run]), rtol=1e-13)
        expected = np.cov(x[run], aweights=weights[run], ddof=0).reshape(n, n)
        np.testing.assert_allclose(covariance[run], expected, rtol=1e-12, atol=1e-12)
        assert np.array_equal(covariance[run], covariance[run].T)


def test_effective_sample_sizes_by_hand():
    with np.errstate(divide="ignore"):
        log_weights = np.log([[0.25] * 4, [1, 0, 0, 0], [0.5, 0.5, 0, 0]])
    *_, ess, lost = kernels.particles.weigh(np.zeros((3, 1, 4)), log_weights, np.zeros((3, 4)))
    np.testing.assert_allclose(ess, [4, 1, 2], rtol=1e-15)
    assert lost.tolist() == [False, True, True]


def test_weights_span_the_whole_range_of_numbers():
    """exp of every size against mpmath, relative; below the normal numbers nothing counts."""
    logarithms = -np.concatenate([[0.0], np.geomspace(1e-18, 700, 300), [800.0, np.inf]])
    log_weights, *_, evidence, ess, _ = kernels.particles.weigh(
        np.zeros((1, 1, len(logarithms))), logarithms[None], np.zeros((1, len(logarithms)))
    )
    with mpmath.workdps(40):
        weights = [mpmath.exp(mpmath.mpf(float(one))) for one in logarithms[:-1]]
        total, squares = mpmath.fsum(weights), mpmath.fsum([w * w for w in weights])
        assert abs(evidence[0] - mpmath.log(total)) < 1e-15 * 10
        assert abs(ess[0] - total**2 / squares) < 1e-14 * ess[0]
    assert log_weights[0, -1] == -np.inf


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_particles_without_a_density_weigh_nothing_whatever_their_state(value):
    x, log_weights, rng = some(3, 2, 100)
    factors = rng.standard_normal((3, 100))
    clean = kernels.particles.weigh(x, log_weights, factors)
    factors[1, :7] = value
    x[1, :, :7] = np.nan
    found = kernels.particles.weigh(x, log_weights, factors)
    without = kernels.particles.weigh(x[1:2, :, 7:].copy(), log_weights[1:2, 7:].copy(), factors[1:2, 7:].copy())
    for array, expected in zip(found[1:5], without[1:5], strict=True):
        np.testing.assert_allclose(array[1], expected[0], rtol=1e-12, atol=1e-12)
    assert (found[0][1, :7] == -np.inf).all() and found[5].tolist() == [False, True, False]
    for array, expected in zip(found, clean, strict=True):
        assert np.array_equal(array[[0, 2]], expected[[0, 2]])
    factors[1] = value
    found = kernels.particles.weigh(x, log_weights, factors)
    assert all(np.isnan(array[1]).all() for array in found[1:5])
    for array, expected in zip(found, clean, strict=True):
        assert np.array_equal(array[[0, 2]], expected[[0, 2]])


def test_powers_that_leave_half_of_the_particles():
    score = -np.square(np.random.default_rng(0).standard_normal((4, 2000))) * np.array([[1e4], [1e4], [1e4], [1e-3]])
    most = np.array([1.0, 1.0, 0.5, 1.0])
    power = kernels.particles.power_that_leaves_half(np.zeros((4, 2000)), score, most, 100.0)
    weights = np.exp(power[:3, None] * score[:3])
    ess = np.square(weights.sum(axis=1)) / np.square(weights).sum(axis=1)
    np.testing.assert_allclose(ess, 1000, rtol=1e-3)
    assert power[3] == 0


def test_a_run_is_its_own():
    runs, n, N = 40, 6, 77
    x, log_weights, rng = some(runs, n, N)
    F, c = rng.standard_normal((runs, n, n)), rng.standard_normal((runs, n))
    G, xi = rng.standard_normal((runs, 1, n, n)), rng.standard_normal((runs, n, N))
    score = rng.standard_normal((runs, N))
    check_runs_are_alone(kernels.particles.affine, (x, F, c))

    def noisy(x, G, xi):
        moved = x.copy()
        kernels.particles.add_noise(moved, G, xi)
        return moved

    check_runs_are_alone(noisy, (x, G, xi))
    weighed = kernels.particles.weigh(x, log_weights, score)
    power = kernels.particles.power_that_leaves_half(log_weights, 50 * score, np.ones(runs), N / 2)
    for run in (0, 1, 17, 39):
        own = slice(run, run + 1)
        alone = kernels.particles.weigh(x[own], log_weights[own], score[own])
        for one, many in zip(alone, weighed, strict=True):
            np.testing.assert_array_equal(one[0], many[run])
        half = kernels.particles.power_that_leaves_half(log_weights[own], 50 * score[own], np.ones(1), N / 2)
        assert half[0] == power[run]
