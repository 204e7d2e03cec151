"""What every registered sensor promises: bits, streams of its own, an honest model for filters, and when it reads."""

from typing import get_args

import numpy as np
import pytest
from pydantic_core import PydanticUndefined
from scipy.stats import chi2

from relnav_sim import eci_from_rtn
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.kepler import initial_state
from relnav_sim.campaign.file_model import sensors_from
from relnav_sim.measurements.frame_error import with_frame
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.sensors import (
    SensorSuite,
    filter_inputs,
    frame_is_told,
    orbit_frame_covariance,
    relative_sensors,
    sensor_kinds,
    sensor_measurement,
)
from relnav_sim.sensors.conformity import complaints
from relnav_sim.streams import RandomSource
from relnav_sim.truth import Truth

ORBIT = ChiefOrbit(7.137e6, 0.0, 0.73, 0.2, 0.0, 0.3, 3.986004418e14, 6378137.0, 1.08263e-3)
RELATIVE = np.array([60.0, 310.0, -45.0, 0.21, -0.13, 0.08])
STEP_S = 2.0
OWN = {
    "gnss": {"position_sigma_m": 30.0, "velocity_sigma_m_s": 0.15},
    "star_tracker": {"cross_boresight_sigma_arcsec": 60.0, "about_boresight_sigma_arcsec": 100.0},
}
MIXED = [
    {"kind": "mixture", "scale": 3, "fraction": "random"},
    {"kind": "outage", "rate_per_hour": 90, "mean_duration_s": 9},
]
UNITS = (("arcsec", 30.0), ("deg", 0.2), ("m_s", 0.01), ("_m", 0.5))
ALL = sorted(sensor_kinds())
RELATIVES = sorted(kind for kind, model in sensor_kinds().items() if model.role == "other")
HOSTED = [(kind, host) for kind in RELATIVES for host in get_args(sensor_kinds()[kind].model_fields["host"].annotation)]


def options(kind, **given):
    """What a campaign would say of a sensor: required numbers by the unit in their names, the rest as given."""
    fields = sensor_kinds()[kind].model_fields
    required = [name for name, field in fields.items() if field.default is PydanticUndefined and field.is_required()]
    sized = {name: next((size for unit, size in UNITS if unit in name), 1.0) for name in required}
    return {"kind": kind, **sized, **given}


def campaign(kind, own=(), **given):
    return sensors_from({"one": options(kind, **given), **{name: OWN[name] for name in own if name != kind}})


def truth(epochs=40, first=0):
    """Two craft in free fall, in steps that a circular orbit makes; the deputy keeps its relative state."""
    angle = ORBIT.mean_motion_rad_s * STEP_S * (first + np.arange(epochs))
    start = initial_state(ORBIT)
    r, v = start[:3], start[3:] / ORBIT.mean_motion_rad_s
    chief = np.concatenate(
        [
            np.outer(np.cos(angle), r) + np.outer(np.sin(angle), v),
            ORBIT.mean_motion_rad_s * (np.outer(np.cos(angle), v) - np.outer(np.sin(angle), r)),
        ],
        axis=1,
    )[None]
    relative = np.broadcast_to(RELATIVE, (1, epochs, 6))
    return Truth((first + np.arange(epochs)) * STEP_S, chief, eci_from_rtn(chief, relative), relative)


def read(sensors, runs, lengths=(40,)):
    suite = SensorSuite(sensors, RandomSource(7, tuple(runs)), STEP_S)
    parts, first = [], 0
    for length in lengths:
        seen = truth(length, first)
        felt = np.zeros((1, length, 2, 2, 3))
        parts.append(suite.measure(seen, first, lambda latency_s, seen=seen: (seen.chief, seen.deputy), felt))
        first += length
    return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}


@pytest.mark.parametrize("kind", ALL)
def test_it_keeps_to_its_protocol(kind):
    sensors = campaign(kind)
    assert list(complaints("one", sensors, STEP_S)) == []
    assert sensor_kinds()[kind].__doc__
    assert all(channel.name and channel.unit and channel.label for channel in sensors["one"].channels)


@pytest.mark.parametrize("kind", ALL)
def test_bits_depend_neither_on_block_nor_on_chunks(kind):
    sensors = campaign(kind, noise=MIXED)
    whole = read(sensors, [0, 1, 2, 3])
    assert any(np.isnan(z).any() for z in whole.values())
    for name, z in read(sensors, [0, 1, 2, 3], (1, 17, 22)).items():
        np.testing.assert_array_equal(z, whole[name])
    for name, z in read(sensors, [3, 1]).items():
        np.testing.assert_array_equal(z, whole[name][[3, 1]])


