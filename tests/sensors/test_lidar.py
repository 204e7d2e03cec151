"""The lidar: what it reads, how noisy at which distance, and what a filter is told of it."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2

from relnav_sim.sensors import SensorSuite, filter_inputs, sensor_measurement
from relnav_sim.sensors.availability import sensed
from relnav_sim.sensors.suite import streams_of

RANGE = {"kind": "lidar", "range_sigma_m": 0.05, "range_sigma_m_per_km": 2.0}
SIGHT = {**RANGE, "angle_sigma_deg": 0.1}
TANGENT = {**SIGHT, "form": "tangent"}
AHEAD = [20.0, 400.0, -30.0]


def made(scene, lidar, **others):
    return scene.sensors(radar=None, eye=lidar, **others)


def read(scene, relative, lidar, epochs=64, runs=2, chunk=None, **others):
    """Return the lidar's raw readings."""
    suite = SensorSuite(made(scene, lidar, **others), scene.source(runs), scene.STEP_S)
    chunk = chunk or epochs
    return np.concatenate(
        [suite.measure(scene.truth(relative, chunk, first), first)["eye"] for first in range(0, epochs, chunk)], axis=1
    )


@pytest.mark.parametrize("ahead", [50.0, 800.0])
@pytest.mark.parametrize("options", [RANGE, SIGHT], ids=["range", "sight"])
def test_noise_has_the_sigma_of_the_distance(scene, ahead, options):
    z = read(scene, [0.0, ahead, 0.0], {**options, "range_bias_m": 0.5}, 500, 60)
    sigmas = np.array([0.05 + 2e-3 * ahead, *np.radians([0.1] * 2)])[: z.shape[-1]]
    truth = np.array([ahead + 0.5, 0.0, 0.0])[: z.shape[-1]]
    error = (z - truth) / sigmas
    assert (np.abs(error.mean(axis=(0, 1))) < 4 / np.sqrt(30000)).all()
    assert (np.abs(error.var(axis=(0, 1)) - 1) < 4 * np.sqrt(2 / 30000)).all()


@pytest.mark.parametrize("form", ["spherical", "tangent"])
@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_without_growth_it_reads_as_a_radar_of_the_same_name_does(scene, host, form):
    same = {"range_sigma_m": 0.05, "angle_sigma_deg": 0.1, "host": host, "mounting_deg": [10, 20, 30], "form": form}
    as_radar = read(scene, AHEAD, {"kind": "radar", **same})
    assert np.array_equal(read(scene, AHEAD, {"kind": "lidar", **same}), as_radar)
    grown = read(scene, AHEAD, {"kind": "lidar", "range_sigma_m_per_km": 2.0, **same})
    assert np.array_equal(grown[..., 1:], as_radar[..., 1:]) and (grown[..., 0] != as_radar[..., 0]).all()


@pytest.mark.parametrize("options", [RANGE, SIGHT], ids=["range", "sight"])
def test_bits_do_not_depend_on_block_and_chunks(scene, options):
    noise = [{"kind": "mixture", "scale": 3, "fraction": 0.2}, {"kind": "gauss_markov", "tau_s": 5}]
    whole = read(scene, AHEAD, {**options, "noise": noise}, runs=5)
    assert np.array_equal(read(scene, AHEAD, {**options, "noise": noise}, runs=5, chunk=16), whole)
    assert np.array_equal(read(scene, AHEAD, {**options, "noise": noise}, runs=(3,)), whole[3:4])


def test_limits_and_field_of_view_cut_the_whole_reading(scene):
    assert np.isnan(read(scene, AHEAD, {**RANGE, "range_limits_m": [1, 399]})).all()
    assert np.isnan(read(scene, AHEAD, {**RANGE, "field_of_view_deg": [3, 20]})).all()
    assert np.isfinite(read(scene, AHEAD, {**RANGE, "field_of_view_deg": [5, 5]})).all()
    assert np.isnan(read(scene, [0.0, 0.0, 0.0], SIGHT)).all()


def test_a_range_that_would_not_be_positive_is_no_reading(scene):
    options = {"kind": "lidar", "range_sigma_m": 1.0, "range_sigma_m_per_km": 500.0}
    runs, epochs = 100, 200
    z = read(scene, [0.0, 2.0, 0.0], options, epochs, runs)
    share = np.isnan(z).mean()
    expected = float(made(scene, options)["eye"].no_echo(np.array(2.0)))
    assert 0.15 < expected < 0.2  # Phi(-2 / 2)
    assert abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / (runs * epochs))
    assert (z[np.isfinite(z)] > 0).all()


