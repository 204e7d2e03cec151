"""What sources leave in a filter's error, against the recursion of [e; s] in matrices."""

import numpy as np
import pytest

from relnav_sim import kernels
from relnav_sim.kernels.compiling import interpreted


def draw(S=4, T=30, n=5):
    rng = np.random.default_rng(8)
    M, g = 0.4 * rng.normal(size=(T, n, n)), rng.normal(size=(S, T, n))
    root = rng.normal(size=(S, n, n))
    return M, g, np.linspace(0.0, 1.0, S), rng.uniform(0.5, 2.0, S), root @ root.swapaxes(1, 2)


def test_variances_are_those_of_the_error_and_the_source_together():
    M, g, phi, v, P0 = draw()
    found = kernels.budget.variances(M, g, phi, v, P0)
    S, T, n = g.shape
    for s in range(S):
        # s_k = phi s_{k-1} + eta_k, e_k = M e_{k-1} + g s_k
        both = np.zeros((n + 1, n + 1))
        both[:n, :n], both[n, n] = P0[s], v[s]
        both[:n, n] = both[n, :n] = v[s] * g[s, 0]
        for k in range(1, T):
            A, eta = np.zeros((n + 1, n + 1)), np.append(g[s, k], 1.0)
            A[:n, :n], A[:n, n], A[n, n] = M[k], phi[s] * g[s, k], phi[s]
            both = A @ both @ A.T + (1 - phi[s] ** 2) * v[s] * np.outer(eta, eta)
            np.testing.assert_allclose(found[s, k], both.diagonal()[:n], rtol=1e-11)


def test_means_follow_their_recursion():
    M, b, *_ = draw()
    found = kernels.budget.means(M, b, b[:, 0].copy())
    m = b[:, 0]
    for k in range(1, len(M)):
        m = m @ M[k].T + b[:, k]
        np.testing.assert_allclose(found[:, k], m, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("place", [1, 4])
def test_a_source_is_alone(place):
    M, g, phi, v, P0 = draw()
    whole = kernels.budget.variances(M, g, phi, v, P0)
    g[place % 4] = np.nan
    other = kernels.budget.variances(M, g, phi, v, P0)
    sound = np.arange(4) != place % 4
    np.testing.assert_array_equal(other[sound], whole[sound])
    assert np.isnan(other[~sound, 1:]).all()


def test_plain_python_agrees():
    given = draw(S=2, T=4, n=3)
    compiled = kernels.budget.variances(*given)
    with interpreted():
        np.testing.assert_allclose(kernels.budget.variances(*given), compiled, rtol=1e-13)
