"""The three signs of a lost run, one by one."""

from pathlib import Path

import numpy as np

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.statistics.divergence import diverged, diverged_runs, far_beyond_bound

WAITING = """
name: waiting
seed: 4
runs: 4
clock: {duration_s: 300, step_s: 2, store_every_s: 4}
truth:
  chief: {orbit: {a_km: 6878, e: 0, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}, mass_kg: 200, area_m2: 1}
  deputy: {relative: {position_m: [0, -2000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 200, area_m2: 1}
sensors: {radar: {range_sigma_m: 1, angle_sigma_deg: 0.01}}
start: {kind: dispersed, position_sigma_m: [100, 100, 100], velocity_sigma_m_s: [0.5, 0.5, 0.5]}
statistics: {settle_s: 160}
filters:
  ekf: {kind: ekf, batch_start: {duration_s: 100}}
"""


def test_failed_or_long_outside_the_ellipsoid() -> None:
    failed = np.array([False, True, False, False, False])
    outside = np.array([0.05, np.nan, 0.051, np.nan, 1.0])
    assert diverged(failed, outside).tolist() == [False, True, True, False, True]


def test_ten_times_the_bound_for_50_s_on_end() -> None:
    time_s = 10.0 * np.arange(20)
    bound = np.linspace(2, 1, 20)
    r = np.ones((6, 20))
    r[1, 3:9] = 25  # six stored epochs: 50 s
    r[2, 3:8] = 25  # five: 40 s
    r[3, [3, 4, 5, 7, 8, 9, 10]] = 25  # interrupted
    r[4] = 10 * bound  # at the limit, not beyond it
    r[5, 10:] = np.nan  # failed: seen elsewhere
    assert far_beyond_bound(r, time_s, bound).tolist() == [False, True, False, False, False, False]
    bound[5] = np.nan
    assert not far_beyond_bound(r, time_s, bound).any()


def test_a_filter_that_waits_for_its_start_is_not_lost(tmp_path: Path) -> None:
    (tmp_path / "waiting.yaml").write_text(WAITING, encoding="utf-8")
    out = run_campaign(load_campaign(tmp_path / "waiting.yaml"), tmp_path / "waiting.h5", backend="sequential")
    with open_results(out) as results:
        r = np.linalg.norm(results.error(0, "ekf")[..., :3], axis=-1)
        bound = results.perfect_bound(0, "ekf")
        assert bound is not None
        # By the bound alone, most would be lost while they wait.
        assert far_beyond_bound(r, results.time_s(0), bound[:, 6]).sum() >= 2
        assert not diverged_runs(results, 0, "ekf").any()
