"""The radar as a sensor: what it sees, in which frame, and when it sees nothing."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from relnav_sim.sensors import SensorSuite

TINY = {"range_sigma_m": 1e-9, "angle_sigma_deg": 1e-12}


def read(scene, relative, epochs=64, runs=2, chunk=None, **radar):
    """Readings of a radar without noise worth mentioning, unless the options say otherwise."""
    options = scene.sensors(radar={**TINY, **radar})
    suite = SensorSuite(options, scene.source(runs), scene.STEP_S)
    lengths = [chunk] * (epochs // chunk) if chunk else [epochs]
    firsts = np.cumsum([0, *lengths[:-1]])
    parts = [
        suite.measure(scene.truth(relative, n, int(k)), int(k))["radar"] for k, n in zip(firsts, lengths, strict=True)
    ]
    return np.concatenate(parts, axis=1)


def test_chief_sees_the_deputy_in_its_nadir_frame(scene):
    z = read(scene, [50.0, 1000.0, 200.0])
    ahead, right, down = 1000.0, -200.0, -50.0
    distance = np.sqrt(ahead**2 + right**2 + down**2)
    expected = [distance, np.arctan2(right, ahead), np.arcsin(-down / distance)]
    np.testing.assert_allclose(z, np.broadcast_to(expected, z.shape), atol=2e-8, rtol=1e-11)


def test_mounting_turns_the_body_to_the_radar(scene):
    z = read(scene, [50.0, 1000.0, 200.0], mounting_deg=[35, -20, 50])
    sight = Rotation.from_euler("ZYX", [35, -20, 50], degrees=True).inv().apply([1000.0, -200.0, -50.0])
    np.testing.assert_allclose(z[..., 1], np.arctan2(sight[1], sight[0]), atol=1e-11)
    np.testing.assert_allclose(z[..., 2], np.arcsin(-sight[2] / np.linalg.norm(sight)), atol=1e-11)


def test_radar_on_the_deputy_uses_the_deputys_own_frame(scene):
    """Wei, Song and Zhang (2012): alpha = atan2(radial, along), beta towards the normal, with roll -90 deg."""
    z = read(scene, [300.0, -371.0, -400.0], host="deputy", mounting_deg=[0, 0, -90])
    truth = scene.truth([300.0, -371.0, -400.0])
    for k in (0, 40):
        r, v = truth.deputy[0, k, :3], truth.deputy[0, k, 3:]
        radial, normal = r / np.linalg.norm(r), np.cross(r, v)
        normal /= np.linalg.norm(normal)
        sight = truth.chief[0, k, :3] - r
        x, y, h = sight @ radial, sight @ np.cross(normal, radial), sight @ normal
        np.testing.assert_allclose(z[0, k], [np.linalg.norm(sight), np.arctan2(x, y), np.arctan2(h, np.hypot(x, y))])


def test_noise_has_the_stated_sigmas_and_biases_add(scene):
    runs, epochs = 60, 500
    z = read(
        scene,
        [0.0, 12000.0, 0.0],
        epochs,
        runs,
        range_sigma_m=4.0,
        angle_sigma_deg=0.0667,
        range_bias_m=7.0,
        azimuth_bias_deg=0.05,
        elevation_bias_deg=-0.02,
    )
    size = runs * epochs
    error = (z - [12000.0, 0.0, 0.0]) / [4.0, *np.radians([0.0667] * 2)]
    expected = [7 / 4, 0.05 / 0.0667, -0.02 / 0.0667]
    assert (np.abs(error.mean(axis=(0, 1)) - expected) < 5 / np.sqrt(size)).all()
    assert (np.abs(error.var(axis=(0, 1)) - 1) < 5 * np.sqrt(2 / size)).all()


def test_angles_are_wrapped_into_the_half_open_circle(scene):
    """A target behind: the azimuth's noise straddles the seam and no reading leaves (-pi, pi]."""
    z = read(scene, [0.0, -5000.0, 0.0], 500, 20, angle_sigma_deg=1.0)
    azimuth = z[..., 1]
    assert (azimuth > -np.pi).all()
    assert (azimuth <= np.pi).all()
    assert 0.45 < (azimuth > 0).mean() < 0.55
    error = np.mod(azimuth, 2 * np.pi) - np.pi
    assert abs(error.std() / np.radians(1.0) - 1) < 5 / np.sqrt(2 * error.size)


def test_range_limits(scene):
    relative = [[0.0, 99.0, 0.0], [0.0, 101.0, 0.0], [0.0, 9999.0, 0.0], [0.0, 10001.0, 0.0]]
    z = read(scene, relative, runs=4, range_limits_m=[100, 10000])
    assert np.isnan(z).all(axis=(1, 2)).tolist() == [True, False, False, True]
    assert np.isfinite(z[1:3]).all()


def test_field_of_view_and_tracking(scene):
    degrees = np.radians([29, 31, 0, 0])
    ups = np.radians([0, 0, 19, -21])
    relative = 1000 * np.stack([np.sin(ups), np.cos(ups) * np.cos(degrees), -np.cos(ups) * np.sin(degrees)], axis=-1)
    fixed = read(scene, relative, runs=4, field_of_view_deg=[30, 20])
    assert np.isnan(fixed).all(axis=(1, 2)).tolist() == [False, True, False, True]
    tracking = read(scene, relative, runs=4, field_of_view_deg=[30, 20], boresight="tracking")
    np.testing.assert_array_equal(tracking[[0, 2]], fixed[[0, 2]])
    np.testing.assert_allclose(tracking[:, 0, 1], degrees, atol=1e-9)
    np.testing.assert_allclose(tracking[:, 0, 2], ups, atol=1e-9)


@pytest.mark.parametrize("chunk", [None, 7])
def test_period(scene, chunk):
    """Readings at whole numbers of periods from time zero, the same numbers as without a period."""
    options = {"range_sigma_m": 4.0, "angle_sigma_deg": 0.1}
    z = read(scene, [0.0, 1000.0, 0.0], 63, chunk=chunk, period_s=1.0, **options)
    every = read(scene, [0.0, 1000.0, 0.0], 63, **options)
    due = np.arange(63) % 5 == 0
    assert np.isnan(z[:, ~due]).all()
    np.testing.assert_array_equal(z[:, due], every[:, due])


def test_period_must_fit_the_step(scene):
    with pytest.raises(ValueError, match="no whole number of steps"):
        SensorSuite(scene.sensors(radar={"period_s": 0.5}), scene.source(1), 0.2)


@pytest.mark.parametrize(
    ("radar", "says"),
    [
        ({"range_sigma_m": 0}, "greater than 0"),
        ({"angle_sigma_deg": -0.1}, "greater than 0"),
        ({"angle_sigma_deg": 90}, "less than 90"),
        ({"period_s": -1}, "greater than 0"),
        ({"range_limits_m": [100, 50]}, "two rising values"),
        ({"field_of_view_deg": [30, 0]}, "greater than 0"),
        ({"noise": {"kind": "gauss_markov", "tau_s": 3}}, "needs a gaussian or mixture part"),
        ({"noise": []}, "needs a gaussian or mixture part"),
        ({"noise": [{"kind": "gaussian"}, {"kind": "bias", "value": [1, 2]}]}, "this sensor has 3 channels"),
        ({"host": "target"}, "'chief' or 'deputy'"),
        ({"range_sigma": 4}, "Extra inputs"),
    ],
)
def test_bad_options_are_refused(scene, radar, says):
    with pytest.raises(ValidationError, match=says):
        scene.sensors(radar=radar)
