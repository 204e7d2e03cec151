"""A measurement with known latency: the base measurement of the state some time ago."""

import numpy as np
import pytest

from relnav_sim import LinearMeasurement
from relnav_sim.measurements.delayed import Delayed, with_latency
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

NOISE = SightNoise(
    np.array([0.8, 0.2]),
    np.array([[2.0, 1e-3, 1e-3], [9.0, 5e-3, 5e-3]]),
    np.array([2.0, 1e-3, 1e-3]),
    np.diag([1e-8, 2e-8, 3e-8]),
    "mixture",
)
LATENCY_S = 0.7


@pytest.fixture
def states():
    return np.array([100.0, 3000.0, -200.0, 3.0, -8.0, 1.0]) + np.random.default_rng(1).normal(size=(9, 6))


@pytest.fixture
def earlier(states):
    moved = states.copy()
    moved[:, :3] -= LATENCY_S * states[:, 3:]
    return moved


def test_everything_is_the_bases_at_the_earlier_state(states, earlier):
    base = SphericalRadar(np.eye(3), NOISE)
    late = Delayed(base, LATENCY_S)
    z = base.predict(earlier, 0) + np.array([1.0, 1e-3, -1e-3])
    for name in ("predict", "noise"):
        np.testing.assert_array_equal(getattr(late, name)(states, 0), getattr(base, name)(earlier, 0))
    np.testing.assert_array_equal(late.mixture(states, 0).covariances, base.mixture(earlier, 0).covariances)
    np.testing.assert_allclose(late.log_likelihood(z, states, 0), base.log_likelihood(z, earlier, 0), rtol=1e-12)
    particle_set, cloud_earlier = (np.repeat(x[:, None], 4, axis=1) for x in (states, earlier))
    np.testing.assert_array_equal(late.predict(particle_set, 0), base.predict(cloud_earlier, 0))


def test_the_jacobian_is_the_derivative_and_states_stay_as_they_are(states):
    late, before = Delayed(SphericalRadar(np.eye(3), NOISE), LATENCY_S), states.copy()
    expected = MeasurementDefaults.jacobian(late, states, 0)
    np.testing.assert_allclose(late.jacobian(states, 0), expected, atol=1e-7)  # differences of 3 km
    np.testing.assert_array_equal(states, before)


def test_angles_wrap():
    late = Delayed(SphericalRadar(np.eye(3), NOISE), LATENCY_S)
    residual = late.residual(np.array([[1.0, 3.1, 0.0]]), np.array([[1.0, -3.1, 0.0]]))
    assert residual[0, 1] == pytest.approx(6.2 - 2 * np.pi)


@pytest.mark.parametrize("constant_s", [0.0, 0.4])
def test_latencies_told_with_the_readings_are_those_of_single_constant_ones(states, constant_s):
    base = SphericalRadar(np.eye(3), NOISE)
    told = Delayed(base, constant_s, told=True)
    own_s = np.random.default_rng(2).uniform(0, 3, size=(len(states), 4))
    z = np.random.default_rng(3).normal(size=(len(states), 4, 3))
    own_s[0, 1] = np.nan  # nothing is read
    np.testing.assert_array_equal(told.take(with_latency(z, own_s), first_epoch=10), z)
    for run in range(1, len(states)):
        row = slice(run, run + 1)
        for k in range(4):
            alone = Delayed(base, constant_s + own_s[run, k])
            for name in ("predict", "jacobian", "noise"):
                expected = getattr(alone, name)(states[row], 10 + k)
                np.testing.assert_array_equal(getattr(told, name)(states, 10 + k)[row], expected)
            found = told.linearised(z[:, k], states, 10 + k)
            for one, other in zip(found, alone.linearised(z[row, k], states[row], 10 + k), strict=True):
                np.testing.assert_array_equal(one[row], other)
    cloud = np.repeat(states[:, None], 5, axis=1)
    np.testing.assert_array_equal(told.predict(cloud, 12)[:, 3], told.predict(states, 12))


def test_a_constant_jacobian_differs_between_runs_whose_latencies_do():
    told = Delayed(LinearMeasurement(np.eye(3, 6), np.eye(3)), 0.0, told=True)
    told.take(with_latency(np.zeros((2, 1, 3)), np.array([[1.0], [2.0]])), 0)
    H = told.jacobian(np.zeros((2, 6)), 0)
    np.testing.assert_array_equal(H[:, :, 3:], [-np.eye(3), -2 * np.eye(3)])
