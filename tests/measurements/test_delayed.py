"""A measurement with known latency: the base measurement of the state some time ago."""

import numpy as np
import pytest

from relnav_sim.measurements.delayed import Delayed
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
