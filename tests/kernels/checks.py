"""What every kernel must keep to, whatever it computes, and what many are given."""

import numpy as np

SIZES = [(1, 1, 1), (2, 1, 3), (6, 3, 1), (6, 3, 50), (8, 3, 33), (12, 6, 32), (6, 3, 500)]
"""States, channels and runs."""


def covariances(rng, *shape):
    """Return matrices (..., n, n), of a shape (..., n), that are well conditioned."""
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ A.swapaxes(-1, -2) + 0.1 * np.eye(shape[-1])


def cross_matrix(r):
    """Return [r x]."""
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def assert_close(found, expected, rtol=1e-12):
    """Compare to a share of the largest entry of each run."""
    scale = np.abs(expected).reshape(len(expected), -1).max(axis=1).reshape(-1, *[1] * (expected.ndim - 1))
    np.testing.assert_array_less(np.abs(found - expected), rtol * np.maximum(scale, 1.0) * np.ones(expected.shape))


def check_runs_are_alone(kernel, by_run, *shared):
    """Compare a block of runs with each run by itself, and with blocks in which another run is not a number.

    Args:
        kernel: Takes the arrays of `by_run`, then those that all runs share.
        by_run: Arrays (runs, ...), at least two runs.
        shared: The rest.
    """
    whole = results(kernel(*(x.copy() for x in by_run), *shared))
    runs = len(by_run[0])
    for run in {0, runs // 2, runs - 1}:
        own = results(kernel(*(x[run : run + 1].copy() for x in by_run), *shared))
        for one, many in zip(own, whole, strict=True):
            np.testing.assert_array_equal(one[0], many[run])
    for place in range(len(by_run)):
        if by_run[place].dtype == np.float64:
            spoilt = [x.copy() for x in by_run]
            spoilt[place][1] = np.nan
            broken = results(kernel(*spoilt, *shared))
            for one, many in zip(broken, whole, strict=True):
                np.testing.assert_array_equal(np.delete(one, 1, axis=0), np.delete(many, 1, axis=0))
            assert any(np.isnan(one[1]).any() for one in broken if one.dtype == np.float64)


def results(returned):
    """Return the arrays of what a kernel returns, which may count failures besides."""
    return [one for one in (returned if isinstance(returned, tuple) else (returned,)) if isinstance(one, np.ndarray)]
