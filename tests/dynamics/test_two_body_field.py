"""Relative motion in a real field, against orbits that SciPy integrates in that field."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import chi2

from relnav_sim import GravityField, Step, dynamics, eci_from_rtn, load_campaign, rtn_from_eci
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.gravity_field import SHIPPED
from relnav_sim.astro.kepler import initial_state
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.problems import CampaignError
from relnav_sim.dynamics import field_motion
from relnav_sim.dynamics.collocation import RIPPLE
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.field_motion import REST_GRADIENT, FieldMotion, about
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.process_noise import white_acceleration
from relnav_sim.dynamics.two_body_field import NonlinearFieldOptions

EPOCH = Epoch.parse("2010-07-27T00:00:00 GPS")
DEGREE = 20
FIELD = GravityField.load("ggm05s", DEGREE)
ORBIT = about(FIELD, dynamics.ChiefOrbit(6.85e6, 0.002, 1.55, 0.3, 0.4, 0.5))
RELATIVE = np.array([[0, -1e4, 0, 0, 0, 0], [3e3, 5e3, -8e3, 1.0, -6.6, 2.0], [50.0, -90, 30, 0.01, -0.11, -0.03]])


def motion_of(step_s, **options):
    given = {"orbit": ORBIT, "acceleration_psd_m2_s3": 1e-10, "epoch": EPOCH, "degree": DEGREE} | options
    return dynamics.nonlinear_field(step_s=step_s, **given)


def gravity(field, t, r):
    turn = EarthOrientation().matrices(np.array([t]), EPOCH)[0][0]
    return field.acceleration(r @ turn.T) @ turn


def normal_acceleration(field, t, state):
    normal = np.cross(state[:3], state[3:])
    return gravity(field, t, state[None, :3])[0] @ normal / np.linalg.norm(normal)


def integrated(field, chief, relative, times_s):
    """Return the chief (T, 6), ECI, and the relative states (T, runs, 6)."""

    def slope(t, y):
        states = y.reshape(-1, 6)
        return np.concatenate([states[:, 3:], gravity(field, t, states[:, :3])], axis=1).ravel()

    start = np.concatenate([chief[None], eci_from_rtn(chief, relative, normal_acceleration(field, times_s[0], chief))])
    ends = solve_ivp(slope, times_s[[0, -1]], start.ravel(), "DOP853", times_s, rtol=3e-14, atol=1e-9)
    states = ends.y.T.reshape(len(times_s), -1, 6)
    pairs = zip(times_s, states, strict=True)
    return states[:, 0], np.stack(
        [rtn_from_eci(each[0], each[1:], normal_acceleration(field, t, each[0])) for t, each in pairs]
    )


@pytest.mark.parametrize(
    ("step_s", "degree", "order"), [pytest.param(10.0, 20, 20, marks=pytest.mark.slow), (60.0, 40, 30), (10.0, 4, 0)]
)
def test_one_revolution(step_s, degree, order):
    field = GravityField.load("ggm05s", degree, order)
    times = np.array([0.0, 60.0, 600.0, 5640.0])
    _, expected = integrated(field, initial_state(ORBIT), RELATIVE, times)
    motion, x, found = motion_of(step_s, degree=degree, order=order), RELATIVE, {0: RELATIVE}
    for k in range(1, round(times[-1] / step_s) + 1):
        x = found[k] = motion.propagate(x, Step(k))
    x = np.stack([found[round(t / step_s)] for t in times])
    # The truth is the difference of two orbits of 7e6 m, so it has rounding errors of 2e-9 m in each of its steps.
    assert np.abs(x - expected)[1:3, ..., :3].max() < 2e-8
    assert np.abs(x - expected)[..., :3].max() < 1e-6
    assert np.abs(x - expected)[..., 3:].max() < 1e-9


def test_steps_of_a_fifth_of_a_second_add_up_to_one():
    small, large = motion_of(0.2), motion_of(10.0)
    x = RELATIVE
    for k in range(51, 101):
        x = small.propagate(x, Step(k))
    assert np.abs(x - large.propagate(RELATIVE, Step(2)))[:, :3].max() < 1e-9


def test_about_given_states_of_the_chief():
    times = np.arange(3) * 10.0
    chief, expected = integrated(FIELD, initial_state(ORBIT), RELATIVE, times)
    motion = motion_of(10.0).with_chief(chief[None], first_epoch=0)
    assert np.abs(motion.propagate(expected[1], Step(2)) - expected[2])[:, :3].max() < 1e-8
    nothing = motion.propagate(np.zeros((1, 6)), Step(2))
    assert np.abs(nothing).max() == 0.0


@pytest.mark.parametrize(
    "step_s", [0.2, 30.0, 300.0, *(pytest.param(step_s, marks=pytest.mark.slow) for step_s in (10.0, 60.0))]
)
def test_the_rest_is_evaluated_often_enough(step_s, monkeypatch):
    """Against three times more often: 1e-14 of the separation is 1e-9 m at 100 km."""
    for module in ("by_epoch", "chief_segments"):  # one step is asked for
        monkeypatch.setattr(f"relnav_sim.dynamics.{module}.CHUNK_EPOCHS", 8)
    far = RELATIVE * 10
    usual = motion_of(step_s, degree=60).propagate(far, Step(7))
    monkeypatch.setattr(field_motion, "rounds_for", lambda part_s: 6)
    assert np.abs(motion_of(step_s, degree=60).propagate(far, Step(7)) - usual)[:, :3].max() < 1e-9


def test_the_gradient_that_is_left_out_is_bounded():
    rng = np.random.default_rng(4)
    r = rng.normal(size=(400, 3))
    r *= (6378e3 + 200e3) / np.linalg.norm(r, axis=1, keepdims=True)
    field, zonal = (GravityField.load("ggm05s", n, m) for n, m in ((60, 60), (4, 0)))
    slopes = [
        (each.acceleration(r + step) - each.acceleration(r - step)) / 200
        for each in (field, zonal)
        for step in np.eye(3) * 100.0
    ]
    left = np.stack(slopes[:3], axis=-1) - np.stack(slopes[3:], axis=-1)
    # The tilt of the axis, 2.4e-3 in 2025, adds that share of J2's own gradient, 2e-8 1/s^2.
    assert np.linalg.norm(left, ord=2, axis=(1, 2)).max() < REST_GRADIENT - 5e-11
    rest = np.linalg.norm(field.acceleration(r) - zonal.acceleration(r), axis=1)
    assert rest.max() < RIPPLE * field.mu_m3_s2 / 6578e3**2


def test_jacobian():
    """Differences, but for the rest's gradient g over a step h: g h^2 / 2, g h^3 / 6 and g h, by block."""
    motion, h = motion_of(10.0), 10.0
    F = motion.transition(RELATIVE, Step(5))
    for j, size in enumerate(np.repeat([10.0, 0.01], 3)):
        aside = np.eye(6)[j] * size
        slope = (motion.propagate(RELATIVE + aside, Step(5)) - motion.propagate(RELATIVE - aside, Step(5))) / (2 * size)
        left = np.abs(slope - F[..., j])
        share = 1.0 if j < 3 else h / 3
        assert left[:, :3].max() < REST_GRADIENT * h**2 / 2 * share + 2e-11 / size
        assert left[:, 3:].max() < REST_GRADIENT * h * (1.0 if j < 3 else h / 2) + 2e-13 / size


