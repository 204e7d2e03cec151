"""Learned dynamics in a campaign: trained on what the same two craft flew before, the same in every block."""

import numpy as np
import pytest
from small_campaign import assert_same_bits

from relnav_sim import open_results, run_campaign
from relnav_sim.dynamics.gp.options import GpOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.quadratic import CwSecondOrderOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.training import training_track

LEARNED = (
    "filters.learned={kind: gp_ukf, dynamics: {kind: gp, training_points: 60, training_span_s: 80, restarts: 0},"
    " process_noise: {acceleration_psd_m2_s3: 1e-6}}"
)


def track_of(parsed, **options):
    noise = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-6)
    return training_track(parsed.cases[0].config, GpOptions(training_span_s=80, **options), noise, parsed.seed)


@pytest.mark.parametrize("calibration_span_s", [None, 0.0, 200.0])
def test_the_true_track_ends_at_the_nominal_start(campaign, calibration_span_s):
    track = track_of(campaign(LEARNED), training="truth", calibration_span_s=calibration_span_s)
    spent = 80 + (80 if calibration_span_s is None else calibration_span_s)
    np.testing.assert_allclose(track.time_s, np.arange(-spent, 1.0))
    np.testing.assert_allclose(track.states[-1], [0, -2000, 100, 0.05, 0, 0.1], atol=1e-6)


def test_the_smoothed_track_is_that_of_the_radar(campaign):
    """2 m and 0.1 deg at 2 km; smoothed over 160 s its error is far below one reading's 3.5 m."""
    parsed = campaign(LEARNED)
    true, smoothed = (track_of(parsed, training=source) for source in ("truth", "smoothed_radar"))
    assert smoothed.first_epoch == 1 and len(smoothed.states) == 160
    error = smoothed.states - true.states[1:]
    assert 0.01 < np.sqrt(np.square(error[:, :3]).sum(axis=1).mean()) < 2
    other_base = track_of(parsed, base=NonlinearJ2Options())
    assert not np.array_equal(other_base.states, smoothed.states)
    assert not np.array_equal(track_of(parsed, base=CwSecondOrderOptions()).states, smoothed.states)


def test_a_radar_that_sees_nothing_gives_nothing_to_learn_from(campaign):
    with pytest.raises(ValueError, match="nothing to learn from"):
        track_of(campaign(LEARNED, "sensors.radar.range_limits_m=[0, 10]"))


@pytest.mark.slow
def test_learned_dynamics_give_the_same_bits_in_every_block(campaign, tmp_path):
    one = run_campaign(campaign(LEARNED, "runs=3", "block_runs=3"), tmp_path / "one.h5", backend="sequential")
    many = run_campaign(campaign(LEARNED, "runs=3", "block_runs=1"), tmp_path / "many.h5", workers=2)
    assert_same_bits(one, many)
    with open_results(one) as results:
        assert not results.failures()


def test_a_worker_trains_once_for_all_its_blocks_filters_and_bounds(campaign, tmp_path, monkeypatch):
    trained = counted_training(monkeypatch)
    again = LEARNED.replace("filters.learned", "filters.again")
    parsed = campaign(LEARNED, again, "runs=3", "block_runs=1")
    run_campaign(parsed, tmp_path / "out.h5", backend="sequential")
    assert len(trained) == len(parsed.cases)


def test_a_block_keeps_nothing_that_it_was_not_given(campaign, monkeypatch):
    trained = counted_training(monkeypatch)
    parsed = campaign(LEARNED, "runs=1")
    learned = Learned()
    found = [
        simulate_block(parsed.cases[0], parsed.seed, [0], learned=given).result.filters["learned"]
        for given in (None, None, learned, learned)
    ]
    assert len(trained) == 3
    for other in found[1:]:
        assert np.array_equal(other.error, found[0].error)


def counted_training(monkeypatch):
    trained = []

    def counted(*args):
        trained.append(args)
        return training_track(*args)

    monkeypatch.setattr("relnav_sim.simulation.learned.training_track", counted)
    return trained
