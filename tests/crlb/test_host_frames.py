"""The bound between a host's GNSS fixes: the frame that Monte Carlo runs have, on average."""

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.crlb.case_bound import case_bound
from relnav_sim.crlb.host_frames import HostFrames, in_frame
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource

TEXT = """
name: between_fixes
seed: 3
runs: 4
clock: {duration_s: 300, step_s: 2, store_every_s: 10}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [200, -20000, 3000], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  forces: {zonals: 2, drag: none}
sensors:
  relative_gnss: {position_sigma_m: 0.02}
  gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15, noise: NOISE}
start: {kind: dispersed, position_sigma_m: [5, 5, 5], velocity_sigma_m_s: [0.1, 0.1, 0.1]}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-3}}
statistics: {settle_s: 20}
"""
OUTAGE = "[{kind: gaussian}, {kind: outage, windows_s: [[60, 250]]}]"


def case(noise):
    return parse_campaign(TEXT.replace("NOISE", noise)).cases[0]


def test_the_covariance_is_that_of_the_runs_own_filters():
    """Their estimates differ by centimetres from the true orbit, which hardly moves a covariance."""
    config = case(OUTAGE).config
    (part,) = chunks(config, RandomSource(3, (0, 1, 2)))
    frames = HostFrames(config)
    epochs = np.arange(151)
    found = frames.advance(epochs, part.truth.chief[0], part.truth.deputy[0])["relative_gnss"]
    scale = np.sqrt(np.einsum("kii->ki", found))
    units = scale[:, :, None] * scale[:, None]
    np.testing.assert_allclose(
        part.orbits["chief"].frame / units, np.broadcast_to(found / units, (3, 151, 6, 6)), atol=1e-4
    )


def test_information_of_gaussian_noise_is_that_of_the_sum():
    rng = np.random.default_rng(1)
    L = rng.normal(size=(4, 6, 6)) * np.repeat([1e-3, 1e-6], 3)[:, None]
    P, states = L @ L.swapaxes(1, 2), rng.normal(size=(4, 6)) * 1000
    R = np.diag([1.0, 2.0, 3.0])
    H = np.broadcast_to(np.eye(3, 6), (4, 3, 6))
    found = in_frame(np.broadcast_to(np.linalg.inv(R), (4, 3, 3)), H, states, P)
    for one, x, p in zip(found, states, P, strict=True):
        cross = np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
        np.testing.assert_allclose(one, np.linalg.inv(R + cross @ p[:3, :3] @ cross.T), rtol=1e-9)


def test_the_bound_goes_down_in_an_outage_as_the_frame_does():
    """With a wide process noise each epoch stands for itself: the plane is off by 40 cm at a fix, by 4 between."""
    with_outage, without = case_bound(case(OUTAGE), 3), case_bound(case("{kind: gaussian}"), 3)
    assert not with_outage.reason
    normal = with_outage.filters["ekf"][:, 2]
    assert normal[10] < 0.5 * normal[5]
    np.testing.assert_allclose(normal[:6], without.filters["ekf"][:6, 2], rtol=1e-6)
    assert normal[-1] == pytest.approx(without.filters["ekf"][-1, 2], rel=0.05)


def test_with_random_outages_the_frame_counts_as_perfect():
    """Then no filter beats the bound, however early in an outage it is."""
    at_random = "[{kind: gaussian}, {kind: outage, rate_per_hour: 60, mean_duration_s: 30}]"
    found = case_bound(case(at_random), 3).filters["ekf"][:, 2]
    at_fixes = case_bound(case("{kind: gaussian}"), 3).filters["ekf"][:, 2]
    assert (found[1:] < 0.3 * at_fixes[1:]).all()
