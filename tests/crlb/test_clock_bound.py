"""The bound of a crosslink whose clocks each run draws, and of a lidar whose noise grows with the distance."""

import numpy as np
import pytest

from relnav_sim import load_campaign
from relnav_sim.crlb.case_bound import case_bound
from relnav_sim.crlb.information import SensorInformation

# The filter's dynamics are the truth's, so its own bound and the perfect model's differ by the process noise alone.
TEXT = """
name: link
seed: 3
runs: 2
clock: {duration_s: 2000, step_s: 10, store_every_s: 200}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {position_m: [500, 0, 400], velocity_m_s: [0.2, -1.10682, 0.3]}
    mass_kg: 100
    area_m2: 1
  forces: {zonals: 2, drag: none}
sensors:
  link: {kind: crosslink, range_sigma_m: 0.3, range_rate_sigma_m_s: 2.0e-3CLOCKS}
  lidar: {range_sigma_m: 0.05, range_sigma_m_per_km: 2}
start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 1.0e-2}
statistics: {settle_s: 1000}
filters:
  ekf:
    kind: ekf
    sensors: [link]
    dynamics: {kind: nonlinear_j2}
    process_noise: {acceleration_psd_m2_s3: 1.0e-22}
    augment: AUGMENT
"""


def campaign(tmp_path, clocks, augment):
    path = tmp_path / "link.yaml"
    path.write_text(TEXT.replace("CLOCKS", clocks).replace("AUGMENT", augment))
    return load_campaign(path)


@pytest.mark.parametrize(
    "clocks, augment",
    [
        (", clock_bias_sigma_m: 3, clock_drift_sigma_m_s: 0.01", "[{kind: clock, sigma_m: 3, drift_sigma_m_s: 0.01}]"),
        (", clock_bias_sigma_m: 3", "[{kind: range_bias, sensor: link, sigma_m: 3}]"),
        (", clock_drift_sigma_m_s: 0.01", "[{kind: clock, sigma_m: 1.0e-9, drift_sigma_m_s: 0.01}]"),
        ("", "[]"),
    ],
)
def test_no_model_is_so_perfect_that_it_knows_the_clocks(tmp_path, clocks, augment):
    made = campaign(tmp_path, clocks, augment)
    bound = case_bound(made.cases[0], made.seed)
    np.testing.assert_allclose(bound.perfect_of["ekf"], bound.filters["ekf"], rtol=2e-3)
    known = campaign(tmp_path, "", "[]")
    least = case_bound(known.cases[0], known.seed).perfect_of["ekf"]
    assert (bound.perfect_of["ekf"][1:, 6] > (1.01 if clocks else 0.999) * least[1:, 6]).all()


def test_the_information_of_a_lidar_is_that_of_its_sigma_at_the_true_distance(tmp_path):
    made = campaign(tmp_path, "", "[]")
    states = np.array([[[300.0, -400.0, 0.0, 0.1, 0.0, 0.0], [0.0, 0.0, 2000.0, 0.0, 0.0, 0.0]]])
    information = SensorInformation("lidar", made.cases[0].config, states).at(states, np.ones((1, 2, 1)), np.arange(2))
    u = np.array([[0.6, -0.8, 0.0], [0.0, 0.0, 1.0]])
    sigma = 0.05 + 2e-3 * np.array([500.0, 2000.0])
    np.testing.assert_allclose(
        information[:, :3, :3], u[:, :, None] * u[:, None] / sigma[:, None, None] ** 2, rtol=1e-12, atol=1e-12
    )
    assert not information[:, 3:].any()