@pytest.mark.parametrize("kind", ALL)
def test_a_sensor_beside_it_changes_nothing_and_shares_no_noise(kind):
    alone = read(sensors_from({"one": options(kind)}), [0, 1])
    both = read(
        sensors_from({"two": options(kind, host=dict(HOSTED).get(kind, "deputy")), "one": options(kind)}), [0, 1]
    )
    for name, z in alone.items():
        np.testing.assert_array_equal(both[name], z)
    same = read(sensors_from({"one": options(kind), "other": options(kind)}), [0, 1])
    for name in alone:
        assert not np.array_equal(same[name], same[name.replace("one", "other")])


@pytest.mark.parametrize("kind", ALL)
def test_it_reads_when_it_is_due(kind):
    every = read(campaign(kind), [0, 1])
    seldom = read(campaign(kind, period_s=3 * STEP_S, offset_s=2 * STEP_S), [0, 1])
    due = np.arange(40) % 3 == 2
    for name, z in seldom.items():
        assert np.isnan(z[:, ~due]).all()
        np.testing.assert_array_equal(z[:, due], every[name][:, due])


@pytest.mark.parametrize(("kind", "host"), HOSTED)
def test_a_filter_is_told_its_jacobian(kind, host):
    sensors = campaign(kind, host=host)
    model = sensor_measurement("one", sensors, ORBIT, STEP_S)
    model.take(
        filter_inputs(sensors, read(sensors, range(5)), truth())["one"][relative_sensors(sensors)["one"].forms[0]], 0
    )
    states = RELATIVE + np.random.default_rng(3).normal(size=(5, 6)) * [9, 9, 9, 0.1, 0.1, 0.1]
    H = np.broadcast_to(model.jacobian(states, 4), (5, model.dimension, 6))
    differences = MeasurementDefaults.jacobian(model, states, 4)
    np.testing.assert_allclose(H, differences, rtol=1e-6, atol=1e-7 * np.abs(differences).max())


@pytest.mark.parametrize(("kind", "host"), HOSTED)
@pytest.mark.parametrize("own", [(), ("gnss", "star_tracker")], ids=["perfect", "measured"])
def test_a_filter_is_told_how_noisy_it_is(kind, host, own):
    """Readings of the true state, through the whole chain, have the covariance R, in every form."""
    sensors = campaign(kind, own, host=host)
    z = read(sensors, range(100))
    inputs = filter_inputs(sensors, z, truth())["one"]
    states = np.broadcast_to(RELATIVE, (100, 6))
    for form in relative_sensors(sensors)["one"].forms:
        if form not in inputs:
            continue
        model = sensor_measurement("one", sensors, ORBIT, STEP_S, form)
        taken = model.take(inputs[form], 0)
        total = 0.0
        for k in range(40):
            nu = model.residual(taken[:, k], model.predict(states, k))
            R = np.broadcast_to(model.noise(states, k), (100, *[nu.shape[1]] * 2))
            total += np.einsum("bi,bij,bj->", nu, np.linalg.inv(R), nu)
        degrees = 100 * 40 * nu.shape[1]
        low, high = chi2.ppf([1e-5, 1 - 1e-5], degrees)
        assert low < total < high, f"{total / degrees:.4f} instead of 1 in form {form}"


@pytest.mark.parametrize(("kind", "host"), HOSTED)
def test_a_frame_that_each_reading_tells_counts_as_one_that_is_known_beforehand(kind, host):
    """Where fixes may be missing, each reading brings the covariance of its frame: here always that of a bad fix."""
    bad = {"position_sigma_m": 20_000.0, "velocity_sigma_m_s": 30.0}
    outage = [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[1e6, 2e6]]}]
    known, told = (
        sensors_from({"one": options(kind, host=host), "gnss": {**bad, "noise": noise}})
        for noise in ({"kind": "gaussian"}, outage)
    )
    assert not frame_is_told("one", known, STEP_S)
    assert frame_is_told("one", told, STEP_S) == any(known["one"].needs_direction())
    z = filter_inputs(known, read(known, range(5)), truth())["one"][known["one"].forms[0]]
    model = sensor_measurement("one", told, ORBIT, STEP_S, frame="told")
    beforehand, perfect = (
        sensor_measurement("one", told, ORBIT, STEP_S, frame=frame) for frame in ("of_a_fix", "perfect")
    )
    taken = beforehand.take(z, 0)
    perfect.take(z, 0)
    if frame_is_told("one", told, STEP_S):
        z = with_frame(z, np.broadcast_to(orbit_frame_covariance(told, ORBIT, host), (5, 40, 6, 6)))
    np.testing.assert_array_equal(model.take(z, 0), taken)
    states = np.broadcast_to(RELATIVE, (5, 6))
    got, expected, without = (
        np.broadcast_to(each.noise(states, 7), (5, *[each.dimension] * 2)) for each in (model, beforehand, perfect)
    )
    scale = np.sqrt(np.einsum("bii->bi", expected))
    units = scale[:, :, None] * scale[:, None]
    # Some take the turn at the reading, others at the state: they differ by the reading's own error.
    np.testing.assert_allclose(got / units, expected / units, atol=0.02)
    assert not any(known["one"].needs_direction()) or ((expected - without) / units).max() > 0.3
