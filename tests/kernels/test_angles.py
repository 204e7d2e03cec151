"""Wrapping of angles in differences, against the standard library."""

import math

import numpy as np

from relnav_sim import kernels


def test_angles_come_within_half_a_turn_and_nothing_else_changes():
    rng = np.random.default_rng(0)
    given = rng.uniform(-20, 20, (500, 4))
    given[0, 1], given[1, 3] = np.nan, np.inf
    wrapped = given.copy()
    kernels.angles.wrap(wrapped, np.array([1, 3]))
    np.testing.assert_array_equal(wrapped[:, [0, 2]], given[:, [0, 2]])
    expected = [math.remainder(angle, 2 * math.pi) for angle in given[2:, [1, 3]].ravel()]
    np.testing.assert_allclose(wrapped[2:, [1, 3]].ravel(), expected, rtol=1e-12, atol=1e-14)
    inside = np.abs(given[2:, 1]) < math.pi
    np.testing.assert_array_equal(wrapped[2:, 1][inside], given[2:, 1][inside])
    assert np.isnan(wrapped[0, 1]) and np.isnan(wrapped[1, 3])
    assert np.isfinite(np.delete(wrapped[:, [1, 3]], [0, 1], axis=0)).all()


def test_a_difference_that_is_not_in_c_order_is_wrapped_alike():
    from relnav_sim.measurements.interface import MeasurementDefaults

    class Angles(MeasurementDefaults):
        angles = (0, 2)

    rng = np.random.default_rng(1)
    z, predicted = rng.uniform(-4, 4, (5, 1, 3)), rng.uniform(-4, 4, (5, 3, 40)).swapaxes(1, 2)
    found = Angles().residual(z, predicted)
    np.testing.assert_array_equal(found, Angles().residual(z, np.ascontiguousarray(predicted)))
    assert not found.flags.c_contiguous
