"""Stressed cases: the truth is the stress's, everything that filters are told is the nominal case's."""

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.simulation.block import filter_block, simulate_block
from relnav_sim.simulation.chunks import chunks, simulate
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.recording import record
from relnav_sim.simulation.replay import replay_block
from relnav_sim.streams import RandomSource

TEXT = """
name: stressed
seed: 5
runs: 2
clock: {duration_s: 60, step_s: 2, store_every_s: 4}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 10, argp_deg: 20, ta_deg: 30}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {position_m: [100, -800, 50], velocity_m_s: [0.05, -0.2, 0.03]}
    mass_kg: 200
    area_m2: 1
  manoeuvres:
    hop: {time_s: 20, duration_s: 10, delta_v_m_s: [0.1, 0, 0]}
sensors:
  radar: {range_sigma_m: 1, angle_sigma_deg: 0.1}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
start: {kind: dispersed, position_sigma_m: 20, velocity_sigma_m_s: 0.05}
statistics: {settle_s: 20}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-10}}
  kf: {kind: kf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-8}}
"""
EVERYTHING = """
stress:
  everything:
    truth.forces.zonals: 0
    truth.deputy.mass_kg: {times: 0.1}
    truth.manoeuvres.hop.delta_v_m_s: {times: 4}
    truth.dispersions.relative_position: {kind: normal, sigma_m: 30}
    sensors.radar.range_sigma_m: {times: 4}
    sensors.radar.azimuth_bias_deg: 0.3
    sensors.radar.latency_s: 0.5
    sensors.radar.noise: [{kind: gaussian}, {kind: outage, windows_s: [[40, 50]]}]
    sensors.gnss.position_sigma_m: {times: 3}
    start.position_sigma_m: {times: 5}
"""
RUNS = (0, 1)


@pytest.fixture(scope="module")
def made():
    return parse_campaign(TEXT + EVERYTHING)


def test_truth_and_readings_are_those_of_a_campaign_with_that_truth(made):
    """A campaign that is told of everything has the same draws, so its truth and raw readings are the same bits."""
    (case,) = made.stressed
    told = parse_campaign(
        TEXT.replace("manoeuvres:", "forces: {zonals: 0}\n  manoeuvres:", 1)
        .replace("    mass_kg: 200\n    area_m2: 1\n  forces", "    mass_kg: 20\n    area_m2: 1\n  forces")
        .replace("delta_v_m_s: [0.1,", "delta_v_m_s: [0.4,")
        .replace("sensors:", "  dispersions: {relative_position: {kind: normal, sigma_m: 30}}\nsensors:", 1)
        .replace("gnss: {position_sigma_m: 10", "gnss: {position_sigma_m: 30")
        .replace(
            "radar: {range_sigma_m: 1, angle_sigma_deg: 0.1}",
            "radar: {range_sigma_m: 4, angle_sigma_deg: 0.1, azimuth_bias_deg: 0.3, latency_s: 0.5, "
            "noise: [{kind: gaussian}, {kind: outage, windows_s: [[40, 50]]}]}",
        )
    )
    assert told.cases[0].config.truth.model_dump() == case.config.flown.truth.model_dump()
    flown, nominal = simulate(made.with_stress(), 1, RUNS), simulate(made, 0, RUNS)
    same = simulate(told, 0, RUNS)
    for part in ("chief", "deputy", "relative"):
        np.testing.assert_array_equal(getattr(flown, part), getattr(same, part))
    for name, z in same.z.items():
        np.testing.assert_array_equal(flown.z[name], z)
        assert not np.array_equal(flown.z[name], nominal.z[name]) or name == "star_tracker"


def test_filters_are_those_of_the_nominal_case(made):
    """The recorded readings of the stressed case, replayed with the nominal one, give its estimates to the bit."""
    (case,) = made.stressed
    own = simulate_block(case, made.seed, RUNS).result
    recorded = list(record(case.config, made.seed, RUNS))
    replayed = replay_block(made.cases[0], made.seed, recorded, with_truth=False)
    assert not own.failures and not replayed.broken
    for name in case.config.filters:
        estimate = replayed.filters[name].mean[:, ::2, :6]
        np.testing.assert_array_equal((estimate - own.relative).astype(np.float32), own.filters[name].error)
    assert own.relative.shape[0] == len(RUNS) and not own.shared_truth  # the stress disperses it


