"""Range, range rate and a range noise that grows with the distance, as filters see them."""

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.ranging import GrowingRangeNoise, Ranging, crosslink, lidar
from relnav_sim.measurements.several import JoinedMeasurement
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

ORBIT = ChiefOrbit(7.0e6, 0.0, 0.7, 0.0, 0.0, 0.0, 3.986004418e14, 6378137.0, 1.08263e-3)
MOUNTING_DEG = (20.0, 30.0, 40.0)
SIGHT = {"range_sigma_m": 0.05, "range_sigma_m_per_km": 2.0, "angle_sigma_deg": 0.1, "mounting_deg": MOUNTING_DEG}
ALL = {
    "rangefinder": lidar(range_sigma_m=0.05, range_sigma_m_per_km=2),
    "lidar": lidar(**SIGHT),
    "lidar on the deputy": lidar(**SIGHT, host="deputy", chief_orbit=ORBIT),
    "crosslink": crosslink(range_sigma_m=0.5, range_rate_sigma_m_s=0.01),
}


def states(*shape):
    rng = np.random.default_rng(4)
    return np.concatenate([rng.normal(size=(*shape, 3)) * 300, rng.normal(size=(*shape, 3))], axis=-1)


@pytest.mark.parametrize("name", ALL)
def test_the_jacobian_is_the_derivative(name):
    measurement = ALL[name]
    for x in (states(50), states(4, 7), np.concatenate([states(5), np.ones((5, 2))], axis=-1)):
        H = measurement.jacobian(x, 0)
        assert H.shape == (*x.shape[:-1], measurement.dimension, x.shape[-1])
        differences = MeasurementDefaults.jacobian(measurement, x, 0)
        size = np.abs(differences).max(axis=-1, keepdims=True)
        assert np.abs(H - differences).max() < 1e-7 * size.max()


def test_range_rate_is_the_derivative_of_the_range():
    x = states(40)
    link = ALL["crosslink"]
    moved = x.copy()
    moved[:, :3] += 1e-3 * x[:, 3:]
    back = x.copy()
    back[:, :3] -= 1e-3 * x[:, 3:]
    slope = (np.linalg.norm(moved[:, :3], axis=1) - np.linalg.norm(back[:, :3], axis=1)) / 2e-3
    assert np.allclose(link.predict(x, 0)[:, 1], slope, rtol=0, atol=1e-8)


def test_range_noise_grows_with_the_predicted_distance_and_nothing_else_changes():
    attitude = 1e-8 * np.diag([1.0, 2.0, 3.0])
    sigmas = np.array([0.05, 2e-3, 2e-3])
    wide = SightNoise(np.array([0.9, 0.1]), np.stack([sigmas, 4 * sigmas]), sigmas, attitude, "mixture")
    radar = SphericalRadar(np.eye(3), wide)
    grown = GrowingRangeNoise(radar, 2e-3 / 0.05)
    x = states(6)
    distance = np.linalg.norm(x[:, :3], axis=1)
    R, plain = grown.noise(x, 0), radar.noise(x, 0)
    assert np.allclose(R[:, 0, 0], (0.9 + 0.1 * 16) * (0.05 + 2e-3 * distance) ** 2, rtol=1e-12)
    R[:, 0, 0] = plain[:, 0, 0]
    assert np.array_equal(R, plain)
    components = grown.mixture(x, 0)
    expected = (np.array([1.0, 4.0]) * (0.05 + 2e-3 * distance)[:, None]) ** 2
    assert np.allclose(components.covariances[:, :, 0, 0], expected, rtol=1e-12)
    assert np.array_equal(components.covariances[:, :, 1:, 1:], radar.mixture(x, 0).covariances[:, :, 1:, 1:])
    assert np.array_equal(radar.noise(x, 0), plain)  # the base's own arrays are left alone


def test_the_rangefinder_is_the_range_of_the_lidar():
    x = states(9)
    sight, alone = lidar(range_sigma_m=0.05, range_sigma_m_per_km=2, angle_sigma_deg=1), ALL["rangefinder"]
    assert np.allclose(alone.predict(x, 0), sight.predict(x, 0)[:, :1], rtol=1e-14)
    assert np.allclose(alone.jacobian(x, 0), sight.jacobian(x, 0)[:, :1], rtol=0, atol=1e-14)
    assert np.allclose(alone.noise(x, 0), sight.noise(x, 0)[:, :1, :1], rtol=1e-14)
    assert (alone.depends_on, ALL["crosslink"].depends_on) == ((0, 1, 2), (0, 1, 2, 3, 4, 5))


@pytest.mark.parametrize("name", ALL)
def test_bits_do_not_depend_on_the_block(name):
    measurement, x = ALL[name], states(7)
    for part in (slice(0, 1), slice(2, 5)):
        assert np.array_equal(measurement.predict(x, 0)[part], measurement.predict(x[part], 0))
        assert np.array_equal(measurement.jacobian(x, 0)[part], measurement.jacobian(x[part], 0))
        R, own = measurement.noise(x, 0), measurement.noise(x[part], 0)
        assert np.array_equal(R if R.ndim == 2 else R[part], own)


def test_a_mixture_is_told_to_who_asks():
    noise = MixtureNoise(np.array([0.5, 0.5]), np.array([np.eye(2), 9 * np.eye(2)]))
    link = Ranging(noise)
    assert np.array_equal(link.noise(states(1), 0), 5 * np.eye(2))
    assert np.array_equal(link.mixture(states(1), 0).covariances, noise.covariances)


@pytest.mark.parametrize(
    "make, sentence",
    [
        (lambda: lidar(range_sigma_m=0.0), "range_sigma_m is 0; it must be positive"),
        (lambda: lidar(range_sigma_m=1, range_sigma_m_per_km=-1), "it must be 0 or more"),
        (lambda: lidar(range_sigma_m=1, angle_sigma_deg=0), "angle_sigma_deg is 0"),
        (lambda: lidar(range_sigma_m=1, angle_sigma_deg=1, host="deputy"), "orbit"),
        (lambda: crosslink(range_sigma_m=1, range_rate_sigma_m_s=np.inf), "positive and finite"),
        (lambda: Ranging(np.eye(3)), "there are range and range rate"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_sentence(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


@pytest.mark.parametrize("order", [("lidar", "link"), ("link", "lidar")])
def test_components_of_a_state_s_own_go_with_constant_ones(order):
    """A lidar's components move with the state and a link's don't: joined, every pair of them, in either order."""
    x = states(3)
    noise = MixtureNoise(np.array([0.7, 0.3]), np.array([[[1.0]], [[9.0]]]))
    models = {"lidar": GrowingRangeNoise(Ranging(noise), 0.01), "link": Ranging(noise)}
    joined = JoinedMeasurement([models[name] for name in order]).mixture(x, 0)
    assert np.allclose(joined.weights, [0.49, 0.21, 0.21, 0.09])
    growth = np.square(1 + 0.01 * np.linalg.norm(x[:, :3], axis=1))
    scale = np.stack([growth if name == "lidar" else np.ones(3) for name in order], axis=-1)
    pairs = np.array([[1, 1], [1, 9], [9, 1], [9, 9]])
    assert np.allclose(joined.covariances, (pairs * scale[:, None])[..., None] * np.eye(2), rtol=1e-12)
