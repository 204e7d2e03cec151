"""Filters that are equal cost the same, whichever comes first in a process."""

from pathlib import Path

import pytest

from relnav_sim import load_campaign, open_results, run_campaign

EQUAL = """
name: equal
seed: 1
runs: 200
clock: {duration_s: 11000, step_s: 10, store_every_s: 1000}
truth:
  chief: {orbit: {altitude_km: 450, i_deg: 51.6}, mass_kg: 500, area_m2: 3}
  deputy: {relative: {position_m: [0, -5000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 100, area_m2: 1}
sensors: {radar: {range_sigma_m: 4, angle_sigma_deg: 0.1}}
start: {kind: dispersed, position_sigma_m: 20, velocity_sigma_m_s: 0.02}
statistics: {settle_s: 3000}
filters:
  first: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-9}}
"""


@pytest.mark.slow
def test_equal_filters_cost_the_same_in_a_fresh_worker(tmp_path: Path) -> None:
    """The first took three times as long as the third while what it touched of memory counted."""
    entry = EQUAL.splitlines()[-1].partition("first: ")[2]
    text = EQUAL + "".join(f"  {name}: {entry}\n" for name in ("second", "third", "fourth"))
    (tmp_path / "equal.yaml").write_text(text, encoding="utf-8")
    out = run_campaign(load_campaign(tmp_path / "equal.yaml"), tmp_path / "equal.h5", workers=1)
    with open_results(out) as results:
        costs = [float(results.statistic(0, name, "cpu_per_step").mean()) for name in results.filters]
    assert max(costs) < 1.5 * min(costs), costs
