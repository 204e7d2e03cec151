"""Sums of harmonics in loops against the same in a few words of NumPy; `tests/astro` has them against potentials."""

import numpy as np
import pytest

from relnav_sim import GravityField, kernels
from relnav_sim.kernels.spherical_harmonics import _sums


@pytest.mark.parametrize("degree, order", [(0, 0), (1, 1), (2, 0), (7, 7), (8, 3), (40, 40)])
def test_words_and_loops_agree(degree, order):
    series = GravityField.load("ggm05s", degree, order).series
    points = np.random.default_rng(0).normal(size=(9, 3)) * 4e6 + 3e6
    found, out = kernels.spherical_harmonics.at_points(series, points), np.empty((3, 1))
    for point, of_loops in zip(points, found, strict=True):
        _sums(series, point[:, None], 1, np.empty(0), out)
        np.testing.assert_allclose(out[:, 0], of_loops, rtol=0, atol=1e-14 * np.linalg.norm(of_loops))
