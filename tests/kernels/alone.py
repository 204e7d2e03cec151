"""What every kernel must keep to: a run's bits are its own, whatever the block."""

import numpy as np


def check_runs_are_alone(kernel, by_run, *shared):
    """Compare a block of runs with each run by itself, and with a block in which another run is not a number."""
    whole = results(kernel(*by_run, *shared))
    for run in (0, len(by_run[0]) // 2, len(by_run[0]) - 1):
        own = results(kernel(*(np.ascontiguousarray(x[run : run + 1]) for x in by_run), *shared))
        for one, many in zip(own, whole, strict=True):
            np.testing.assert_array_equal(one[0], many[run])
    spoilt = [x.copy() for x in by_run]
    spoilt[0][1] = np.nan
    for broken, many in zip(results(kernel(*spoilt, *shared)), whole, strict=True):
        np.testing.assert_array_equal(np.delete(broken, 1, axis=0), np.delete(many, 1, axis=0))
        assert np.isnan(broken[1]).any()


def results(returned):
    return returned if isinstance(returned, tuple) else (returned,)
