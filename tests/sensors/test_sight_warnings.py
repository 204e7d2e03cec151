"""Warnings about the sensors' geometry, against geometry and probabilities computed here."""

import re

import numpy as np
import pytest
from scipy.stats import norm

from relnav_sim.sensors import SensorSuite, sight_warnings
from relnav_sim.truth import Truth

RADAR = {"range_sigma_m": 1.0, "angle_sigma_deg": 0.05}


def passing(scene, distance=1000.0, speed=20.0, epochs=101, **radar):
    """Return warnings of a deputy that passes above the chief along-track, straight over it at 10 s, every 0.2 s."""
    still = scene.truth([distance, 0.0, 0.0], epochs)
    along = np.cross(np.cross(still.chief[..., :3], still.chief[..., 3:]), still.chief[..., :3])
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    moved = still.deputy.copy()
    moved[..., :3] += (speed * (still.times_s - 10.0))[:, None] * along
    return sight_warnings(scene.sensors(radar={**RADAR, **radar}), Truth(still.times_s, still.chief, moved, moved))


def test_the_window_is_that_of_the_geometry(scene):
    """Within 5 deg while 20 |t - 10| < 1000 tan 5 deg = 87.5 m: from 5.63 to 14.37 s."""
    (sentence,) = passing(scene)
    assert sentence.startswith(
        "The line of sight is within 5 deg of the radar's azimuth axis from 5.8 to 14.2 s, nearest 0"
    )


def test_coarse_angles_widen_the_window(scene):
    """Ten sigmas of 1 deg: 20 |t - 10| < 1000 tan 10 deg = 176.3 m, from 1.18 to 18.8 s."""
    (sentence,) = passing(scene, angle_sigma_deg=1.0)
    assert "within 10 deg of the radar's azimuth axis from 1.2 to 18.8 s" in sentence


@pytest.mark.parametrize(
    "radar",
    [
        {"mounting_deg": (0.0, 90.0, 0.0)},  # the axis along-track, the target overhead far from it
        {"mounting_deg": (0.0, 0.0, 90.0)},
        {"field_of_view_deg": (180.0, 60.0)},  # what is near the axis is not read
        {"range_limits_m": (1010.0, 5000.0)},  # nor what is near
        {"noise": [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[5.0, 15.0]]}]},  # nor when it fails
    ],
)
def test_readings_that_are_not_near_the_axis_or_do_not_exist_are_no_reason(scene, radar):
    assert passing(scene, speed=200.0, **radar) == []


def test_the_axis_turns_with_the_mounting(scene):
    """A target straight ahead, the radar pitched by 90 deg: its z axis lies along-track."""
    ahead = scene.truth([0.0, 1000.0, 0.0], 11)
    assert sight_warnings(scene.sensors(radar=RADAR), ahead) == []
    (sentence,) = sight_warnings(scene.sensors(radar={**RADAR, "mounting_deg": (0.0, 90.0, 0.0)}), ahead)
    assert "azimuth axis from 0 to 2 s, nearest 0 deg" in sentence


def test_runs_are_counted_where_they_differ(scene):
    truth = scene.truth([[1000.0, 20.0, 0.0], [0.0, 1000.0, 0.0], [1000.0, 60.0, 0.0]], 11)
    (sentence,) = sight_warnings(scene.sensors(radar=RADAR), truth)
    assert "from 0 to 2 s in 2 of 3 runs, nearest 1.15 deg" in sentence


@pytest.mark.parametrize(
    ("relative", "radar", "sentence"),
    [
        ([0, 500.0, 0], {"range_limits_m": (600.0, 900.0)}, "500 to 500 m away, is never within its range_limits_m"),
        ([0, -500.0, 0], {"field_of_view_deg": (60.0, 60.0)}, "is never within its field of view"),
        (
            [0, 500.0, 0],
            {"noise": [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[0, 1e4]]}]},
            "it, or what its host needs to know of itself, is never at work",
        ),
        ([0, 0, 0], {}, "within 1 m of each other from 0 to 2 s"),
    ],
)
def test_a_target_that_is_never_seen_is_named(scene, relative, radar, sentence):
    found = sight_warnings(scene.sensors(radar={**RADAR, **radar}), scene.truth(relative, 11))
    assert sentence in found[0]
    assert found[-1] == "The filters only predict."


