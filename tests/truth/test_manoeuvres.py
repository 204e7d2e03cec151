"""Manoeuvres in the truth: against closed forms and brute force, their execution errors, and what is refused."""

import json

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, truth_trajectory
from relnav_sim.truth.manoeuvres import ManoeuvreOptions
from relnav_sim.truth.propagation import DenseTrajectory
from relnav_sim.truth.thrust import planned, schedule, step_forces

MU = 3.986004418e14
A_KM = 7000.0
N = np.sqrt(MU / (A_KM * 1e3) ** 3)
POINT_MASS = {"zonals": 0, "drag": "none"}
ERRORS = {"magnitude_sigma_percent": 2.0, "direction_sigma_deg": 1.0, "timing_sigma_s": 3.0}
MIXED = {
    "first": {"time_s": 500.3, "delta_v_m_s": [0.1, 0.5, -0.2]},
    "burn": {"time_s": 1200.0, "duration_s": 333.3, "acceleration_m_s2": [1e-3, 2e-3, 3e-3]},
    "evade": {"craft": "chief", "time_s": 700.0, "delta_v_m_s": [0.1, 0.5, -0.2]},
    "raise": {"craft": "chief", "time_s": 2000.0, "duration_s": 90.0, "delta_v_m_s": [0.0, 0.4, 0.1]},
}


def options(manoeuvres, relative=(0, 0, 0, 0, 0, 0), forces=None, e=0.0, **more):
    """Return the options of a truth with manoeuvres."""
    craft = {"mass_kg": 100, "area_m2": 1}
    data = {
        "chief": {**craft, "orbit": {"a_km": A_KM, "e": e, "i_deg": 51.6, "raan_deg": 20, "ta_deg": 30}},
        "deputy": {**craft, "relative": {"position_m": relative[:3], "velocity_m_s": relative[3:]}},
        "manoeuvres": manoeuvres,
        "forces": forces or {},
        **more,
    }
    return TruthOptions.model_validate_json(json.dumps(data), strict=True)


def trajectory(manoeuvres, runs=(0,), duration_s=3000.0, **more):
    return truth_trajectory(options(manoeuvres, **more), duration_s, RandomSource(3, tuple(runs)))


def kicked(state, delta_v):
    r, v = state[:3], state[3:]
    normal = np.cross(r, v)
    axes = np.stack([r, np.cross(normal, r), normal])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return np.concatenate([r, v + delta_v @ axes])


def brute_force(state, duration_s, force, ballistic, acceleration=(0, 0, 0)):
    """Return the state after a segment of constant thrust in its own turning axes: scipy's DOP853 with short steps."""

    def slope(t, y):
        thrust = kicked(y, np.array(acceleration))[3:] - y[3:]
        return np.concatenate([y[3:], force.acceleration(y, ballistic) + thrust])

    return solve_ivp(slope, (0, duration_s), state, method="DOP853", rtol=1e-13, atol=1e-9, max_step=30).y[:, -1]


def test_an_impulse_follows_clohessy_and_wiltshire():
    """Both craft at the same place, 1 cm/s: what CW leaves out is 3 n^2 x^2 / (2 a) for x of some 40 m, 1e-4 m."""
    dv = np.array([0.01, -0.01, 0.02])
    times = np.linspace(400.0, 6000.0, 15)
    path = trajectory({"one": {"time_s": 400.0, "delta_v_m_s": list(dv)}}, duration_s=6000.0, forces=POINT_MASS)
    expected = [cw_transition(N, t - 400.0)[:, 3:] @ dv for t in times]
    np.testing.assert_allclose(path.at(times).relative[0], expected, atol=2e-3)
    half = trajectory({"one": {"time_s": 400.0, "delta_v_m_s": list(dv / 2)}}, duration_s=6000.0, forces=POINT_MASS)
    # What is left is of second order: half the impulse leaves a quarter of it.
    left = path.at(times).relative[0] - expected
    quarter = half.at(times).relative[0] - np.array(expected) / 2
    np.testing.assert_allclose(quarter[:, :3], left[:, :3] / 4, atol=3e-6)


def test_a_burn_follows_hills_solution():
    """Constant acceleration in the turning frame, closed form; 7 m later 3 y^2 / (2 a), 1e-5 m, is left out."""
    a = np.array([1e-7, 2e-7, -1e-7])
    burn = {"one": {"time_s": 100.0, "duration_s": 5000.0, "acceleration_m_s2": list(a)}}
    times = np.linspace(100.0, 5100.0, 11)
    relative = trajectory(burn, duration_s=6000.0, forces=POINT_MASS).at(times).relative[0]
    t = times - 100.0
    versine, lag = (1 - np.cos(N * t)) / N**2, (N * t - np.sin(N * t)) / N**2
    x = a[0] * versine + 2 * a[1] * lag
    y = -2 * a[0] * lag + a[1] * (4 * versine - 1.5 * t**2)
    np.testing.assert_allclose(relative[:, :3], np.stack([x, y, a[2] * versine], axis=1), atol=3e-5)


