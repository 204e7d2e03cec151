"""Differences of readings, against the standard library."""

import math

import numpy as np
import pytest

from relnav_sim import kernels
from relnav_sim.measurements.interface import MeasurementDefaults


class Angles(MeasurementDefaults):
    angles = (0, 2)


def test_angles_come_within_half_a_turn_and_nothing_else_changes():
    rng = np.random.default_rng(0)
    z, predicted = rng.uniform(-10, 10, (100, 5, 4)), rng.uniform(-10, 10, (100, 5, 4))
    z[0, 0, 1], z[0, 0, 3] = np.nan, np.inf
    found = kernels.angles.difference(z, predicted, np.array([1, 3]))
    np.testing.assert_array_equal(found[..., [0, 2]], (z - predicted)[..., [0, 2]])
    assert np.isnan(found[0, 0, [1, 3]]).all()
    expected = [math.remainder(angle, 2 * math.pi) for angle in (z - predicted)[1:, :, [1, 3]].ravel()]
    np.testing.assert_allclose(found[1:, :, [1, 3]].ravel(), expected, rtol=1e-12, atol=1e-14)
    inside = np.abs(z - predicted)[1:, :, 1] < math.pi
    np.testing.assert_array_equal(found[1:, :, 1][inside], (z - predicted)[1:, :, 1][inside])


@pytest.mark.parametrize(
    ("of", "to"),
    [
        ((7, 3), (7, 3)),
        ((1, 3), (7, 3)),
        ((7, 3), (3,)),
        ((7, 5, 3), (7, 1, 3)),
        ((7, 1, 3), (7, 5, 3)),
        ((1, 5, 3), (7, 5, 3)),
        ((5, 3), (7, 5, 3)),
        ((7, 1, 1, 3), (7, 2, 5, 3)),
    ],
)
def test_residuals_broadcast_like_numpy_whatever_lies_where_in_memory(of, to):
    rng = np.random.default_rng(1)
    z, predicted = rng.uniform(-4, 4, of), rng.uniform(-4, 4, to)
    plain = z - predicted
    for i in (0, 2):
        turned = [math.remainder(angle, 2 * math.pi) for angle in plain[..., i].ravel()]
        plain[..., i] = np.reshape(turned, plain.shape[:-1])
    for one in (z, np.asfortranarray(z)):
        for other in (predicted, np.asfortranarray(predicted)):
            found = Angles().residual(one, other)
            assert found.shape == plain.shape
            np.testing.assert_allclose(found, plain, rtol=1e-12, atol=1e-14)
