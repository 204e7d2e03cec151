"""Particles drawn, moved, weighed and resampled, against NumPy, SciPy and mpmath."""

import mpmath
import numpy as np
import pytest
from scipy.special import logsumexp

from relnav_sim import kernels

SIZES = [(1, 1, 2), (3, 2, 63), (2, 6, 64), (4, 6, 500), (2, 12, 1000)]
"""Runs, states and particles."""


def some(runs, n, N, seed=0):
    rng = np.random.default_rng(seed)
    return 100 + rng.standard_normal((runs, n, N)), np.log(rng.dirichlet(np.ones(N), runs)), rng


# Standard normal numbers


def test_normals_are_those_of_box_and_muller():
    uniform = np.random.default_rng(0).random((1, 400))
    uniform[0, :3] = 0.0, 1 - 2.0**-53, 2.0**-53
    uniform[0, 203:209] = 0.0, 0.125, 0.25, 0.5, 0.875, 1 - 2.0**-53
    found = uniform.copy()
    kernels.normals.box_muller(found)
    with mpmath.workdps(40):
        for i in range(200):
            u, v = mpmath.mpf(uniform[0, i]), mpmath.mpf(uniform[0, 200 + i])
            radius = mpmath.sqrt(-2 * mpmath.log(1 - u))
            x, y = radius * mpmath.cospi(2 * v - 1), radius * mpmath.sinpi(2 * v - 1)
            assert abs(found[0, i] - x) <= 4e-16 * abs(x)
            assert abs(found[0, 200 + i] - y) <= 4e-16 * abs(y)


@pytest.mark.parametrize("pairs", [1, 7, 32, 1001])
def test_bits_of_a_normal_do_not_depend_on_its_place(pairs):
    uniform = np.random.default_rng(1).random((3, 2 * pairs))
    whole = uniform.copy()
    kernels.normals.box_muller(whole)
    for i in range(pairs):
        alone = uniform[1:2, [i, pairs + i]]
        kernels.normals.box_muller(alone)
        assert np.array_equal(alone[0], whole[1, [i, pairs + i]])


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


# Likelihood


@pytest.mark.parametrize(("runs", "m", "N"), [(1, 1, 5), (3, 2, 100), (2, 3, 500), (4, 6, 33)])
@pytest.mark.parametrize("shared", [True, False])
def test_likelihood(runs, m, N, shared):
    _, _, rng = some(1, 1, 2)
    A = rng.standard_normal((1 if shared else runs, m, m))
    R = A @ A.swapaxes(1, 2) + np.eye(m)
    z, predicted = rng.standard_normal((runs, m)), 3 * rng.standard_normal((runs, N, m))
    angle = np.arange(m) % 2 == 1
    difference = z[:, None] - predicted
    difference[..., angle] = np.mod(difference[..., angle] + np.pi, 2 * np.pi) - np.pi
    every = np.broadcast_to(R, (runs, m, m))
    nis = np.einsum("bpi,bij,bpj->bp", difference, np.linalg.inv(every), difference)
    expected = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * every)[1][:, None])
    found = kernels.likelihood.gaussian(z, predicted, angle, R)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)
    if not shared and runs > 2:
        R[1] = -np.eye(m)
        broken = kernels.likelihood.gaussian(z, predicted, angle, R)
        assert np.isnan(broken[1]).all()
        assert np.array_equal(np.delete(broken, 1, axis=0), np.delete(found, 1, axis=0))


# Resampling


@pytest.mark.parametrize("N", [2, 57, 1000])
@pytest.mark.parametrize("several", [True, False])
def test_ancestors_are_those_of_a_search_through_the_cumulative_weights(N, several):
    rng = np.random.default_rng(N)
    weights = rng.gamma(0.3, size=(20, N))
    weights /= weights.sum(axis=1, keepdims=True)
    u = rng.random((20, N if several else 1))
    found = kernels.resampling.ancestors(weights, u)
    for run in range(20):
        expected = np.searchsorted(np.cumsum(weights[run]), (np.arange(N) + u[run]) / N)
        assert np.array_equal(found[run], expected)


def test_ancestors_of_no_number_stay_in_the_array():
    weights = np.full((2, 9), 1 / 9)
    weights[0, 4] = np.nan
    found = kernels.resampling.ancestors(weights, np.full((2, 1), 0.5))
    assert (found >= 0).all() and (found < 9).all()
    assert found[1].tolist() == list(range(9))


def test_copies():
    x, _, rng = some(5, 3, 40)
    rows, chosen = np.array([0, 3]), rng.integers(0, 40, (2, 40))
    expected = np.stack([x[row][:, ancestors] for row, ancestors in zip(rows, chosen, strict=True)])
    assert np.array_equal(kernels.resampling.copies(x, rows, chosen), expected)


# Blocks


def test_bits_of_a_run_do_not_depend_on_the_block():
    runs, n, N, m = 40, 6, 77, 3
    x, log_weights, rng = some(runs, n, N)
    F, c = rng.standard_normal((runs, n, n)), rng.standard_normal((runs, n))
    G, xi = rng.standard_normal((runs, 1, n, n)), rng.standard_normal((runs, n, N))
    z, predicted = rng.standard_normal((runs, m)), rng.standard_normal((runs, N, m))
    R, u = np.stack([(run + 1) * np.eye(m) for run in range(runs)]), rng.random((runs, 1))
    angle = np.array([False, True, True])

    def outcome(rows):
        moved = kernels.particles.affine(x[rows], F[rows], c[rows])
        kernels.particles.add_noise(moved, G[rows], xi[rows])
        score = kernels.likelihood.gaussian(z[rows], predicted[rows], angle, R[rows])
        weighed = kernels.particles.weigh(moved, log_weights[rows], score)
        power = kernels.particles.power_that_leaves_half(log_weights[rows], 50 * score, np.ones(len(moved)), N / 2)
        return moved, score, power, kernels.resampling.ancestors(np.exp(weighed[0]), u[rows]), *weighed

    whole = outcome(slice(None))
    for run in (0, 1, 17, 39):
        for alone, together in zip(outcome(slice(run, run + 1)), whole, strict=True):
            assert np.array_equal(alone[0], together[run])