def test_a_tangential_impulse_changes_the_orbit_as_energy_says():
    """vis-viva: 1 / a = 2 / r - v^2 / mu, for an eccentric orbit and a kick of 10 m/s against the motion."""
    path = trajectory({"one": {"time_s": 500.0, "delta_v_m_s": [0, -10, 0]}}, forces=POINT_MASS, e=0.05)
    before, after, later = path.at([500.0 - 1e-9, 500.0, 2500.0]).deputy[0]
    np.testing.assert_allclose(after[:3], before[:3], atol=1e-4)
    assert np.linalg.norm(after[3:] - before[3:]) == pytest.approx(10, abs=1e-5)
    expected = 1 / (2 / np.linalg.norm(after[:3]) - after[3:] @ after[3:] / MU)
    assert elements_from_state(later, MU).semi_major_axis_m == pytest.approx(expected, abs=1e-5)


def test_against_brute_force_with_every_force():
    path = trajectory(MIXED, e=0.01, relative=(100, 12000, -50, 0.1, 0.2, -0.3))
    start, end = path.at([0.0, 3000.0]).deputy[0], path.at([3000.0]).chief[0, 0]
    force, (b_chief, b_deputy) = path.force, path.ballistic_m2_kg[:, 0]
    y = brute_force(start[0], 500.3, force, b_deputy)
    y = brute_force(kicked(y, np.array([0.1, 0.5, -0.2])), 1200.0 - 500.3, force, b_deputy)
    y = brute_force(y, 333.3, force, b_deputy, (1e-3, 2e-3, 3e-3))
    y = brute_force(y, 3000.0 - 1533.3, force, b_deputy)
    assert np.abs(y - start[1])[:3].max() < 2e-6
    y = brute_force(path.at([0.0]).chief[0, 0], 700.0, force, b_chief)
    y = brute_force(kicked(y, np.array([0.1, 0.5, -0.2])), 1300.0, force, b_chief)
    y = brute_force(y, 90.0, force, b_chief, np.array([0.0, 0.4, 0.1]) / 90)
    y = brute_force(y, 910.0, force, b_chief)
    assert np.abs(y - end)[:3].max() < 2e-6


def test_the_error_falls_with_the_tolerance_as_without_thrust(orbits):
    state = orbits.dispersed(2, e=0.05)
    plan = [planned(each) for each in options(MIXED).manoeuvres.values()]
    times = np.linspace(0, 6000, 61)

    def states(rtol):
        return DenseTrajectory(state, orbits.force(), 0.02, rtol, schedule(plan, 1)).at(times)

    reference = states(1e-14)
    errors = [np.abs(states(rtol) - reference)[..., :3].max() for rtol in (1e-6, 1e-8, 1e-10, 1e-12)]
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[3] < 2e-6


def test_bits_depend_neither_on_the_block_nor_on_the_chunks():
    times = np.arange(0, 3001, 7.0)
    whole = trajectory(MIXED, runs=range(9), execution_errors=ERRORS).at(times)
    part = trajectory(MIXED, runs=[7, 2], execution_errors=ERRORS)
    chunks = [part.at(times[k : k + 50]) for k in range(0, len(times), 50)]
    for name in ("chief", "deputy", "relative"):
        joined = np.concatenate([getattr(chunk, name) for chunk in chunks], axis=1)
        assert np.array_equal(joined, getattr(whole, name)[[7, 2]])
    again = part.at(times[20:30])  # back before manoeuvres: integrated anew, with the same bits
    assert np.array_equal(again.deputy, whole.deputy[[7, 2], 20:30])


def test_a_manoeuvre_to_come_changes_nothing_before_it():
    times = np.arange(0, 2000, 10.0)
    without, with_ = (trajectory(m).at(times) for m in ({}, {"late": {"time_s": 2500.0, "delta_v_m_s": [0, 1, 0]}}))
    assert np.array_equal(without.deputy, with_.deputy)