def test_the_start_errs_as_stressed_and_its_covariance_does_not_know(made):
    (case,) = made.stressed
    true = simulate(made.with_stress(), 1, RUNS).relative[:, 0]
    drawn = RandomSource(made.seed, RUNS).streams("start").normal(6)
    for place, readings in enumerate(record(case.config, made.seed, RUNS)):
        expected = true[place] + drawn[place] * [100, 100, 100, 0.05, 0.05, 0.05]
        np.testing.assert_allclose(readings.start.mean, expected, rtol=1e-12)
        np.testing.assert_array_equal(np.sqrt(np.diag(readings.start.covariance)), [20] * 3 + [0.05] * 3)


@pytest.mark.parametrize(
    ("start", "stress", "moved"),
    [
        ("{kind: first_fix}", "start.velocity_m_s: [0, 0.3, 0]", [0, 0, 0, 0, 0.3, 0]),
        (
            "{kind: given, position_m: [1, 2, 3], velocity_m_s: [0, 0, 0], position_sigma_m: 5, velocity_sigma_m_s: 1}",
            "start.position_m: {times: 2}",
            [1, 2, 3, 0, 0, 0],
        ),
    ],
)
def test_a_start_that_draws_nothing_is_moved(start, stress, moved):
    text = TEXT.replace("{kind: dispersed, position_sigma_m: 20, velocity_sigma_m_s: 0.05}", start)
    made = parse_campaign(f"{text}stress: {{prior: {{{stress}}}}}\n")
    (nominal,), (wrong,) = (list(record(case.config, made.seed, [0])) for case in (*made.cases, *made.stressed))
    np.testing.assert_allclose(wrong.start.mean - nominal.start.mean, moved, atol=1e-12)
    np.testing.assert_array_equal(wrong.start.covariance, nominal.start.covariance)


def test_a_receiver_that_fails_though_nobody_expects_it_leaves_the_angles_without_a_frame():
    outage = "{sensors.gnss.noise: [{kind: gaussian}, {kind: outage, windows_s: [[20, 31]]}]}"
    made = parse_campaign(f"{TEXT}stress:\n  lost: {outage}\n")
    flown = simulate(made.with_stress(), 1, RUNS)
    out = (flown.times_s >= 20) & (flown.times_s < 31)
    assert (np.isnan(flown.inputs["radar"][..., 1:]).all(axis=(0, 2)) == out).all()
    assert not np.isnan(flown.inputs["radar"][..., 0]).any()


def test_nothing_is_learned_from_a_stress():
    gp = "{kind: gp_ukf, dynamics: {kind: gp, training: smoothed_radar, training_points: 50, training_span_s: 120}}"
    parsed = parse_campaign(f"{TEXT}  learned: {gp}\n{EVERYTHING}")
    cases = (parsed.cases[0], parsed.stressed[0])
    tracks = []
    for learned in (Learned(), Learned()):
        for case in cases:
            learned.by(case.config.filters["learned"], case.config, parsed.seed)(
                lambda track: tracks.append(track) or 1
            )
        cases = cases[::-1]
    assert len(tracks) == 2  # a stressed case and its nominal case learn the same, so that it is learned once
    np.testing.assert_array_equal(tracks[0].states, tracks[1].states)


LATE = """
stress:
  late:
    sensors.radar.drawn_latency_s: [0, 20]
"""


def test_a_fixed_lag_leaves_out_what_arrives_after_its_estimate():
    """Latencies that no filter is told of: a lag of 10 s has readings up to 10 s late, after the run there are all."""
    smoothers = "".join(
        f"  {name}: {{kind: kf, dynamics: {{kind: cw}}, process_noise: {{acceleration_psd_m2_s3: 1.0e-8}}, "
        f"smoother: {smoother}}}\n"
        for name, smoother in (("lag", "{fixed_lag: {lag_s: 10}}"), ("rts", "rts"))
    )
    made = parse_campaign(TEXT + smoothers + LATE)
    (case,) = made.stressed
    source = RandomSource(made.seed, RUNS)
    (chunk,) = chunks(case.config, source)
    late = chunk.delays["radar"][:, 1:]
    assert (late > 5).any() and ((late > 0) & (late <= 5)).any()
    counts = {}

    class Watch:
        def __call__(self, name, filter, chunk, before, history):
            counts[name] = history.dof[:, 1:]

        def afterwards(self, name, chunk, history):
            pass

    outcome = filter_block(case, source, chunks(case.config, source), watch=Watch())
    assert not outcome.broken
    for name, most in (("kf", 0), ("lag", 5), ("rts", 10)):
        np.testing.assert_array_equal(counts[name] > 0, late <= most, err_msg=name)