@pytest.mark.parametrize(
    ("noise", "negative"),
    [
        ({"kind": "gaussian"}, norm.cdf(-0.5)),
        ({"kind": "gaussian", "scale": 0.5}, norm.cdf(-1)),
        ([{"kind": "gaussian"}, {"kind": "bias", "value": [-1.0, 0, 0]}], norm.cdf(0.5)),
        ([{"kind": "gaussian"}, {"kind": "gauss_markov", "tau_s": 0.01, "scale": 2.0}], norm.cdf(-0.5 / np.sqrt(5))),
        (
            {"kind": "mixture", "scale": 3.0, "fraction": 0.25},
            0.75 * norm.cdf(-0.5) + 0.25 * norm.cdf(-0.5 / 3),
        ),
    ],
)
def test_negative_ranges_do_not_exist_and_their_share_is_said(scene, noise, negative):
    options = scene.sensors(radar={"range_sigma_m": 1000.0, "angle_sigma_deg": 0.05, "noise": noise})
    truth = scene.truth([0.0, 500.0, 0.0], 400)
    (sentence,) = sight_warnings(options, truth)
    said = float(re.search(r"About (\S+) % of the measurements of the radar are missing", sentence).group(1))
    assert said == pytest.approx(100 * negative, rel=0.05)  # two digits
    z = SensorSuite(options, scene.source(100), scene.STEP_S).measure(truth, 0)["radar"]
    missing = np.isnan(z)
    assert np.array_equal(missing.any(axis=2), missing.all(axis=2))
    assert z[~missing].reshape(-1, 3)[:, 0].min() > 0
    n = missing[..., 0].size
    assert abs(missing[..., 0].mean() - negative) < 5 * np.sqrt(negative * (1 - negative) / n)


def two(scene, near, far):
    """Return sensors: a radar that sees to 600 m and one from there on, each with further options."""
    return {
        "near": scene.sensors(radar={**RADAR, "range_limits_m": (1.0, 600.0), **near})["radar"],
        "far": scene.sensors(radar={**RADAR, "range_limits_m": (600.0, 5000.0), **far})["radar"],
    }


def test_filters_are_named_that_go_by_blind_sensors_alone(scene):
    truth = scene.truth([0.0, 1000.0, 0.0], 11)
    filters = {"a": ("near",), "b": ("near", "far"), "c": ("near",), "d": ("far",)}
    blind, predicting = sight_warnings(two(scene, {}, {}), truth, filters)
    assert blind == (
        "The near gives no measurement in the whole run: the other craft, 1000 to 1000 m away, is never within its "
        "range_limits_m."
    )
    assert predicting == "The filters a, c only predict: none of their sensors gives a measurement."
    other = scene.truth([[0.0, 1000.0, 0.0], [0.0, 500.0, 0.0]], 11)
    found = sight_warnings(two(scene, {}, {}), other, {"a": ("near",), "b": ("near", "far")})
    assert [sentence for sentence in found if "predict" in sentence] == [
        "The filter a only predicts in 1 of 2 runs: none of its sensors gives a measurement."
    ]


def test_sensors_that_no_filter_goes_by_do_not_matter(scene):
    truth = scene.truth([1000.0, 0.0, 0.0], 11)
    sensors = two(scene, {}, {"mounting_deg": (0.0, 90.0, 0.0)})
    assert sight_warnings(sensors, truth, {"a": ("far",)}) == []
    assert len(sight_warnings(sensors, truth, {"a": ("far", "near")})) == 1
    upright = two(scene, {}, {})
    (pole,) = sight_warnings(upright, truth, {"a": ("far",)})
    assert "the far's azimuth axis" in pole and "sensors.far.mounting_deg" in pole


def test_a_range_that_is_well_known_is_no_reason(scene):
    assert sight_warnings(scene.sensors(radar={**RADAR, "range_sigma_m": 50.0}), scene.truth([0, 500.0, 0], 11)) == []
