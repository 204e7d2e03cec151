"""The three signs of a diverged run, one by one, and on filters of which it is known whether they diverge."""

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

OUTAGE = """
name: outage
seed: 5
runs: 12
clock: {duration_s: 1000, step_s: 2, store_every_s: 4}
truth:
  chief: {orbit: {a_km: 10878, e: 0.3, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}, mass_kg: 200, area_m2: 1}
  deputy: {relative: {position_m: [0, -2000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 200, area_m2: 1}
sensors:
  radar:
    range_sigma_m: 1
    angle_sigma_deg: 0.01
    noise: [{kind: gaussian}, {kind: outage, windows_s: [[200, 430]]}]
start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.05}
statistics: {settle_s: 500}
filters:
  honest: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-4}}
  wrong: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.3e-6}}
"""


def _flown(folder: Path, text: str) -> Path:
    (folder / "flown.yaml").write_text(text, encoding="utf-8")
    return run_campaign(load_campaign(folder / "flown.yaml"), folder / "flown.h5", backend="sequential")


def test_failed_or_long_outside_the_ellipsoid() -> None:
    failed = np.array([False, True, False, False, False])
    outside = np.array([0.05, np.nan, 0.051, np.nan, 1.0])
    assert diverged(failed, outside).tolist() == [False, True, True, False, True]


def test_ten_times_the_bound_and_outside_the_ellipsoid_for_50_s_on_end() -> None:
    time_s = 10.0 * np.arange(20, dtype=np.float64)
    bound = np.linspace(2, 1, 20, dtype=np.float64)
    r = np.ones((7, 20))
    r[1, 3:9] = 25  # six stored epochs: 50 s
    r[2, 3:8] = 25  # five: 40 s
    r[3, [3, 4, 5, 7, 8, 9, 10]] = 25  # interrupted
    r[4] = 10 * bound  # at the limit, not beyond it
    r[5, 10:] = np.nan  # failed: seen elsewhere
    r[6] = 25  # large, and told of by the filter's covariance
    nees = np.full((7, 20), 27.9)  # the 0.9999 quantile of chi-square with 6 degrees of freedom is 27.856
    nees[6] = 27.8
    assert far_beyond_bound(r, nees, time_s, bound).tolist() == [False, True, False, False, False, False, False]
    bound[5] = np.nan
    assert not far_beyond_bound(r, nees, time_s, bound).any()


def test_large_errors_that_the_covariance_tells_of_do_not_count_and_others_do(tmp_path: Path) -> None:
    """In an outage both are ten times the bound off; only the filter with a wrong model isn't consistent.

    Neither is outside its ellipsoid in the last half of the run, where the second sign looks.
    """
    out = _flown(tmp_path, OUTAGE)
    with open_results(out) as results:
        time_s, bound = results.time_s(0), results.perfect_bound(0, "honest")
        assert bound is not None
        for name, counts in (("honest", 0), ("wrong", 12)):
            r = np.linalg.norm(results.error(0, name)[..., :3], axis=-1)
            assert (r[:, time_s == 424] > 10 * bound[time_s == 424, 6]).mean() > 0.5, name
            assert not diverged(np.zeros(12, dtype=bool), results.statistic(0, name, "outside_late")).any()
            assert diverged_runs(results, 0, name).sum() == counts
        formal = results.statistic(0, "honest", "anees")[:, 0, 0].mean()
        assert formal < 1.5  # so by its own covariance it is right


def test_a_filter_that_waits_for_its_start_has_not_diverged(tmp_path: Path) -> None:
    out = _flown(tmp_path, WAITING)
    with open_results(out) as results:
        r = np.linalg.norm(results.error(0, "ekf")[..., :3], axis=-1)
        bound = results.perfect_bound(0, "ekf")
        assert bound is not None
        # Beside the bound, which has the readings already, most are far off while they wait.
        assert (r > 10 * bound[:, 6]).any(axis=1).sum() >= 2
        assert not diverged_runs(results, 0, "ekf").any()
