"""True biases of sensors along recorded orbits: known of readings that the campaign simulates, of measured ones not."""

from dataclasses import replace

import numpy as np
import pytest

from relnav_sim import ForceModel, load_campaign, propagate
from relnav_sim.recorded.readings_csv import write_csv
from relnav_sim.runner.replay import replay_campaign
from relnav_sim.sensors import readings_layout
from relnav_sim.simulation.recording import record

TEXT = """
name: flown
seed: 4
runs: 2
clock: {duration_s: 300, step_s: 1, store_every_s: 5}
truth:
  epoch: 2021-07-10T16:00:00 GPS
  ephemeris: {chief: chief.csv, deputy: deputy.csv}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1, range_bias_m: 3}
start: {kind: first_fix, velocity_sigma_m_s: 0.5}
filters:
  ekf:
    kind: ekf
    dynamics: {kind: cw}
    process_noise: {acceleration_psd_m2_s3: 1.0e-9}
    augment: [{kind: range_bias, sigma_m: 5}]
statistics: {settle_s: 100}
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A campaign along two recorded orbits, and the readings of its run 0."""
    folder = tmp_path_factory.mktemp("flown")
    times_s = np.arange(0.0, 400.0, 20.0)
    earth = ForceModel(3.986004418e14, 6378137.0, zonals=())
    chief = np.array([6.9e6, 0.0, 0.0, 0.0, 4885.5, 5822.4])
    deputy = chief + np.array([20.0, -1500.0, -1800.0, 1.9, 0.0, 0.1])
    orbits = propagate(np.stack([chief, deputy]), times_s, earth)
    for name, orbit in zip(("chief", "deputy"), orbits, strict=True):
        rows = [",".join(map(repr, row)) for row in np.column_stack([times_s, orbit]).tolist()]
        head = "# frame: EME2000\n# epoch: 2021-07-10T16:00:00 GPS\ntime_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n"
        (folder / f"{name}.csv").write_text(head + "\n".join(rows) + "\n")
    (folder / "flown.yaml").write_text(TEXT)
    campaign = load_campaign(folder / "flown.yaml")
    (readings,) = record(campaign.cases[0].config, campaign.seed, [0])
    return campaign, readings, folder


def replayed(flown, readings):
    campaign, _, folder = flown
    write_csv(folder / "readings.csv", readings, readings_layout(campaign.cases[0].config.sensors))
    (block,) = replay_campaign(campaign, [folder / "readings.csv"]).block.results
    return block.filters["ekf"]


def test_simulated_readings_have_the_bias_that_the_campaign_says(flown):
    bias = replayed(flown, flown[1]).augmented
    np.testing.assert_allclose(bias.estimate - bias.error, 3.0, rtol=0, atol=1e-12)


def test_of_measured_readings_nobody_knows_the_bias(flown):
    readings = flown[1]
    radar = readings.sensors["radar"]
    measured = replace(readings, sensors={"radar": replace(radar, values=radar.values + np.array([1.5, 0.0, 0.0]))})
    scored = replayed(flown, measured)
    assert np.isnan(scored.augmented.error).all()
    assert np.isfinite(scored.augmented.estimate).all()
    assert np.isfinite(scored.augmented.sigma).all()
