"""What the report says a campaign leaves out: whether runs fly different truths, against the truths that were flown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign import parse_campaign
from relnav_sim.report.scenario import limitations
from relnav_sim.report.told import told_table

CAMPAIGN = """
name: truths
seed: 3
runs: 2
bound: false
clock: {duration_s: 60, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {altitude_km: 500, i_deg: 50}, mass_kg: 100, area_m2: 1}
  deputy: {relative: {position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 100, area_m2: 1}
  forces: {zonals: 2, drag: exponential}
  TRUTH
sensors: {radar: {range_sigma_m: 4, angle_sigma_deg: 0.1}}
start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.1}
filters:
  planned: {kind: ekf}
  blind: {kind: ekf, known_thrust: none}
statistics: {settle_s: 20}
"""
SAME = "Every run flies the same true trajectory: runs differ in measurement noise and start only."
PERFECT = "Manoeuvres are executed without error."


@pytest.mark.parametrize(
    ("truth", "same", "perfect"),
    [
        ("earth_orientation: null", True, False),
        ("dispersions: {deputy_ballistic: {kind: normal, sigma: 0.1}}", False, False),
        ("manoeuvres: {go: {time_s: 20, delta_v_m_s: [0, 1, 0]}}", True, True),
        (
            "manoeuvres: {go: {time_s: 20, delta_v_m_s: [0, 1, 0]}}\n  execution_errors: {magnitude_sigma_percent: 2}",
            False,
            False,
        ),
        ("manoeuvres: {go: {time_s: 20, delta_v_m_s: [0, 1, 0], errors: {timing_sigma_s: 1}}}", False, False),
    ],
    ids=["nothing", "drag", "perfect burn", "errors of all", "errors of its own"],
)
def test_the_truth_is_the_same_in_every_run_where_nothing_is_drawn(
    truth: str, same: bool, perfect: bool, tmp_path: Path
) -> None:
    out = tmp_path / "truths.h5"
    run_campaign(parse_campaign(CAMPAIGN.replace("TRUTH", truth)), out, backend="sequential")
    with open_results(out) as results:
        flown = results.truth(0)
        assert (len(flown) == 1 or bool(np.ptp(flown, axis=0).max() < 1e-9)) == same
        said = limitations(results)
        rows = {row.label: [cell.text for cell in row.cells] for row in told_table(results, 0).rows}
    assert (SAME in said, PERFECT in said) == (same, perfect)
    if not same and "go" in truth:
        assert rows["manoeuvres: execution errors"][1:] == ["as process noise", "not told"]
    else:
        assert "manoeuvres: execution errors" not in rows
    assert "The truth has no third bodies and no solar radiation pressure." in said
