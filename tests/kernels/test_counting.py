"""What is added up over the epochs of each run, against plain NumPy."""

import numpy as np
import pytest

from relnav_sim import kernels
from relnav_sim.statistics.quantiles import BIN_RULE, BINS, bin_of

SIZES = [(1, 1), (1, 40), (7, 300), (50, 12)]
LIMITS = np.array([[1.0, 2.0, 3.0], [3.0, 4.0, 5.0]])


def draw(runs, epochs, share=0.8, seed=3):
    """Return errors, two NEES, log-likelihoods, a NIS that is often missing, and what counts."""
    rng = np.random.default_rng(seed)
    error = rng.normal(size=(runs, epochs, 6)) * [1, 10, 100, 1e-3, 1e-2, 1e-1] + 0.5
    nees, log_likelihood = rng.chisquare(3, size=(2, runs, epochs)), rng.normal(size=(runs, epochs))
    nis = np.where(rng.random((runs, epochs)) < 0.7, rng.chisquare(3, size=(runs, epochs)), np.nan)
    return error, nees, log_likelihood, nis, rng.random((runs, epochs)) < share


def count_errors(error, nees, log_likelihood, counted, first, stop, places=None):
    places = np.zeros((2, len(error), BINS), dtype=np.int32) if places is None else places
    distance = np.full(counted.shape, np.inf)
    found = kernels.counting.errors(
        error, nees, log_likelihood, counted, first, stop, LIMITS, BIN_RULE, places, distance
    )
    return (*found, places, distance)


def plain_moments(values):
    """Return mean, squared deviations and largest size of (count, q), 0 of nothing."""
    if not len(values):
        return np.zeros((3, values.shape[1]))
    return np.array([values.mean(axis=0), np.square(values - values.mean(axis=0)).sum(axis=0), abs(values).max(axis=0)])


