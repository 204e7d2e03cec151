"""Merging of the components of Gaussian mixtures, against all pairs anew each time."""

import numpy as np
import pytest
from checks import assert_close
from mixtures import mixture, plain_moments

from relnav_sim import kernels


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


def test_a_run_is_its_own():
    w, x, P = mixture(np.random.default_rng(9), 30, 40, 3)
    P[:, ::3, :, 2] = P[:, ::3, 2] = 0.0
    whole = kernels.merging.reduce(w, x, P, 5)
    for run in (0, 15, 29):
        alone = kernels.merging.reduce(w[run : run + 1], x[run : run + 1], P[run : run + 1], 5)
        for one, many in zip(alone, whole, strict=True):
            np.testing.assert_array_equal(one[0], many[run])
    w[4], x[5], P[6] = np.nan, np.nan, np.nan
    others = np.delete(np.arange(30), [4, 5, 6])
    for broken, sound in zip(kernels.merging.reduce(w, x, P, 5), whole, strict=True):
        np.testing.assert_array_equal(broken[others], sound[others])
