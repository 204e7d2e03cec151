"""Which particles are copied, against a search through the cumulative weights."""

import numpy as np
import pytest

from relnav_sim import kernels


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
    rng = np.random.default_rng(0)
    x = rng.standard_normal((5, 3, 40))
    rows, chosen = np.array([0, 3]), rng.integers(0, 40, (2, 40))
    expected = np.stack([x[row][:, ancestors] for row, ancestors in zip(rows, chosen, strict=True)])
    assert np.array_equal(kernels.resampling.copies(x, rows, chosen), expected)


def test_ancestors_of_a_run_are_its_own():
    rng = np.random.default_rng(1)
    weights, u = rng.random((20, 57)), rng.random((20, 1))
    whole = kernels.resampling.ancestors(weights, u)
    for run in (0, 7, 19):
        alone = kernels.resampling.ancestors(weights[run : run + 1], u[run : run + 1])
        np.testing.assert_array_equal(alone[0], whole[run])
