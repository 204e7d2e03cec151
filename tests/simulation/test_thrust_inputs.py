"""Manoeuvres, accelerometers and latency through campaigns: who is told, how honest the covariance is, bits."""

import json

import numpy as np
import pytest

from relnav_sim import open_results, run_campaign, simulate
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.manoeuvres import manoeuvre_times
from relnav_sim.simulation.chunks import chunks
from relnav_sim.simulation.thrust_inputs import ThrustInputs
from relnav_sim.streams import RandomSource

EXACT = {"kind": "ekf", "dynamics": {"kind": "nonlinear_j2"}, "process_noise": {"acceleration_psd_m2_s3": 1e-10}}
ACCELEROMETER = {
    "velocity_random_walk_m_s_sqrt_s": 1e-4,
    "bias_sigma_m_s2": 2e-5,
    "scale_factor_sigma_percent": 0.1,
    "deadband_m_s2": 1e-3,
}
MANOEUVRES = {
    "kick": {"time_s": 100.5, "delta_v_m_s": [0, 0.5, 0.1]},
    "burn": {"time_s": 150, "duration_s": 60, "acceleration_m_s2": [0.002, -0.004, 0.001]},
    "evade": {"craft": "chief", "time_s": 250.5, "delta_v_m_s": [0.1, -0.3, 0.5]},
}


def campaign(filters, radar=None, accelerometer=None, manoeuvres=MANOEUVRES, errors=None, runs=40, **more):
    craft = {"mass_kg": 100, "area_m2": 1}
    data = {
        "name": "thrust",
        "seed": 5,
        "runs": runs,
        "clock": {"duration_s": 320, "step_s": 1, "store_every_s": 5},
        "truth": {
            "chief": {**craft, "orbit": {"a_km": 6878, "e": 0.001, "i_deg": 51.6}},
            "deputy": {**craft, "relative": {"position_m": [0, -2000, 100], "velocity_m_s": [0.05, 0, 0.1]}},
            "manoeuvres": manoeuvres,
            "execution_errors": errors or {},
        },
        "sensors": {"radar": {"range_sigma_m": 2, "angle_sigma_deg": 0.1, **(radar or {})}},
        "start": {"kind": "dispersed", "position_sigma_m": 10, "velocity_sigma_m_s": 0.1},
        "statistics": {"settle_s": 50},
        "filters": filters,
        **more,
    }
    if accelerometer is not None:
        data["sensors"]["accelerometer"] = accelerometer
    return parse_campaign(json.dumps(data))


def results(tmp_path, parsed, name="out.h5"):
    return open_results(run_campaign(parsed, tmp_path / name, backend="sequential"))


ERRORS = {"magnitude_sigma_percent": 1, "direction_sigma_deg": 0.5, "timing_sigma_s": 0.1}


def test_who_is_told_is_right_and_knows_how_right(tmp_path):
    """Manoeuvres of both craft, with errors: NEES of 6 states over 40 runs stays within wide chi-square limits.

    The impulses are planned between epochs, so that hardly any timing error carries one past an epoch.
    """
    told = {
        "untold": {**EXACT, "known_thrust": "none"},
        "planned": {**EXACT, "known_thrust": "planned"},
        "measured": EXACT,
    }
    with results(tmp_path, campaign(told, accelerometer=ACCELEROMETER, errors=ERRORS)) as found:
        assert not found.failures()
        nees = {name: np.asarray(found.nees(0, name)).mean(axis=0) for name in told}
        error = {name: found.statistic(0, name, "rms")[:, 1, -1].mean() for name in told}
    # Of the mean of 40 chi-square variables of 6: sigma sqrt(12 / 40) = 0.55.
    for name in ("planned", "measured"):
        assert np.abs(nees[name][10:] - 6).max() < 4.5 * 0.55
    assert nees["untold"][25:].min() > 1000
    assert error["measured"] < error["planned"] < error["untold"] / 10


def test_without_manoeuvres_nothing_changes(tmp_path):
    plain = {"kf": {"kind": "kf"}}
    told = {"kf": {"kind": "kf", "known_thrust": "planned"}}
    errors = []
    for name, filters in (("a.h5", plain), ("b.h5", told)):
        with results(tmp_path, campaign(filters, manoeuvres={}, runs=3), name) as found:
            errors.append(np.asarray(found.error(0, "kf")))
    assert np.array_equal(*errors)


