"""All sensors together: a run's readings depend on nothing but the run."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim.sensors import SensorSuite, filter_inputs, sensor_kinds

EPOCHS = 60
NOISE = [
    {"kind": "mixture", "scale": 3, "fraction": "random", "shared": False},
    {"kind": "gauss_markov", "tau_s": 5, "scale": 0.5},
    {"kind": "outage", "rate_per_hour": 600, "mean_duration_s": 1},
]


def everything(scene, host="chief"):
    return scene.sensors(
        radar={"noise": NOISE, "host": host, "mounting_deg": [5, 10, 15]},
        gnss={**scene.GNSS, "noise": NOISE},
        star_tracker={**scene.STAR_TRACKER, "noise": NOISE},
    )


def relative(runs):
    """A place of each run's own."""
    return np.array([[100.0 + 10 * run, 5000.0 - 70 * run, 30.0 * run] for run in runs])


def simulate(scene, options, runs, places, lengths=(EPOCHS,)):
    suite = SensorSuite(options, scene.source(tuple(runs)), scene.STEP_S)
    parts, first = [], 0
    for length in lengths:
        truth = scene.truth(places, length, first)
        z = suite.measure(truth, first)
        inputs = filter_inputs(options, z, truth)["radar"]
        parts.append({**z, **{f"input {form}": x for form, x in inputs.items()}})
        first += length
    return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_bits_do_not_depend_on_block_or_chunks(scene, host):
    options = everything(scene, host)
    runs = [0, 1, 2, 3, 4]
    whole = simulate(scene, options, runs, relative(runs))
    assert np.isnan(whole["input spherical"]).any()
    split = simulate(scene, options, runs, relative(runs), lengths=(1, 30, 7, 22))
    alone = simulate(scene, options, [3], relative([3]))
    shuffled = simulate(scene, options, [4, 1], relative([4, 1]))
    for name, values in whole.items():
        np.testing.assert_array_equal(split[name], values)
        np.testing.assert_array_equal(alone[name], values[[3]])
        np.testing.assert_array_equal(shuffled[name], values[[4, 1]])


def test_a_truth_without_dispersion_is_not_repeated(scene):
    """A truth with leading axis 1 gives the bits of the same truth given once for each run."""
    options = everything(scene)
    runs = [0, 1, 2]
    once = simulate(scene, options, runs, relative([0]))
    each = simulate(scene, options, runs, relative([0, 0, 0]))
    for name, values in each.items():
        assert len(values) == 3
        np.testing.assert_array_equal(once[name], values)


def test_sensors_do_not_disturb_each_other(scene):
    whole = simulate(scene, everything(scene), [0, 1], relative([0]))
    radar = simulate(scene, scene.sensors(radar={"noise": NOISE, "mounting_deg": [5, 10, 15]}), [0, 1], relative([0]))
    np.testing.assert_array_equal(radar["radar"], whole["radar"])


def test_chunks_must_follow_each_other(scene):
    suite = SensorSuite(everything(scene), scene.source(1), scene.STEP_S)
    suite.measure(scene.truth([0.0, 1000.0, 0.0], 4), 0)
    with pytest.raises(ValueError, match="next epoch to measure is 4, not 8"):
        suite.measure(scene.truth([0.0, 1000.0, 0.0], 4, 8), 8)


def test_every_sensor_is_listed(scene):
    assert {*everything(scene), "accelerometer"} <= set(sensor_kinds())
    assert all(model.__doc__ for model in sensor_kinds().values())
