"""Sensors on the deputy of an elliptic orbit: what filters, the bound and first fixes predict against the truth flown.

The truth's craft are followed in inertial space and each has its own orbit frame: no relative motion, no nominal orbit.
"""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.campaign import parse_campaign
from relnav_sim.crlb.information import SensorInformation
from relnav_sim.measurements import first_fix, radar
from relnav_sim.sensors import relative_sensors, sensor_measurement
from relnav_sim.sensors.availability import sensed
from relnav_sim.simulation.host_orbits import believed_orbit, believed_orbit_at
from relnav_sim.streams import RandomSource
from relnav_sim.truth import truth_trajectory

STEP_S = 100.0
TEXT = """
name: elliptic_host
seed: 1
runs: 1
clock: {duration_s: 86400, step_s: 100, store_every_s: 100}
truth:
  chief: {orbit: {altitude_km: 600, e: 0, i_deg: 50, argp_deg: 40, ta_deg: 30}, mass_kg: 300, area_m2: 2}
  deputy: {shape: {kind: trailing, along_track_m: -8000}, mass_kg: 300, area_m2: 2}
  forces: {zonals: 4, drag: none}
sensors:
  radar: {host: deputy, range_sigma_m: 2, angle_sigma_deg: 0.02}
start: {kind: first_fix, velocity_sigma_m_s: 1}
filters:
  ekf: {kind: ekf}
"""

START = "start={kind: dispersed, position_sigma_m: 1, velocity_sigma_m_s: 1}"


def situation(e, *more):
    """Return the case and its truth over a day."""
    config = parse_campaign(TEXT, [f"truth.chief.orbit.e={e}", *more]).cases[0].config
    times_s = np.arange(config.clock.epochs) * STEP_S
    return config, truth_trajectory(config.truth, config.clock.duration_s, RandomSource(1, (0,))).at(times_s)


def read(config, truth, name="radar"):
    """The sensor's reading without noise, (K, 3), by the geometry in inertial space."""
    sight = relative_sensors(config.sensors)[name].true_sight(sensed(truth, "deputy", STEP_S))
    return np.stack(sight, axis=-1)[0]


def told(config, **how):
    return sensor_measurement("radar", config.sensors, believed_orbit(config), STEP_S, **how)


@pytest.mark.parametrize("e", [0.0, 0.001, 0.1, 0.3, 0.7])
def test_what_is_predicted_is_what_is_read_over_a_day(e):
    """To J2's thousandth of the angle between the two orbit frames; for e = 0.1 a circle errs by a tenth of it."""
    config, truth = situation(e)
    z, model = read(config, truth), told(config)
    predicted = np.concatenate([model.predict(truth.relative[:, k], k) for k in range(truth.relative.shape[1])])
    errors = model.residual(z, predicted)
    distance = np.linalg.norm(truth.relative[0, :, :3], axis=1)
    assert np.abs(errors[:, 0]).max() < 1e-6
    assert (np.abs(errors[:, 1:]).max(axis=1) < 4e-3 * distance / np.linalg.norm(truth.chief[0, :, :3], axis=1)).all()


def test_derivatives_first_fixes_and_the_bound_are_those_of_the_moment():
    config, truth = situation(0.3)
    model, x = told(config), truth.relative[0]
    by_hand = SensorInformation("radar", config, x[None]).at(x[None], np.ones((1, len(x), 3)), np.arange(len(x)))
    for k in (0, 17, 500):
        H = model.jacobian(x[k : k + 1], k)[0]
        for j, width in enumerate(np.repeat([1.0, 1e-2], 3)):
            step = width * np.eye(6)[j]
            around = model.predict(np.stack([x[k] + step, x[k] - step]), k)
            slope = model.residual(around[0], around[1]) / (2 * width)
            np.testing.assert_allclose(H[:, j], slope, rtol=1e-5, atol=1e-9)
        R = model.noise(x[k : k + 1], k)
        np.testing.assert_allclose(by_hand[k], H.T @ np.linalg.solve(R, H), rtol=1e-9)
        at_rest = np.concatenate([x[k : k + 1, :3] + [[500.0, 0.0, 900.0]], np.zeros((1, 3))], axis=1)
        position, _ = first_fix(model, model.predict(at_rest, k), k)
        np.testing.assert_allclose(position, at_rest[:, :3], atol=1e-6)


def test_a_latency_puts_the_chief_where_it_was():
    """Against the truth that long ago, to what a constant velocity leaves out: the acceleration times half of t^2."""
    config, _ = situation(0.7, "sensors.radar.latency_s=10", START)
    now = truth_trajectory(config.truth, 86400, RandomSource(1, (0,))).at(np.arange(1, 200) * STEP_S)
    then = truth_trajectory(config.truth, 86400, RandomSource(1, (0,))).at(np.arange(1, 200) * STEP_S - 10)
    model = told(config)
    predicted = np.concatenate([model.predict(now.relative[:, k - 1], k) for k in range(1, 200)])
    errors = model.residual(read(config, then), predicted)
    acceleration = np.linalg.norm(np.gradient(now.relative[0, :, 3:6], STEP_S, axis=0), axis=1)
    allowed = 1.5 * acceleration * 10**2 / 2 / np.linalg.norm(now.relative[0, :, :3], axis=1)
    assert (np.abs(errors[:, 1:]).max(axis=1) < allowed + 5e-6).all()


def test_an_elliptic_orbit_needs_the_step():
    orbit = ChiefOrbit(8.0e6, 0.1, 0.9, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="needs step_s"):
        radar(range_sigma_m=1, angle_sigma_deg=0.1, host="deputy", chief_orbit=orbit)
    radar(range_sigma_m=1, angle_sigma_deg=0.1, chief_orbit=orbit)  # to a sensor on the chief it does not matter


def test_a_start_at_a_late_fix_is_where_the_deputy_was():
    """A noiseless reading of the truth gives the true position, to the tilt by the relative velocity."""
    config, truth = situation(0.7)
    k = 300
    z = read(config, truth)[None, [k]]
    orbit = believed_orbit_at(config, "radar", k * STEP_S)
    model = sensor_measurement("radar", config.sensors, orbit, STEP_S, assumed_noise="nominal")
    position, _ = relative_sensors(config.sensors)["radar"].first_fix(model, z[:, 0])
    true = truth.relative[0, k]
    tilt = np.abs(true[5]) / np.linalg.norm(truth.chief[0, k, 3:]) + 4e-3 * 8e3 / 7e6
    assert np.linalg.norm(position[0] - true[:3]) < 2 * tilt * np.linalg.norm(true[:3])