@pytest.mark.parametrize(("runs", "epochs"), SIZES)
def test_errors_against_plain_numpy(runs, epochs):
    error, nees, log_likelihood, _, counted = draw(runs, epochs)
    first, stop = epochs // 4, epochs
    count, sums, totals, inside, places, distance = count_errors(error, nees, log_likelihood, counted, first, stop)
    for run in range(runs):
        own = first + np.flatnonzero(counted[run, first:stop])
        e = error[run, own]
        r, v = np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1)
        quantities = np.concatenate([e, r[:, None], v[:, None]], axis=1)
        assert count[run] == len(own)
        np.testing.assert_allclose(sums[..., run], plain_moments(quantities), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(totals[:2, run], nees[:, run, own].sum(axis=1), rtol=1e-12)
        np.testing.assert_allclose(totals[2, run], log_likelihood[run, own].sum(), rtol=1e-12, atol=1e-12)
        within = (nees[:, None, run, own] <= LIMITS[..., None]).sum(axis=-1)
        np.testing.assert_array_equal(inside[..., run], within)
        np.testing.assert_allclose(distance[run, own], r, rtol=1e-15)
        assert np.isinf(np.delete(distance[run], own)).all()
        # The norms' own bits tell the bins: a norm on an edge may round either way.
        np.testing.assert_array_equal(places[0, run], np.bincount(bin_of(distance[run, own]), minlength=BINS))
        assert places[1, run].sum() == len(own)


def test_bins_go_on_and_have_an_end():
    error, nees, log_likelihood, _, counted = draw(1, 4, share=2.0)
    error[0, :, :3] = [[0, 0, 0], [1e-200, 0, 0], [1e200, 0, 0], [3, 4, 0]]
    places = np.ones((2, 1, BINS), dtype=np.int32)
    count_errors(error, nees, log_likelihood, counted, 0, 4, places)
    expected = np.ones(BINS)
    expected[[0, BINS - 1, int(bin_of(np.array([5.0]))[0])]] += [2, 1, 1]
    np.testing.assert_array_equal(places[0, 0], expected)


def test_what_does_not_count_may_be_anything():
    error, nees, log_likelihood, nis, counted = draw(3, 50)
    clean = count_errors(error, nees, log_likelihood, counted, 0, 50)
    neighbours = kernels.counting.successive(nis, counted, 0, 50)
    error[~counted], nees[:, ~counted], log_likelihood[~counted], nis[~counted] = np.nan, np.nan, np.nan, np.inf
    for one, other in zip(clean, count_errors(error, nees, log_likelihood, counted, 0, 50), strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(neighbours, kernels.counting.successive(nis, counted, 0, 50), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_run_counts_alone_as_among_others():
    error, nees, log_likelihood, nis, counted = draw(40, 60)
    together = count_errors(error, nees, log_likelihood, counted, 3, 50)
    neighbours = kernels.counting.successive(nis, counted, 3, 50)
    for run in (0, 17, 39):
        own = slice(run, run + 1)
        count, sums, totals, inside, places, distance = count_errors(
            error[own], np.ascontiguousarray(nees[:, own]), log_likelihood[own], counted[own], 3, 50
        )
        assert count[0] == together[0][run]
        for one, whole in zip((sums, totals, inside), together[1:4], strict=True):
            np.testing.assert_array_equal(one[..., 0], whole[..., run])
        np.testing.assert_array_equal(places[:, 0], together[4][:, run])
        np.testing.assert_array_equal(distance[0], together[5][run])
        _, alone = kernels.counting.successive(nis[own], counted[own], 3, 50)
        np.testing.assert_array_equal(alone[:, 0], neighbours[1][:, run])


@pytest.mark.parametrize("share", [0.0, 0.6, 2.0])
def test_moments_against_plain_numpy(share):
    rng = np.random.default_rng(8)
    values, counted = rng.normal(3, 1, size=(5, 70, 2)), rng.random((5, 70)) < share
    count, sums = kernels.counting.moments(values, counted, 10, 60)
    for run in range(5):
        own = values[run, 10:60][counted[run, 10:60]]
        assert count[run] == len(own)
        np.testing.assert_allclose(sums[..., run], plain_moments(own), rtol=1e-12)


@pytest.mark.parametrize(("runs", "epochs"), SIZES)
@pytest.mark.parametrize("share", [0.0, 0.3, 2.0])
def test_successive_against_plain_numpy(runs, epochs, share):
    *_, nis, counted = draw(runs, epochs, share)
    first = epochs // 5
    count, sums = kernels.counting.successive(nis, counted, first, epochs)
    for run in range(runs):
        x = nis[run, first:][counted[run, first:] & np.isfinite(nis[run, first:])]
        assert count[run] == len(x)
        np.testing.assert_allclose(sums[:3, run], plain_moments(x[:, None])[:, 0], rtol=1e-12)
        np.testing.assert_allclose(sums[3, run], (x[1:] * x[:-1]).sum(), rtol=1e-12)
        assert sums[4:, run].tolist() == ([x[0], x[-1]] if len(x) else [0.0, 0.0])


@pytest.mark.parametrize("window", [1, 2, 5, 12, 40])
def test_staying_as_numpy_has_it(window):
    x = np.abs(np.random.default_rng(6).normal(size=(4, 40))) * np.linspace(3, 1, 40)
    x[3, :30] = np.inf
    before = np.array([np.inf, 2.0, 0.5, np.inf])
    smallest, not_below, places = before.copy(), np.full(4, 7), np.ones((4, BINS), dtype=np.int32)
    kernels.counting.staying(x, window, 1.5, BIN_RULE, smallest, not_below, places)
    largest = np.lib.stride_tricks.sliding_window_view(x, window, axis=1).max(axis=-1)
    expected = np.minimum.accumulate(np.concatenate([before[:, None], largest], axis=1), axis=1)[:, 1:]
    np.testing.assert_array_equal(smallest, expected[:, -1])
    np.testing.assert_array_equal(not_below, 7 + (expected >= 1.5).sum(axis=1))
    np.testing.assert_array_equal(places, [1 + np.bincount(bin_of(row), minlength=BINS) for row in expected])
