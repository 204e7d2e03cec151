"""Accelerometers and the radar's latency and time tags, sample by sample."""

import json

import numpy as np
import pytest

from relnav_sim.sensors import Sensed, SensorSuite, streams_of
from relnav_sim.sensors.accelerometer import AccelerometerOptions


def options(**values):
    return AccelerometerOptions.model_validate_json(json.dumps({"velocity_random_walk_m_s_sqrt_s": 1e-3, **values}))


def reading(scene, runs=2, epochs=400, felt=(0.0, 0.0, 0.0), step_s=0.5, **values):
    """Return the plain and the weighted means (runs, epochs, 2, 3) of a constant force."""
    times = np.arange(epochs) * step_s
    force = np.broadcast_to(np.array(felt), (1, epochs, 2, 3))
    streams = streams_of("accelerometer", options(**values), "deputy", scene.source(runs), step_s)
    at_rest = np.zeros((1, epochs, 6))
    z = options(**values).sample(Sensed(times, at_rest, at_rest, force, step_s), streams)
    return z.reshape(runs, epochs, 2, 3)


def test_velocity_walks_at_random(scene):
    """The variance of the velocity gained in T seconds is that of one second times T, whatever the step."""
    for step_s in (0.1, 2.0):
        gained = (reading(scene, runs=300, epochs=50, step_s=step_s)[:, :, 0] * step_s).sum(axis=1)
        expected = 1e-3 * np.sqrt(50 * step_s)
        assert abs(gained.std() / expected - 1) < 4.5 / np.sqrt(2 * gained.size)


def test_both_means_have_the_same_error(scene):
    z = reading(scene, felt=(0.1, 0, 0), bias_sigma_m_s2=1e-3, scale_factor_sigma_percent=1)
    np.testing.assert_array_equal(z[:, :, 0], z[:, :, 1])


def test_bias_and_scale_factor_are_constant_in_a_run_and_spread_over_runs(scene):
    quiet = {"velocity_random_walk_m_s_sqrt_s": 1e-12}
    bias = reading(scene, runs=300, epochs=3, bias_sigma_m_s2=2e-5, **quiet)[:, :, 0]
    assert np.abs(np.diff(bias, axis=1)).max() < 1e-10
    assert abs(bias[:, 0].std() / 2e-5 - 1) < 4.5 / np.sqrt(2 * 900)
    scaled = reading(scene, runs=300, epochs=3, felt=(0.1, -0.2, 0.3), scale_factor_sigma_percent=2, **quiet)[:, 0, 0]
    factor = scaled / [0.1, -0.2, 0.3] - 1
    assert abs(factor.std() / 0.02 - 1) < 4.5 / np.sqrt(2 * 900)
    assert np.abs(np.corrcoef(factor.T) - np.eye(3)).max() < 4.5 / np.sqrt(300)


def test_the_deadband_silences_what_is_short(scene):
    quiet = reading(scene, deadband_m_s2=0.01)
    assert (quiet == 0).all()
    np.testing.assert_array_equal(
        reading(scene, felt=(0.1, 0, 0), deadband_m_s2=0.01), reading(scene, felt=(0.1, 0, 0))
    )


def test_outages_and_other_parts_of_noise(scene):
    z = reading(scene, noise=[{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[10, 20]]}])
    assert np.array_equal(np.isnan(z).any(axis=(0, 2, 3)), (np.arange(400) >= 20) & (np.arange(400) < 40))


def test_each_craft_has_streams_of_its_own_and_the_rest_stays(scene):
    sections = {"gnss": scene.GNSS, "accelerometer": {"velocity_random_walk_m_s_sqrt_s": 1e-3}}
    truth, felt = scene.truth([100, 2000, 0]), np.zeros((1, 64, 2, 2, 3))
    both = SensorSuite(scene.sensors(**sections), scene.source(3), scene.STEP_S).measure(truth, 0, felt=felt)
    assert not np.array_equal(both["chief_accelerometer"], both["deputy_accelerometer"])
    assert both["chief_accelerometer"].shape == (3, 64, 6)
    sections["accelerometer"] = {**sections["accelerometer"], "carrier": "deputy"}
    one = SensorSuite(scene.sensors(**sections), scene.source(3), scene.STEP_S).measure(truth, 0, felt=felt)
    assert "chief_accelerometer" not in one
    for name in one:
        assert np.array_equal(one[name], both[name])
    with pytest.raises(ValueError, match="accelerometers need the specific force"):
        SensorSuite(scene.sensors(**sections), scene.source(3), scene.STEP_S).measure(truth, 0)


def drifting(scene, shift_s=0.0):
    """A scene in which the deputy moves along its way at 20 m/s in the chief's frame, seen `shift_s` later."""
    positions = np.array([[0, 3000 + 20 * (k * scene.STEP_S + shift_s), 50] for k in range(64)])
    parts = [scene.truth(position, epochs=1, first=k) for k, position in enumerate(positions)]
    return scene.Truth(
        np.concatenate([p.times_s for p in parts]),
        *(np.concatenate([getattr(p, craft) for p in parts], axis=1) for craft in ("chief", "deputy")),
    )


def test_a_radar_with_latency_looks_where_the_craft_were(scene):
    now, before = drifting(scene), drifting(scene, -0.5)
    plain = SensorSuite(scene.sensors(), scene.source(2), scene.STEP_S).measure(before, 0)["radar"]
    seen = (before.chief, before.deputy)
    late = SensorSuite(scene.sensors(radar={"latency_s": 0.5}), scene.source(2), scene.STEP_S).measure(
        now, 0, lambda latency_s: seen
    )
    np.testing.assert_array_equal(late["radar"], plain)
    other = scene.sensors(radar={"latency_s": 0.5, "carrier": "deputy"})
    turned = SensorSuite(other, scene.source(2), scene.STEP_S).measure(now, 0, lambda latency_s: seen)["radar"]
    np.testing.assert_allclose(turned[..., 0], plain[..., 0], atol=1e-6)  # the same distance from the other end


def test_time_tag_errors_move_the_reading_along_the_way(scene):
    """Range errors of range rate times time error; constant in a run, or anew at each reading."""
    truth = scene.truth([0, 3000, 0], epochs=64)
    truth.deputy[..., 3:] += 20 * truth.deputy[..., 3:] / np.linalg.norm(truth.deputy[..., 3:], axis=-1)[..., None]
    plain = SensorSuite(scene.sensors(), scene.source(200), scene.STEP_S).measure(truth, 0)["radar"]
    for key, constant in (("time_tag_sigma_s", True), ("time_tag_jitter_s", False)):
        sensors = scene.sensors(radar={key: 0.05})
        z = SensorSuite(sensors, scene.source(200), scene.STEP_S).measure(truth, 0)["radar"]
        moved = z[..., 0] - plain[..., 0]
        count = 200 if constant else moved.size
        assert abs(moved.std() / (20 * 0.05) - 1) < 4.5 / np.sqrt(2 * count) + 0.01
        assert (np.abs(np.diff(moved, axis=1)).max() < 1e-3) == constant
