"""Process noise under the real gravity field: found during the run, against tuned where truth and filter agree."""

import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.simulation.block import simulate_block
from relnav_sim.tuning.scalars import free_scalars

TEXT = """
name: real_field_noise
seed: 20260713
runs: 40
clock: {duration_s: 16980, step_s: 10, store_every_s: 1000}
truth:
  epoch: 2026-07-13T00:00:00 UTC
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 400
    area_m2: 1
  deputy:
    relative: {position_m: [-7.27, -9999.99, 0], velocity_m_s: [0, 0, 0]}
    mass_kg: 400
    area_m2: 1
  forces: {gravity: {model: ggm05s, degree: 40, order: 40}, drag: none}
sensors:
  relative_gnss: {position_sigma_m: 0.005}
  gnss: {position_sigma_m: 1, velocity_sigma_m_s: 0.01}
start: {kind: dispersed, position_sigma_m: 1, velocity_sigma_m_s: 0.01}
statistics: {settle_s: 11320} # the third revolution counts
filters:
  tuned_on_zonals: # relnav tune, with the truth's zonals to J4 in place of the field: the least that it tries
    {kind: ekf, dynamics: {kind: nonlinear_j2, zonals: 4}, process_noise: {acceleration_psd_m2_s3: 1.0e-14}}
  adaptive:
    kind: ekf
    dynamics: {kind: nonlinear_j2, zonals: 4}
    process_noise:
      adaptive:
        start: {radial_psd_m2_s3: 1.0e-11, along_track_psd_m2_s3: 1.0e-11, normal_psd_m2_s3: 1.0e-11}
  dmc:
    kind: ekf
    dynamics: {kind: nonlinear_j2, zonals: 4}
    process_noise:
      dmc:
        radial: {sigma_m_s2: 7.0e-7, tau_s: 300}
        along_track: {sigma_m_s2: 7.0e-7, tau_s: 300}
        normal: {sigma_m_s2: 7.0e-7, tau_s: 300}
"""


def anees(runs, *overrides):
    """Return the ANEES of the whole state of each filter, mean over runs and the settled span."""
    found = parse_campaign(TEXT, overrides)
    filters = simulate_block(found.cases[0], found.seed, range(runs)).result.filters
    return {name: float(filter.summary["anees"][:, 1, 0].mean()) for name, filter in filters.items()}


def started(density):
    """Return overrides that let the densities start elsewhere."""
    start = "filters.adaptive.process_noise.adaptive.start"
    return [f"{start}.{axis}_psd_m2_s3={density}" for axis in ("radial", "along_track", "normal")]


@pytest.mark.slow
def test_found_noise_is_consistent_over_a_revolution_where_noise_tuned_on_zonals_is_not():
    found = anees(40)
    assert 0.9 < found["adaptive"] < 1.1
    assert found["tuned_on_zonals"] > 100
    # Where the truth has no more of the field than the filter, that noise is not too small.
    assert anees(20, "truth.forces={zonals: 4, drag: none}", "truth.epoch=null")["tuned_on_zonals"] < 1.1


@pytest.mark.slow
def test_found_noise_is_as_consistent_from_starts_five_decades_apart():
    for density in (1e-13, 1e-8):
        assert 0.85 < anees(20, *started(density))["adaptive"] < 1.1


def test_noise_tuned_on_zonals_is_refuted_by_the_real_field_within_minutes():
    found = anees(2, "clock.duration_s=1500", "statistics.settle_s=1000")
    assert found["tuned_on_zonals"] > 10 > 3 > found["adaptive"]
    free = free_scalars(parse_campaign(TEXT))
    assert [len(free[name]) for name in ("tuned_on_zonals", "adaptive", "dmc")] == [1, 4, 6]
