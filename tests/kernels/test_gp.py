"""The Gaussian process's prediction beside its formulas in extended precision."""

import numpy as np
import pytest

from relnav_sim import kernels


def process(S, d, q, seed=0):
    """Return centre, lengths, inputs, weights and a whitener that is well conditioned."""
    rng = np.random.default_rng(seed)
    whitener = np.tril(rng.standard_normal((S, S))) / np.sqrt(S) + np.eye(S)
    return rng.normal(3, 1, d), rng.uniform(0.5, 4, d), rng.standard_normal((S, d)), rng.normal(size=(S, q)), whitener


def points_of(P, d, seed=1):
    return np.random.default_rng(seed).normal(3, 2, (P, d))


def by_the_book(points, centre, length, inputs, weights, whitener):
    """Return means, explained shares and slopes, and for each how large the numbers are that it is a sum of."""
    offsets = inputs.astype(np.longdouble) - ((points - centre.astype(np.longdouble)) / length)[:, None]
    c = np.exp(-0.5 * np.square(offsets).sum(axis=-1))
    white = c @ whitener.T.astype(np.longdouble)
    explained = np.square(white).sum(axis=-1)
    mean, slopes = c @ weights, np.einsum("sq,ps,psd->pqd", weights, c, offsets)
    sizes = (
        c @ np.abs(weights),
        np.square(c @ np.abs(whitener.T)).sum(axis=-1),
        np.einsum("sq,ps,psd->pqd", np.abs(weights), c, np.abs(offsets)),
    )
    return (mean, explained, slopes), sizes


SIZES = [(1, 1, 1, 1), (7, 3, 2, 2), (8, 4, 6, 1), (9, 30, 6, 6), (64, 33, 1, 5), (65, 102, 8, 6), (1000, 51, 12, 3)]


@pytest.mark.parametrize(("P", "S", "d", "q"), SIZES)
def test_predictions_are_those_of_the_formulas(P, S, d, q):
    points, given = points_of(P, d), process(S, d, q)
    expected, sizes = by_the_book(points, *given)
    found = (*kernels.gp.predict(points, *given, True, True), kernels.gp.slopes(points, *given[:-1]))
    for have, want, size in zip(found, expected, sizes, strict=True):
        assert (np.abs(have - want) <= 1e-12 * size).all()


@pytest.mark.parametrize("S", [1, 6, 100])
def test_bits_of_a_point_depend_neither_on_the_others_nor_on_what_is_asked(S):
    points, given = points_of(150, 6), process(S, 6, 6)
    mean, explained = kernels.gp.predict(points, *given, True, True)
    slopes = kernels.gp.slopes(points, *given[:-1])
    for part in (slice(0, 1), slice(149, 150), slice(3, 10), slice(50, 63), slice(60, 125), slice(1, 150)):
        some = points[part]
        for with_mean, with_variance in ((True, True), (True, False), (False, True)):
            means, shares = kernels.gp.predict(some, *given, with_mean, with_variance)
            np.testing.assert_array_equal(means, mean[part] if with_mean else np.zeros_like(means))
            np.testing.assert_array_equal(shares, explained[part] if with_variance else np.zeros_like(shares))
        np.testing.assert_array_equal(kernels.gp.slopes(some, *given[:-1]), slopes[part])


@pytest.mark.parametrize("P", [3, 20, 70])
def test_a_point_that_is_no_number_stays_alone_and_one_far_away_knows_nothing(P):
    points, given = points_of(P, 2), process(11, 2, 3)
    mean, explained = kernels.gp.predict(points, *given, True, True)
    points[1, 0], points[2] = np.nan, 1e200
    means, shares = kernels.gp.predict(points, *given, True, True)
    slopes = kernels.gp.slopes(points, *given[:-1])
    assert np.isnan(means[1]).all() and np.isnan(shares[1]) and np.isnan(slopes[1]).all()
    assert not means[2].any() and shares[2] == 0
    others = np.delete(np.arange(P), [1, 2])
    np.testing.assert_array_equal(means[others], mean[others])
    np.testing.assert_array_equal(shares[others], explained[others])
    assert np.isfinite(slopes[others]).all()