def test_a_constant_error_in_sigmas_grows_with_the_distance(scene):
    noise = [{"kind": "gaussian", "scale": 1e-9}, {"kind": "bias", "value": [2.0, 0.0, 1.0]}]
    options = {**SIGHT, "noise": noise, "range_bias_m": 0.3}
    z = read(scene, [0.0, 400.0, 0.0], options)
    lidar, truth = made(scene, options)["eye"], scene.truth([0.0, 400.0, 0.0])
    streams = streams_of("eye", lidar, "chief", scene.source(2), scene.STEP_S)
    errors = lidar.slow_errors(sensed(truth, "chief", scene.STEP_S), streams)
    assert np.allclose(errors, [0.3 + 2 * 0.85, 0, np.radians(0.1)], rtol=1e-12)
    assert np.allclose(z - [400.0, 0, 0], errors, rtol=0, atol=1e-7)


@pytest.mark.parametrize("host", ["chief", "deputy"])
@pytest.mark.parametrize("options", [RANGE, SIGHT, TANGENT], ids=["range", "sight", "tangent"])
def test_residuals_of_the_true_state_have_the_covariance_that_filters_are_told(scene, host, options):
    """Through the whole chain, with GNSS and star tracker in it."""
    others = {"gnss": scene.GNSS, "star_tracker": scene.STAR_TRACKER}
    runs, epochs, relative = 40, 100, [20.0, 400.0, -30.0]
    # The measurement on the deputy takes the chief's orbit as that of the scene: circular.
    options = {**options, "host": host}
    sensors, truth = made(scene, options, **others), scene.truth(relative, epochs)
    raw = SensorSuite(sensors, scene.source(runs), scene.STEP_S).measure(truth, 0)
    z = filter_inputs(sensors, raw, truth)["eye"]["spherical"]
    model = sensor_measurement("eye", sensors, scene.ORBIT, scene.STEP_S)
    state = np.tile([*relative, 0.0, 0.0, 0.0], (runs, 1))
    z, squared = model.take(z, 0), 0.0
    for k in range(epochs):
        nu = model.residual(z[:, k], model.predict(state, k))
        R = np.broadcast_to(model.noise(state, k), (runs, *nu.shape[1:] * 2))
        squared += np.einsum("bi,bij,bj->", nu, np.linalg.inv(R), nu)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], z.size)
    assert low < squared < high


def test_without_attitude_the_range_stays(scene):
    blind = {**scene.STAR_TRACKER, "noise": [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[2, 4]]}]}
    sensors, truth = made(scene, SIGHT, star_tracker=blind), scene.truth(AHEAD)
    raw = SensorSuite(sensors, scene.source(3), scene.STEP_S).measure(truth, 0)
    z = filter_inputs(sensors, raw, truth)["eye"]["spherical"]
    lost = (truth.times_s >= 2) & (truth.times_s < 4)
    assert np.isnan(z[:, lost, 1:]).all() and np.isfinite(z[..., 0]).all() and np.isfinite(z[:, ~lost]).all()


@pytest.mark.parametrize("options", [SIGHT, TANGENT], ids=["sight", "tangent"])
def test_a_fix_needs_angles_and_has_the_noise_of_its_distance(scene, options):
    assert not made(scene, RANGE)["eye"].gives_fix and made(scene, RANGE)["eye"].first_fix(None, None) is None
    sensors = made(scene, options)
    assert sensors["eye"].gives_fix
    model = sensor_measurement("eye", sensors, scene.ORBIT, scene.STEP_S)
    position, covariance = sensors["eye"].first_fix(model, np.array([[400.0, 0.0, 0.0]]))
    assert np.allclose(position, [[0, 400, 0]])
    across = 400 * np.radians(0.1)
    assert np.allclose(covariance[0], np.diag(np.square([across, 0.85, across])), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({**RANGE, "noise": {"kind": "bias", "value": 1.0}}, "gaussian or mixture"),
        ({**RANGE, "noise": [{"kind": "gaussian"}, {"kind": "bias", "value": [1, 2, 3]}]}, "has 1 channel"),
        ({**SIGHT, "noise": [{"kind": "gaussian"}, {"kind": "bias", "value": [1, 2]}]}, "has 3 channels"),
        ({**RANGE, "range_sigma_m": 0}, "greater than 0"),
        ({**RANGE, "azimuth_bias_deg": 1}, "azimuth_bias_deg"),
    ],
)
def test_bad_options_are_refused(scene, options, sentence):
    with pytest.raises((ValueError, ValidationError), match=sentence):
        made(scene, options)
