"""The words of the random streams are frozen: another word would give every earlier campaign other numbers."""

import pytest

from relnav_sim.campaign.file_model import sensors_from
from relnav_sim.sensors import SensorSuite
from relnav_sim.streams import RandomSource

PARTS = [
    {"kind": "mixture", "scale": 3, "fraction": "random", "shared": False},
    {"kind": "gauss_markov", "tau_s": 5},
    {"kind": "outage", "rate_per_hour": 60, "mean_duration_s": 1},
]
NOISE = {"white", "white.switch", "white.fraction", "gauss_markov", "outage"}
SENSORS = {
    "radar": {"range_sigma_m": 1, "angle_sigma_deg": 0.1, "time_tag_sigma_s": 0.1, "time_tag_jitter_s": 0.1},
    "gnss": {"position_sigma_m": 1, "velocity_sigma_m_s": 0.1},
    "star_tracker": {"cross_boresight_sigma_arcsec": 1, "about_boresight_sigma_arcsec": 1},
    "accelerometer": {
        "velocity_random_walk_m_s_sqrt_s": 1e-3,
        "bias_sigma_m_s2": 1e-5,
        "scale_factor_sigma_percent": 1,
    },
}
WORDS = {
    "radar": {f"sensor.radar.{word}" for word in NOISE | {"time_tag", "time_tag_jitter"}},
    "gnss": {f"sensor.gnss.{word}" for word in NOISE},
    "star_tracker": {f"sensor.star_tracker.{word}" for word in NOISE},
    "accelerometer": {
        f"sensor.accelerometer.{craft}.{word}"
        for craft in ("chief", "deputy")
        for word in NOISE | {"bias", "scale_factor"}
    },
}


@pytest.mark.parametrize("kind", SENSORS)
def test_the_words_of_a_sensor(scene, monkeypatch, kind):
    asked = set()
    streams = RandomSource.streams
    monkeypatch.setattr(RandomSource, "streams", lambda self, name: (asked.add(name), streams(self, name))[1])
    sensors = sensors_from({kind: {**SENSORS[kind], "noise": PARTS}})
    truth = scene.truth([0.0, 1000.0, 0.0], 4)
    felt = truth.chief[:, :, None, None, :3] * [[[0.0]], [[0.0]]]
    SensorSuite(sensors, scene.source(2), scene.STEP_S).measure(truth, 0, felt=felt.repeat(2, axis=3))
    assert asked == WORDS[kind]
