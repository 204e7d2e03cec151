"""Recorded measurements through a campaign's filters: the campaign's own bits, irregular times, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from relnav_sim.astro.attitude import nadir_axes, quaternion_from_axes
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.filters.smoother import smooth
from relnav_sim.recorded.readings import Readings, SensorReadings
from relnav_sim.recorded.readings_csv import write_csv
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.sensors import readings_layout
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.origin import difference_from_campaign
from relnav_sim.simulation.own_readings import ReplayError
from relnav_sim.simulation.recorded_chunks import last_epoch, on_clock
from relnav_sim.simulation.recording import record
from relnav_sim.simulation.replay import replay_block
from relnav_sim.statistics.residual_checks import nis_check
from relnav_sim.truth import ForceModel, propagate

HEAD = """
name: flight
seed: 5
runs: 3
clock: {duration_s: DURATION, step_s: STEP, store_every_s: 60}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 10, argp_deg: 20, ta_deg: 30}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {position_m: [100, -800, 50], velocity_m_s: [0.05, -0.2, 0.03]}
    mass_kg: 200
    area_m2: 1
"""
GNSS = "gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}"
TRACKER = "star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}"
RADAR = "radar: {range_sigma_m: 1, angle_sigma_deg: 0.1}"
EKF = "{kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-12}}"
DISPERSED = "{kind: dispersed, position_sigma_m: 20, velocity_sigma_m_s: 0.05}"


def campaign(sensors, filters, start=DISPERSED, step="2", duration="600", more="statistics: {settle_s: 200}"):
    lines = ["sensors:", *(f"  {each}" for each in sensors), f"start: {start}", "filters:"]
    lines += [f"  {name}: {entry}" for name, entry in filters.items()]
    return parse_campaign("\n".join([HEAD.replace("STEP", step).replace("DURATION", duration), *lines, more]))


def through_files(made, folder, runs):
    layout = readings_layout(made.cases[0].config.sensors)
    paths = []
    for one in record(made.cases[0].config, made.seed, runs):
        paths.append(folder / f"run{one.run}.csv")
        write_csv(paths[-1], one, layout)
    return load_readings(paths, layout)


CAMPAIGNS = {
    "radar and relative GNSS by GNSS and star tracker": (
        [RADAR, "relative_gnss: {velocity_sigma_m_s: 0.01, period_s: 6}", GNSS, TRACKER],
        {"ekf": EKF, "kf": "{kind: kf, sensors: [radar], dynamics: {kind: cw}}"},
        "{kind: first_fix, velocity_sigma_m_s: 0.3}",
    ),
    "camera alone, chief's orbit carried between fixes": (
        ["camera: {angle_sigma_deg: 0.01, period_s: 10, latency_s: 0.4}", f"{GNSS[:-1]}, period_s: 20}}", TRACKER],
        {"ekf": EKF},
        DISPERSED,
    ),
    "crosslink with clocks": (
        ["crosslink: {range_sigma_m: 0.5, range_rate_sigma_m_s: 0.002, clock_bias_sigma_m: 30, period_s: 10}"],
        {"ekf": f"{EKF[:-1]}, augment: [{{kind: clock, sigma_m: 30, drift_sigma_m_s: 0.01}}]}}"},
        DISPERSED,
    ),
    "particles, with an outage of the radar": (
        [f"{RADAR[:-1]}, noise: [{{kind: gaussian}}, {{kind: outage, windows_s: [[100, 130]]}}]}}"],
        {"pf": "{kind: particle, particles: 100, dynamics: {kind: cw}}"},
        DISPERSED,
    ),
    "one GNSS alone: attitude from the true orbit": ([RADAR, GNSS], {"ekf": EKF}, DISPERSED),
}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_campaign_replayed_gives_its_own_bits(name, tmp_path):
    sensors, filters, start = CAMPAIGNS[name]
    made = campaign(sensors, filters, start, duration="300")
    runs = (0, 2)
    flown = simulate_block(made.cases[0], made.seed, runs).result
    recorded = through_files(made, tmp_path, runs)
    done, unscored = (replay_block(made.cases[0], made.seed, recorded, with_truth) for with_truth in (True, False))
    assert unscored.results == ()
    assert not done.broken and difference_from_campaign(made.cases[0].config, made.seed, recorded) == ""
    for name, own in flown.filters.items():
        stored = done.filters[name].mean[:, :: made.cases[0].config.clock.store_every, :6] - flown.relative
        np.testing.assert_array_equal(stored.astype(own.error.dtype), own.error)
        np.testing.assert_array_equal(unscored.filters[name].mean, done.filters[name].mean)
        (again,) = done.results
        for what, figures in own.summary.items():
            if what != "cpu_per_step":
                np.testing.assert_array_equal(again.filters[name].summary[what], figures, err_msg=what)


def test_normalised_residuals_are_those_of_the_nis():
    made = campaign([RADAR], {"ekf": "{kind: ekf, dynamics: {kind: cw}}"})
    one = next(record(made.cases[0].config, made.seed, [0]))
    alone = replace(one.sensors["radar"], values=np.array(one.sensors["radar"].values))
    alone.values[:, 1:] = np.nan  # ranges only: the NIS is the square of the one channel
    done = replay_block(made.cases[0], made.seed, [replace(one, sensors={"radar": alone})], True)
    found = done.filters["ekf"]
    read = found.dof["radar"][0] == 1
    assert read.sum() == 300
    residuals = found.residuals["radar"].normalised[0]
    np.testing.assert_allclose(np.square(residuals[read, 0]), found.nis["radar"][0, read], rtol=1e-9)
    assert np.isnan(residuals[:, 1:]).all()


def test_nis_of_a_replay_is_that_of_the_campaign_with_the_noise_that_filters_work_with():
    """`alpha_kf` on a linear measurement is `kf` with R / alpha: one NIS judges them, to one verdict."""
    filters = {
        "kf": "{kind: kf, r_scale: 2, dynamics: {kind: cw}}",
        "alpha": "{kind: alpha_kf, alpha: 0.5, samples: 512, sampling: fixed, dynamics: {kind: cw}}",
        "windowed": "{kind: adaptive_alpha_kf, scheme: windowed_nis, window: 20, dynamics: {kind: cw}}",
        "two_step": "{kind: adaptive_two_step, dynamics: {kind: cw}}",
    }
    made, runs = campaign([RADAR], filters, step="10"), (0, 1, 2)
    flown = simulate_block(made.cases[0], made.seed, runs).result
    done = replay_block(made.cases[0], made.seed, list(record(made.cases[0].config, made.seed, runs)), False)
    for name, one in done.filters.items():
        figures = flown.filters[name].diagnostics
        own = figures.get("nis_tempered", flown.filters[name].summary["nis_mean"][:, 0])
        np.testing.assert_allclose(np.nanmean(one.nis["radar"], axis=1), own, rtol=1e-12, err_msg=name)
    kf, alpha = (
        nis_check("radar", done.filters[name].nis["radar"], done.filters[name].dof["radar"]) for name in ("kf", "alpha")
    )
    assert kf.finding == alpha.finding == "conservative"
    np.testing.assert_allclose(alpha.ratio, kf.ratio, rtol=0.01)


def test_change_by_smoothing_is_that_of_the_smoother():
    made = campaign([RADAR], {"kf": "{kind: kf, dynamics: {kind: cw}}"})
    recorded = list(record(made.cases[0].config, made.seed, [0]))
    kept = {}

    def keep(history, dynamics, step_s):
        kept["smoothed"] = smooth(history, dynamics, step_s)
        kept["filtered"] = history
        return kept["smoothed"]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("relnav_sim.simulation.replay.smooth", keep)
        done = replay_block(made.cases[0], made.seed, recorded, False)
    change = done.filters["kf"].smoothed_change
    assert np.isnan(change[:, -1]).all()  # at the end filter and smoother are one
    # Linear dynamics, so that the smoother is exact: no smoothed covariance is larger than the filtered one.
    gained = kept["filtered"].covariance - kept["smoothed"].covariance
    assert np.linalg.eigvalsh(gained[0]).min() > -1e-9 * np.linalg.eigvalsh(kept["filtered"].covariance[0]).max()
    assert np.mean(np.abs(change[np.isfinite(change)]) < 3) > 0.98


def thinned(one, name, rows):
    each = one.sensors[name]
    rows = np.asarray(rows)
    return SensorReadings(each.times_s[rows], each.values[rows], each.files, each.origins[rows])


@pytest.mark.parametrize("sensor", ["radar", "relative_gnss"])
def test_readings_between_epochs_are_used_as_those_of_a_fine_clock(sensor):
    # What else differs would be the noise of the host's own sensors, at other times: 5 mm by the GNSS's at 800 m.
    relative, own = {"radar": ([RADAR], ()), "relative_gnss": (["relative_gnss: {}", GNSS], ("gnss",))}[sensor]
    fine = campaign(relative, {"ekf": EKF}, step="0.5")
    coarse = campaign(relative, {"ekf": EKF})
    one = next(record(fine.cases[0].config, fine.seed, [0]))
    # A reading every 4 s or so, never at the same place between two epochs of 2 s twice in a row.
    rows = np.arange(3, 1200, 8) + np.tile([0, 1, 2, 3, 5], 30)
    thin = replace(one, sensors={**one.sensors, sensor: thinned(one, sensor, rows)})
    exact = replay_block(fine.cases[0], fine.seed, [thin], True)
    own = {name: thinned(one, name, np.arange(0, 1201, 4)) for name in own}
    off = replace(thin, sensors={**own, sensor: thin.sensors[sensor]})
    late = replay_block(coarse.cases[0], coarse.seed, [off], True)
    assert late.longest_late_s == 1.5 and not late.warnings
    a, b = exact.filters["ekf"].mean[0, ::4, :6], late.filters["ekf"].mean[0, :, :6]
    # Left out: a t^2 / 2 of each measurement, with 3 n^2 x + 2 n v_y = 8e-4 m/s^2 over at most 1.5 s.
    left_out_m = 0.5 * 8e-4 * 1.5**2
    settled = slice(30, None)
    assert np.abs(a - b)[settled, :3].max() < 2 * left_out_m + 0.005 * bool(own)
    whole = replace(off.sensors[sensor], times_s=np.ceil(off.sensors[sensor].times_s / 2) * 2)
    told_nothing = replace(off, sensors={**off.sensors, sensor: whole})
    wrong = replay_block(coarse.cases[0], coarse.seed, [told_nothing], True).filters["ekf"].mean[0, :, :6]
    assert np.abs(a - wrong)[settled, :3].max() > 10 * np.abs(a - b)[settled, :3].max()


def test_filters_take_late_readings_in_every_form():
    filters = {
        "converted": "{kind: kf, dynamics: {kind: cw}}",
        "sigma points": "{kind: ukf, dynamics: {kind: nonlinear_j2}}",
        "augmented": f"{EKF[:-1]}, augment: [{{kind: range_bias, sigma_m: 1}}]}}",
    }
    named = {name.replace(" ", "_"): entry for name, entry in filters.items()}
    sensors = [RADAR, GNSS, TRACKER]
    fine, coarse = campaign(sensors, named, step="0.5"), campaign(sensors, named)
    one = next(record(fine.cases[0].config, fine.seed, [0]))
    late = {name: thinned(one, name, np.arange(3, 1200, 4)) for name in one.sensors}  # half a second, each of them
    done = replay_block(coarse.cases[0], coarse.seed, [replace(one, sensors=late)], True)
    assert not done.broken and not done.warnings and done.longest_late_s == 0.5
    for name, found in done.filters.items():
        checked = nis_check(name, found.nis["radar"], found.dof["radar"], level=0.999)
        assert checked.updates == 300
        assert checked.band.low < checked.ratio < checked.band.high


def test_fixes_between_epochs_are_carried_on_in_free_fall():
    made = campaign([RADAR, GNSS, TRACKER], {"ekf": EKF}, step="10")
    config = made.cases[0].config
    values = config.truth.constants
    force = ForceModel(values.mu_m3_s2, values.radius_m, (values.j2,))
    state = np.array([[6878e3, 0, 0, 0, 4733.0, 5972.0]])
    times_s = np.array([0.0, 6.0, 10.0, 13.0, 20.0])
    flown = propagate(state, times_s, force)[0]
    fixes = SensorReadings(times_s[[0, 1, 3]], flown[[0, 1, 3]], ("x",), np.zeros((3, 2), dtype=np.int64))
    z = on_clock(config, [Readings({"gnss": fixes})], 4).z["gnss"][0]
    np.testing.assert_allclose(z[[1, 2], :3], flown[[2, 4], :3], atol=1e-4)
    np.testing.assert_allclose(z[[1, 2], 3:], flown[[2, 4], 3:], atol=1e-6)


def test_attitudes_between_epochs_turn_with_the_orbit():
    made = campaign([RADAR, GNSS, TRACKER], {"ekf": EKF}, step="10")
    config = made.cases[0].config
    values = config.truth.constants
    state = np.array([[6878e3, 0, 0, 0, 4733.0, 5972.0]])
    times_s = np.array([0.0, 6.0, 10.0])
    flown = propagate(state, times_s, ForceModel(values.mu_m3_s2, values.radius_m, (values.j2,)))[0]
    quaternions = np.stack(quaternion_from_axes(nadir_axes(flown)), axis=-1)
    origins = np.zeros((2, 2), dtype=np.int64)
    own = {
        "gnss": SensorReadings(times_s[[0, 2]], flown[[0, 2]], ("x",), origins),
        "star_tracker": SensorReadings(times_s[:2], quaternions[:2], ("x",), origins),
    }
    turned = on_clock(config, [Readings(own)], 2).z["star_tracker"][0, 1]
    # Against the nadir frame of the orbit flown. A perturbed orbit's plane turns, by 1e-6 rad in 4 s; unturned is 4e-3.
    angle = 2 * np.arccos(np.clip(np.abs(turned @ quaternions[2]), 0, 1))
    assert angle < 5e-6
    assert 2 * np.arccos(np.abs(quaternions[1] @ quaternions[2])) > 4e-3


def test_accelerometers_are_read_at_the_epochs():
    accelerometer = "accelerometer: {velocity_random_walk_m_s_sqrt_s: 1.0e-4, host: deputy}"
    made = campaign([RADAR, accelerometer], {"ekf": EKF}, "{kind: first_fix}")
    one = next(record(made.cases[0].config, made.seed, [0]))
    felt = one.sensors["deputy_accelerometer"]
    late = replace(felt, times_s=felt.times_s + 0.5)
    with pytest.raises(ReplayError, match="measurements of deputy_accelerometer lie between the epochs"):
        on_clock(made.cases[0].config, [replace(one, sensors={**one.sensors, "deputy_accelerometer": late})], 302)


def radar_only(times_s, m=3):
    times_s = np.asarray(times_s, dtype=float)
    values = np.tile([800.0, 3.0, 0.0][:m], (len(times_s), 1))
    origins = np.stack([np.zeros(len(times_s), dtype=np.int64), np.arange(2, len(times_s) + 2)], axis=1)
    return {"radar": SensorReadings(times_s, values, ("pass.csv",), origins)}


@pytest.mark.parametrize(
    ("recorded", "sentence"),
    [
        (radar_only([1.0, 1.4]), r"pass\.csv:3: radar reads at 1 s and at 1\.4 s, .* smaller clock\.step_s, 0\.4 say"),
        (radar_only([-3.0, 2.0]), r"pass\.csv:2: radar reads at -3 s, before the campaign's start"),
        (
            radar_only([2.0, 601.0]),
            r"pass\.csv:3: .* after the campaign's end at 600 s; give --set clock\.duration_s=602",
        ),
        (
            {"lidar": radar_only([2.0])["radar"]},
            "measurements of lidar, which the campaign does not have; it has radar",
        ),
        ({}, "no measurements of radar, by which the filter ekf goes"),
    ],
)
def test_readings_that_do_not_fit_are_refused_with_the_remedy(recorded, sentence):
    made = campaign(
        [RADAR],
        {"ekf": EKF},
        "{kind: given, position_m: [0, -800, 0], velocity_m_s: [0, 0, 0], "
        "position_sigma_m: 50, velocity_sigma_m_s: 0.1}",
    )
    with pytest.raises(ReplayError, match=sentence):
        replay_block(made.cases[0], made.seed, [Readings(recorded)], False)


def test_a_start_that_is_not_known_is_refused():
    made = campaign([RADAR], {"ekf": EKF})
    with pytest.raises(ReplayError, match="starts its filters at the truth plus an error"):
        replay_block(made.cases[0], made.seed, [Readings(radar_only([0.0, 2.0]))], False)
    made = campaign([RADAR], {"ekf": EKF}, "{kind: first_fix}")
    with pytest.raises(ReplayError, match="no whole measurement of radar at 0 s"):
        replay_block(made.cases[0], made.seed, [Readings(radar_only([2.0, 4.0]))], False)


def test_a_host_needs_its_own_sensors_readings():
    made = campaign([RADAR, GNSS, TRACKER], {"ekf": EKF}, "{kind: first_fix}")
    with pytest.raises(ReplayError, match=r"no measurements of gnss, .* --set sensors\.gnss=null"):
        replay_block(made.cases[0], made.seed, [Readings(radar_only([0.0, 2.0]))], False)


def test_fixes_that_are_missing_cost_readings_and_that_is_said():
    made = campaign([RADAR, GNSS, TRACKER], {"ekf": EKF}, "{kind: first_fix}")
    one = next(record(made.cases[0].config, made.seed, [0]))
    few = replace(one, sensors={**one.sensors, "gnss": thinned(one, "gnss", np.arange(0, 301, 3))})
    done = replay_block(made.cases[0], made.seed, [few], False)
    assert len(done.warnings) == 1 and done.warnings[0].startswith("200 of 301 measurements of radar are lost")


def test_a_replay_ends_with_the_readings_unless_they_have_gaps_as_long():
    config = campaign([RADAR], {"ekf": EKF}).cases[0].config
    assert last_epoch(config, [Readings(radar_only(np.arange(0, 202, 4.0)))]) == 100
    assert last_epoch(config, [Readings(radar_only([0.0, 300.0, 599.0]))]) == 300
    assert last_epoch(config, [Readings(radar_only(np.arange(0, 600, 4.0)))]) == 300


def test_velocities_held_for_too_long_are_warned_of_and_then_refused():
    start = (
        "{kind: given, position_m: [100, -800, 50], velocity_m_s: [0.05, -0.2, 0.03], position_sigma_m: 5, "
        "velocity_sigma_m_s: 0.01}"
    )

    def replayed(range_sigma_m, step):
        radar = f"radar: {{range_sigma_m: {range_sigma_m}, angle_sigma_deg: 0.001}}"
        fine = campaign([radar], {"ekf": EKF}, start, step="1")
        one = next(record(fine.cases[0].config, fine.seed, [0]))
        rows = np.arange(1, 600, int(step))
        made = campaign([radar], {"ekf": EKF}, start, step=step)
        return replay_block(
            made.cases[0], made.seed, [replace(one, sensors={"radar": thinned(one, "radar", rows)})], False
        )

    assert not replayed(1, "2").warnings
    (warning,) = replayed(0.3, "20").warnings
    assert "choose a clock.step_s of" in warning
    with pytest.raises(ReplayError, match="velocities held constant meanwhile put them off by"):
        replayed(0.01, "60")


def test_readings_of_another_flight_are_not_taken_for_the_campaigns():
    made = campaign([RADAR], {"ekf": EKF})
    config = made.cases[0].config
    one = next(record(config, made.seed, [1]))
    spoilt = np.array(one.sensors["radar"].values)
    spoilt[::4] += 50
    few = replace(one, sensors={"radar": replace(one.sensors["radar"], values=spoilt)})
    assert difference_from_campaign(config, made.seed, [few]) == ""
    assert difference_from_campaign(config, made.seed, [replace(one, run=2)]) != ""
    assert difference_from_campaign(config, made.seed + 1, [one]) != ""
