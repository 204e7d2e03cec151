"""Which sensors' innovations have no chi-square band, of a campaign with two sensors that was flown."""

from __future__ import annotations

from pathlib import Path

import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign import parse_campaign
from relnav_sim.plots.facts import case_facts

CAMPAIGN = """
name: mixtures
seed: 3
runs: 1
clock: {duration_s: 20, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {altitude_km: 500, i_deg: 50}, mass_kg: 100, area_m2: 1}
  deputy: {relative: {position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 100, area_m2: 1}
sensors:
  radar: {range_sigma_m: 4, angle_sigma_deg: 0.1, noise: {kind: RADAR}}
  camera: {angle_sigma_deg: 0.01}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30, noise: {kind: TRACKER}}
filters: {ekf: {kind: ekf}}
statistics: {settle_s: 10}
"""


@pytest.mark.parametrize(
    ("radar", "tracker", "expected"),
    [
        ("gaussian", "gaussian", ()),
        ("mixture, scale: 5, fraction: 0.1", "gaussian", ("radar",)),
        ("gaussian", "mixture, scale: 5, fraction: 0.1", ("radar", "camera")),
    ],
)
def test_the_attitude_is_in_the_innovations_of_every_sensor(
    radar: str, tracker: str, expected: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "mixtures.h5"
    run_campaign(
        parse_campaign(CAMPAIGN.replace("RADAR", radar).replace("TRACKER", tracker)), out, backend="sequential"
    )
    with open_results(out) as results:
        (facts,) = case_facts(results, 0).filters
    assert facts.mixture_sensors == expected
    assert facts.host_mixtures == (("star_tracker",) if tracker.startswith("mixture") else ())