def test_a_filter_that_knows_the_latency_undoes_it(tmp_path):
    """The deputy passes at some 5 m/s: half a second of latency is over 2 m to who does not know of it."""
    passing = {"position_m": [0, -2000, 100], "velocity_m_s": [0, 5, 0]}
    filters = {"known": EXACT, "fresh": {**EXACT, "assumed_latency": "none"}}
    parsed = campaign(filters, radar={"latency_s": 0.5}, manoeuvres={})
    parsed = parse_campaign(parsed.text, (f"truth.deputy.relative={json.dumps(passing)}",))
    with results(tmp_path, parsed) as found:
        late = np.asarray(found.error(0, "fresh"))[:, 30:, 1].mean()
        speed = np.asarray(found.truth(0))[..., 30:, 4].mean()
        nees = np.asarray(found.nees(0, "known"))[:, 5:].mean(axis=0)
        assert late == pytest.approx(-0.5 * speed, abs=0.1)
        assert np.abs(np.asarray(found.error(0, "known"))[:, 30:, 1].mean()) < 0.3
        assert np.abs(nees - 6).max() < 4.5 * 0.55


def test_the_reading_comes_late_by_the_latency():
    """Noise apart, measurement k is where the craft were: across an impulse too."""
    parsed = campaign({"kf": {"kind": "kf"}}, radar={"latency_s": 2.0, "range_sigma_m": 1e-9, "angle_sigma_deg": 1e-9})
    run = simulate(parsed)
    distance = np.linalg.norm(run.relative[0, :, :3], axis=1)
    z = run.z["radar"][0, :, 0]
    assert np.isnan(z[:2]).all()
    np.testing.assert_allclose(z[2:], distance[:-2], atol=1e-6)


def test_measured_thrust_falls_back_on_the_plan():
    """For a craft without accelerometer, and where measurements are missing."""
    outage = {**ACCELEROMETER, "carrier": "deputy", "deadband_m_s2": 0.0}
    outage["noise"] = [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[95, 105]]}]
    config = campaign({"kf": {"kind": "kf"}}, accelerometer=outage).cases[0].config
    chunk = next(chunks(config, RandomSource(1, (0, 1))))
    inputs = ThrustInputs(config)
    planned, _ = inputs.of(chunk, "planned")
    measured, noise = inputs.of(chunk, "measured")
    np.testing.assert_array_equal(measured[:, :, 0], np.repeat(planned[:, :, 0], 2, axis=0))
    np.testing.assert_array_equal(measured[:, 95:105, 1], np.repeat(planned[:, 95:105, 1], 2, axis=0))
    assert np.abs(measured[:, 160, 1, 0] - planned[0, 160, 1, 0]).max() < 1e-3
    assert (noise[:, 95:105] == 0).all() and (noise[:, 160, 3, 3] > 0).all()


def test_when_manoeuvres_are():
    times = manoeuvre_times(campaign({"kf": {"kind": "kf"}}).cases[0].config)
    assert [tuple(each) for each in times] == [
        ("kick", "deputy", 100.5, 100.5),
        ("burn", "deputy", 150, 210),
        ("evade", "chief", 250.5, 250.5),
    ]


REFUSED = [
    ({"manoeuvres": {"late": {"time_s": 400, "delta_v_m_s": [0, 1, 0]}}}, "happens at 400 s; the run ends at 320 s"),
    (
        {"manoeuvres": {"long": {"time_s": 300, "duration_s": 30, "delta_v_m_s": [0, 1, 0]}}},
        "the burn ends at 330 s, the run at 320 s",
    ),
    (
        {"filters": {"kf": {"kind": "kf", "known_thrust": "measured"}}},
        "nothing measures the thrust: give sensors.accelerometer, or planned",
    ),
    (
        {"radar": {"latency_s": 0.5}, "start": {"kind": "first_fix"}},
        "the first measurement comes 0.5 s after the start, so there is no fix to start from",
    ),
    ({"manoeuvres": {"a b": {"time_s": 1, "delta_v_m_s": [0, 1, 0]}}}, "a b"),
]


@pytest.mark.parametrize("changes, sentence", REFUSED)
def test_what_makes_no_sense_is_refused_in_words(changes, sentence):
    with pytest.raises(Exception, match=sentence):
        campaign(**{"filters": {"kf": {"kind": "kf"}}, **changes})
