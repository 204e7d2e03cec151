"""Learned dynamics in a campaign: trained on a flight of their own, the same in every block."""

import numpy as np
import pytest
from small_campaign import assert_same_bits

from relnav_sim import open_results, run_campaign
from relnav_sim.models.gp import GpOptions
from relnav_sim.runner.training import training_track

LEARNED = (
    "filters.learned={kind: gp_ukf, dynamics: {kind: gp, training_points: 60, training_span_s: 80, restarts: 0},"
    " process_noise: {acceleration_psd_m2_s3: 1e-6}}"
)


@pytest.mark.parametrize("source", ["truth", "smoothed_radar"])
def test_the_training_track_is_near_the_nominal_motion_and_no_run(campaign, source):
    parsed = campaign(LEARNED)
    config = parsed.cases[0].config
    entry = config.filters["learned"]
    track = training_track(config, entry, GpOptions(training=source, training_span_s=80), parsed.seed)
    assert len(track.states) == len(track.time_s) >= 80
    assert np.allclose(np.diff(track.time_s), 1.0)
    assert np.abs(track.states[0, :3] - [0, -2000, 100]).max() < 5 * 50 + 20
    assert (np.isfinite(track.states)).all()


def test_learned_dynamics_give_the_same_bits_in_every_block(campaign, tmp_path):
    one = run_campaign(campaign(LEARNED, "runs=3", "block_runs=3"), tmp_path / "one.h5", backend="sequential")
    many = run_campaign(campaign(LEARNED, "runs=3", "block_runs=1"), tmp_path / "many.h5", workers=2)
    assert_same_bits(one, many)
    with open_results(one) as results:
        assert not results.failures()
