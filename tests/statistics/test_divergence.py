"""The three signs of a lost run, one by one."""

import numpy as np

from relnav_sim.statistics.divergence import diverged, far_beyond_bound


def test_failed_or_long_outside_the_ellipsoid() -> None:
    failed = np.array([False, True, False, False, False])
    outside = np.array([0.05, np.nan, 0.051, np.nan, 1.0])
    assert diverged(failed, outside).tolist() == [False, True, True, False, True]


def test_ten_times_the_bound_for_50_s_on_end() -> None:
    time_s = 10.0 * np.arange(20)
    bound = np.linspace(2, 1, 20)
    r = np.ones((6, 20))
    r[1, 3:9] = 25  # six stored epochs: 50 s
    r[2, 3:8] = 25  # five: 40 s
    r[3, [3, 4, 5, 7, 8, 9, 10]] = 25  # interrupted
    r[4] = 10 * bound  # at the limit, not beyond it
    r[5, 10:] = np.nan  # failed: seen elsewhere
    assert far_beyond_bound(r, time_s, bound).tolist() == [False, True, False, False, False, False]
    bound[5] = np.nan
    assert not far_beyond_bound(r, time_s, bound).any()
