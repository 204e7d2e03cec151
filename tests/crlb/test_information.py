"""The information of readings: of mixtures, of noise that depends on the state, and of readings that lack channels."""

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.crlb.fisher import mixture_information
from relnav_sim.crlb.information import SensorInformation, joint_information
from relnav_sim.measurements.interface import joint_components
from relnav_sim.sensors import SensorSuite, filter_inputs, reading_probability, sensor_measurement
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

TEXT = """
name: readings
seed: 3
runs: 4
clock: {duration_s: 40, step_s: 1, store_every_s: 4}
truth:
  chief: {orbit: {a_km: 6978.137, e: 0, i_deg: 50}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [300, -1000, 200], velocity_m_s: [0, 15, 0]}, mass_kg: 1, area_m2: 1}
  forces: {zonals: 0, drag: none}
sensors:
  radar: {range_sigma_m: 5, angle_sigma_deg: 0.1}
  camera: {kind: seen}
  laser: {kind: ranged}
  star_tracker: {cross_boresight_sigma_arcsec: 100, about_boresight_sigma_arcsec: 300}
start: {kind: dispersed, position_sigma_m: 50, velocity_sigma_m_s: 0.1}
statistics: {settle_s: 10, convergence_hold_s: 5}
filters:
  ekf: {kind: ekf, sensors: [radar]}
"""
MIXTURE = "{kind: mixture, scale: 5, fraction: 0.2}"


def situation(*overrides):
    """Return a case, its true states at all epochs, and the relative ones (1, K, 6)."""
    config = parse_campaign(TEXT, overrides).cases[0].config
    truth = truth_trajectory(config.truth, 40, RandomSource(3, (0,))).at(np.arange(41.0))
    return config, truth, truth.relative


@pytest.mark.parametrize("name, shared", [("camera", True), ("camera", False), ("laser", True)])
def test_a_mixture_counts_as_it_is_in_any_channels(own_sensors, name, shared):
    noise = MIXTURE.replace("fraction", f"shared: {str(shared).lower()}, fraction")
    config, _, states = situation(f"sensors.{name}.noise={noise}")
    orbit = nominal_chief(config.truth)
    told = sensor_measurement(name, config.sensors, orbit, 1.0, assumed_noise="mixture")
    found = SensorInformation(name, config, states).at(states, np.ones((1, 41, told.dimension)), np.arange(41))
    for k in (0, 17, 40):
        state = states[:, k]
        weights, covariances = joint_components(told.mixture(state, 0))
        H = told.jacobian(state, 0)[0]
        expected = H.T @ mixture_information(weights, np.broadcast_to(covariances, (1, *covariances.shape[-3:]))[0]) @ H
        scale = np.sqrt(np.abs(expected).max())
        assert np.abs(found[k] - expected).max() < 2e-3 * scale**2


def test_several_sensors_add_up_and_a_gaussian_is_its_covariance(own_sensors):
    config, _, states = situation(f"sensors.camera.noise={MIXTURE}")
    orbit = nominal_chief(config.truth)
    names = ("radar", "camera", "laser")
    sensors = {name: SensorInformation(name, config, states, mixture=False) for name in names}
    models = {name: sensor_measurement(name, config.sensors, orbit, 1.0) for name in names}
    chances = {name: np.ones((1, 41, model.dimension)) for name, model in models.items()}
    found = joint_information(sensors, states, chances, np.arange(41))
    state = states[:, 7]
    expected = np.zeros((6, 6))
    for model in models.values():
        H, R = model.jacobian(state, 7)[0], np.broadcast_to(model.noise(state, 7), (1, *[model.dimension] * 2))[0]
        expected += H.T @ np.linalg.solve(R, H)
    np.testing.assert_allclose(found[7], expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    mixed = SensorInformation("camera", config, states).at(states, chances["camera"], np.arange(41))
    assert (
        np.linalg.eigvalsh(mixed[7] - sensors["camera"].at(states, chances["camera"], np.arange(41))[7])[-1] > 0
    )  # knowing it helps


def test_lost_channels_count_as_often_as_they_are_lost(own_sensors):
    """Against the mean over simulated readings, each with the information of the channels that it has."""
    outage = "{kind: outage, rate_per_hour: 200, mean_duration_s: 15}"
    config, truth, states = situation(
        f"sensors.radar.noise=[{{kind: gaussian}}, {outage}]",
        f"sensors.star_tracker.noise=[{{kind: gaussian}}, {outage}]",
    )
    runs = 2000
    suite = SensorSuite(config.sensors, RandomSource(5, tuple(range(runs))), 1.0)
    z = filter_inputs(config.sensors, suite.measure(truth, 0), truth)["radar"]["spherical"]
    present = np.isfinite(z)
    assert {tuple(row) for row in present[:, 40].tolist()} == {(True,) * 3, (True, False, False), (False,) * 3}
    radar = sensor_measurement("radar", config.sensors, nominal_chief(config.truth), 1.0, assumed_noise="nominal")
    chance = reading_probability(config.sensors, "radar", truth, 0, 1.0)
    found = SensorInformation("radar", config, states).at(states, chance, np.arange(41))
    for k in (0, 10, 40):
        H, R = radar.jacobian(states[:, k], k)[0], radar.noise(states[:, k], k)[0]
        whole, part = H.T @ np.linalg.solve(R, H), np.outer(H[0], H[0]) / R[0, 0]
        kinds = present[:, k].sum(axis=1)
        each = np.where((kinds == 3)[:, None, None], whole, 0) + np.where((kinds == 1)[:, None, None], part, 0)
        error = each.std(axis=0) / np.sqrt(runs)
        assert (np.abs(each.mean(axis=0) - found[k]) <= 4.5 * error + 1e-12 * np.abs(whole).max()).all()


def test_a_range_without_its_angles_has_its_own_mixture(own_sensors):
    """With the star tracker out, a shared switch says nothing that the angles could have told."""
    config, truth, states = situation(
        f"sensors.radar.noise={MIXTURE}",
        "sensors.star_tracker.noise=[{kind: gaussian}, {kind: outage, windows_s: [[0, 99]]}]",
    )
    chance = reading_probability(config.sensors, "radar", truth, 0, 1.0)
    np.testing.assert_array_equal(chance[0, 5], [1, 0, 0])
    found = SensorInformation("radar", config, states).at(states, chance, np.arange(41))[5]
    (level,) = mixture_information([0.8, 0.2], [[[25.0]], [[625.0]]]).ravel()
    u = states[0, 5, :3] / np.linalg.norm(states[0, 5, :3])
    np.testing.assert_allclose(found[:3, :3], level * np.outer(u, u), rtol=1e-6, atol=1e-9)