def test_zonal_harmonics_about_the_frames_own_axis_are_those_of_nonlinear_j2(monkeypatch):
    def about_z(self, times_s, epoch):
        angle = 7.3e-5 * times_s
        turned = np.zeros((len(times_s), 3, 3))
        turned[:, 0, 0] = turned[:, 1, 1] = np.cos(angle)
        turned[:, 0, 1], turned[:, 1, 0], turned[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
        return turned, turned

    monkeypatch.setattr(EarthOrientation, "matrices", about_z)
    real = motion_of(10.0, degree=4, order=0)
    zonal = dynamics.nonlinear_j2(orbit=ORBIT, step_s=10.0, acceleration_psd_m2_s3=1e-10, zonals=4)
    x, y = RELATIVE, RELATIVE
    for k in range(1, 561):
        x, y = real.propagate(x, Step(k)), zonal.propagate(y, Step(k))
    assert np.abs(x - y)[:, :3].max() < 1e-8
    for found, expected in zip(real.transition(x, Step(9)), zonal.transition(x, Step(9)), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_the_orbit_filter_is_consistent_in_its_own_field():
    runs, epochs, step_s = 40, 60, 30.0
    sigmas = np.repeat([30.0, 0.15], 3)
    chief, _ = integrated(FIELD, initial_state(ORBIT), RELATIVE[:1], np.arange(epochs) * step_s)
    z = chief + np.random.default_rng(5).normal(size=(runs, epochs, 6)) * sigmas
    motion = FieldMotion(FIELD, ORBIT, step_s, EPOCH)
    filter = OrbitFilter(OrbitFilterOptions(acceleration_psd_m2_s3=0.0), ORBIT, sigmas, step_s, runs, motion)
    first, second = filter.advance(z[:, :25]), filter.advance(z[:, 25:])
    whole = OrbitFilter(OrbitFilterOptions(acceleration_psd_m2_s3=0.0), ORBIT, sigmas, step_s, runs, motion).advance(z)
    assert np.array_equal(np.concatenate([first, second], axis=1), whole)
    error = whole[:, -1] - chief[-1]
    nees = np.einsum("bi,bij,bj->b", error, np.linalg.inv(filter.covariance), error).sum()
    assert chi2.ppf(0.001, 6 * runs) < nees < chi2.ppf(0.999, 6 * runs)


CAMPAIGN = """
name: pair
seed: 1
runs: 2
clock: {duration_s: 1000, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {a_km: 6978.137, e: 0, i_deg: 50}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [200, 0, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 1, area_m2: 1}
sensors:
  radar: {range_sigma_m: 1, angle_sigma_deg: 0.05}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_field, degree: 4}}
"""


def test_a_file_is_found_beside_the_campaign(tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    (tmp_path / "own.gfc").write_bytes(SHIPPED["ggm05s"].read_bytes())
    dated = CAMPAIGN.replace("truth:\n", "truth:\n  epoch: 2025-03-20T12:00:00 UTC\n")
    (tmp_path / "own.yaml").write_text(dated.replace("degree: 4", "degree: 4, model: own.gfc"), encoding="utf-8")
    options = load_campaign(tmp_path / "own.yaml").cases[0].config.filters["ekf"].dynamics
    assert options.believed_field == FieldExtent(4, 4, str(tmp_path / "own.gfc"))
    with pytest.raises(ValueError, match=r"nowhere\.gfc"):
        NonlinearFieldOptions(model="nowhere.gfc")


def test_what_is_refused():
    with pytest.raises(CampaignError, match=r"campaign:12: filters.ekf.dynamics: nonlinear_field .* give truth.epoch"):
        parse_campaign(CAMPAIGN)
    dated = CAMPAIGN.replace("truth:\n", "truth:\n  epoch: 2025-03-20T12:00:00 UTC\n")
    assert parse_campaign(dated).cases[0].config.filters["ekf"].dynamics.believed_field.order == 4
    with pytest.raises(CampaignError, match="ggm05x"):
        parse_campaign(dated.replace("degree: 4", "model: ggm05x"))
    with pytest.raises(CampaignError, match="60"):
        parse_campaign(dated.replace("degree: 4", "degree: 61"))
    with pytest.raises(ValueError, match=r"truth\.epoch"):
        NonlinearFieldOptions().build(DynamicsContext(ORBIT, white_acceleration(1e-9), 1.0))