def test_execution_errors_are_of_the_size_asked_for_and_each_has_a_stream():
    one = {"one": {"time_s": 900.0, "delta_v_m_s": [0.0, 2.0, 0.0]}}
    runs = 400
    path = trajectory(one, runs=range(runs), execution_errors=ERRORS)
    thrust = path._thrusts[0]
    bound = 4.5 / np.sqrt(2 * runs)
    size = np.linalg.norm(thrust.delta_v, axis=1)
    assert abs(size.std() / 0.04 - 1) < bound
    assert abs((thrust.start_s - 900).std() / 3 - 1) < bound
    across = thrust.delta_v[:, [0, 2]] / size[:, None]
    assert (np.abs(across.std(axis=0) / np.radians(1.0) - 1) < bound).all()
    assert options(one, execution_errors=ERRORS).is_dispersed and not options(one).is_dispersed

    # Without timing errors, and beside another manoeuvre, the other draws are the same.
    other = {**MIXED, "one": {**one["one"], "errors": {**ERRORS, "timing_sigma_s": 0.0}}}
    again = next(t for t in trajectory(other, runs=range(5))._thrusts if (t.delta_v[:, 1] > 1).all())
    assert np.array_equal(again.delta_v, thrust.delta_v[:5])
    assert (again.start_s == 900.0).all()


@pytest.mark.parametrize("duration", [None, 7.3, 40.0])
@pytest.mark.parametrize("step", [1.0, 5.0])
def test_step_forces_give_velocity_and_position(duration, step):
    """Their sums make up delta-v, and the way of a free body under the same thrust."""
    one = {"time_s": 22.2, "delta_v_m_s": [1.0, -2.0, 0.5]} | ({} if duration is None else {"duration_s": duration})
    thrust = planned(ManoeuvreOptions.model_validate_json(json.dumps(one)))
    times = np.arange(0, 101, step)
    forces = step_forces(thrust, times, step)[0]
    velocity = np.cumsum(forces[:, 0] * step, axis=0)
    np.testing.assert_allclose(velocity[-1], [1, -2, 0.5], rtol=1e-12)
    before = np.concatenate([np.zeros((1, 3)), velocity[:-1]])
    way = np.cumsum(before * step + forces[:, 1] * step**2 / 2, axis=0)[-1]
    np.testing.assert_allclose(way, np.array([1, -2, 0.5]) * (100 - 22.2 - (duration or 0) / 2), rtol=1e-12)


def test_what_is_felt_is_thrust_and_drag():
    """In free flight the drag 1/2 rho B v^2 against the motion through the turning air; in a burn its acceleration."""
    air = {"atmosphere": {"base_altitude_m": 600e3, "density_kg_m3": 1e-11}}
    path = trajectory(MIXED, forces=air, e=0.01)
    times = np.arange(1190.0, 1211.0, 1.0)
    truth = path.at(times)
    felt = path.felt(truth, 1.0)
    assert felt.shape == (1, 21, 2, 2, 3)
    r, v = truth.deputy[0, 0, :3], truth.deputy[0, 0, 3:]
    wind = v - np.cross([0, 0, 7.292115e-5], r)
    density = 1e-11 * np.exp((600e3 - (np.linalg.norm(r) - 6378137.0)) / 58.515e3)
    drag = -0.5 * density * 0.022 * np.linalg.norm(wind) * wind
    expected = np.linalg.norm(drag)
    assert np.linalg.norm(felt[0, 0, 1, 0]) == pytest.approx(expected, rel=1e-6)
    assert felt[0, 0, 1, 0, 1] < -0.9 * expected  # against the motion
    np.testing.assert_allclose(felt[0, -1, 1, 0] - felt[0, 0, 1, 0], [1e-3, 2e-3, 3e-3], atol=0.05 * expected)
    assert np.abs(felt[0, :, 0]).max() < 2 * expected  # the chief feels nothing of the deputy's burn


BAD = [
    ({"time_s": 10.0}, "give exactly one of delta_v_m_s and acceleration_m_s2"),
    ({"time_s": 10.0, "delta_v_m_s": [0, 0, 0]}, "the thrust is zero: leave the manoeuvre out"),
    ({"time_s": 10.0, "acceleration_m_s2": [0, 1, 0]}, "acceleration_m_s2 needs a duration_s"),
    ({"time_s": 0.0, "delta_v_m_s": [0, 1, 0]}, "greater than 0"),
]


@pytest.mark.parametrize("data, sentence", BAD)
def test_bad_manoeuvres_are_refused(data, sentence):
    with pytest.raises(ValidationError, match=sentence):
        options({"one": data})


def test_manoeuvres_of_one_craft_at_the_same_time_are_refused():
    first = {"time_s": 10.0, "duration_s": 5.0, "delta_v_m_s": [0, 1, 0]}
    with pytest.raises(ValidationError, match="begins while 'a' of the same craft is under way, at 14 s"):
        options({"a": first, "b": {"time_s": 14.0, "delta_v_m_s": [0, 1, 0]}})
    options({"a": first, "b": {"time_s": 15.0, "delta_v_m_s": [0, 1, 0]}})
    options({"a": first, "b": {"craft": "chief", "time_s": 12.0, "delta_v_m_s": [0, 1, 0]}})
