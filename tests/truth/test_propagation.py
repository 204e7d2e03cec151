"""The integrator: order, dense output, independence of the batch, and its edges."""

import re

import numpy as np
import pytest
from scipy.integrate import DOP853, solve_ivp

from relnav_sim.kernels import dop853_tableau as tableau
from relnav_sim.truth import ForceModel, propagate, propagation
from relnav_sim.truth.propagation import DenseTrajectory
from relnav_sim.truth.stepping import Batch


def two_body(state0, times, mu):
    """Return Kepler motion (T, 6) by Lagrange's f and g from the eccentric anomaly, after Battin."""
    r0, v0 = state0[:3], state0[3:]
    distance = np.linalg.norm(r0)
    a = 1 / (2 / distance - v0 @ v0 / mu)
    n = np.sqrt(mu / a**3)
    e_cos, e_sin = 1 - distance / a, r0 @ v0 / np.sqrt(mu * a)
    x = n * times
    for _ in range(30):  # change of eccentric anomaly, Newton
        f = x - e_cos * np.sin(x) + e_sin * (1 - np.cos(x)) - n * times
        x = x - f / (1 - e_cos * np.cos(x) + e_sin * np.sin(x))
    r = a * (1 - e_cos * np.cos(x) + e_sin * np.sin(x))
    f, g = 1 - a / distance * (1 - np.cos(x)), times - (x - np.sin(x)) / n
    f_dot, g_dot = -np.sqrt(mu * a) / (r * distance) * np.sin(x), 1 - a / r * (1 - np.cos(x))
    position = f[:, None] * r0 + g[:, None] * v0
    return np.hstack([position, f_dot[:, None] * r0 + g_dot[:, None] * v0])


@pytest.mark.parametrize("e", [0.0, 0.02, 0.4, 0.75])
def test_kepler_motion_on_an_irregular_grid(orbits, e):
    """Within the closed form's own rounding, about 1e-16 of the path, at any time."""
    state = orbits.orbit(a=7e6 / (1 - e), e=e, nu=2.0)
    times = np.sort(np.random.default_rng(1).uniform(0, 20_000, 400))
    error = propagate(state[None], times, orbits.force(0, drag=False))[0] - two_body(state, times, orbits.mu)
    assert np.abs(error[:, :3]).max() < 1e-5
    assert np.abs(error[:, 3:]).max() < 1e-8


def test_against_scipy_with_every_force(orbits):
    """scipy's DOP853 with short steps on the same accelerations; its own error is about 1e-6 m."""
    force, state = orbits.force(), orbits.orbit(e=0.01)

    def slope(t, y):
        return np.concatenate([y[3:], force.acceleration(y, 0.02)])

    times = np.linspace(0, 6000, 301)
    peer = solve_ivp(slope, (0, 6000), state, method="DOP853", rtol=1e-13, atol=1e-9, max_step=30, dense_output=True)
    ours = propagate(state[None], times, force, 0.02)[0]
    assert np.abs(ours - peer.sol(times).T)[:, :3].max() < 5e-6


def test_the_coefficients_are_scipys():
    for stage, row in tableau.STAGE_ROWS.items():
        full = DOP853.A[stage] if stage < 12 else DOP853.A_EXTRA[stage - 13]
        assert row == {i: w for i, w in enumerate(full) if w}
    rows = (tableau.END_ROW, DOP853.B), (tableau.ERROR5_ROW, DOP853.E5), (tableau.ERROR3_ROW, DOP853.E3)
    for row, full in (*rows, *zip(tableau.DENSE_ROWS, DOP853.D, strict=True)):
        assert row == {i: w for i, w in enumerate(full) if w}


def test_the_method_has_order_eight_and_its_dense_output_order_seven(orbits):
    """Local errors of one step fall with the 9th and 8th power of its length."""
    force, state = orbits.force(0, drag=False), orbits.orbit(e=0.1)
    lengths = np.array([150.0, 200.0, 280.0, 400.0])
    end_errors, inside_errors = [], []
    for length in lengths:
        batch = Batch(state[None], force, np.zeros(1), np.zeros(1), 1e-3, kept_steps=1)
        batch._flights.base[:], batch._flights.level[:] = length, 0
        times = np.linspace(0, length, 41)
        found = np.empty((1, 40, 6))
        batch.write(times[:40], found)
        assert batch._flights.reached == length
        exact = two_body(state, times, orbits.mu)[:, :3]
        end_errors.append(np.linalg.norm(batch._flights.states[0, :3] - exact[-1]))
        inside_errors.append(np.linalg.norm(found[0, :, :3] - exact[:40], axis=1).max())
    slope_end = np.polyfit(np.log(lengths), np.log(end_errors), 1)[0]
    slope_inside = np.polyfit(np.log(lengths), np.log(inside_errors), 1)[0]
    assert slope_end == pytest.approx(9, abs=0.5)
    assert slope_inside == pytest.approx(8, abs=0.5)


def test_the_error_between_steps_is_that_of_the_steps(orbits):
    """Dense output against the same orbit at a tolerance whose steps are half as long."""
    states, times = orbits.dispersed(3, e=0.02), np.linspace(0, 12_000, 4001)
    coarse, fine = (propagate(states, times, orbits.force(), 0.02, rtol) for rtol in (1e-12, 1e-14))
    assert np.abs(coarse - fine)[..., :3].max() < 2e-6


def mixed_batch(orbits):
    """Return states that take different steps: neighbours in low orbit, and eccentric ones that leave the batch."""
    return np.concatenate(
        [orbits.dispersed(7), orbits.dispersed(6, 1, a=2.4e7, e=0.7, nu=3.0), orbits.dispersed(3, 2, a=4e7)]
    )


def test_bits_of_an_orbit_do_not_depend_on_the_batch(orbits):
    states, ballistic = mixed_batch(orbits), np.linspace(0.0, 0.03, 16)
    times, force = np.arange(0, 9000, 7.0), orbits.force()
    whole = propagate(states, times, force, ballistic)
    for subset in ([0], [8], [15], [3, 9], [15, 2, 11, 7, 0], list(range(16))[::-1]):
        assert np.array_equal(propagate(states[subset], times, force, ballistic[subset]), whole[subset])


def test_bits_do_not_depend_on_the_lane_nor_on_who_has_arrived(orbits):
    """More orbits than lie side by side, so that latecomers take the lanes of those that are done."""
    states = np.concatenate([mixed_batch(orbits), orbits.dispersed(40, 5)])
    times, force = np.arange(0, 3000, 7.0), orbits.force()
    whole = propagate(states, times, force, 0.01)
    for rows in (slice(0, 5), slice(5, 38), slice(38, 56), slice(None, None, -1)):
        assert np.array_equal(propagate(states[rows], times, force, 0.01), whole[rows])


def test_bits_of_a_time_do_not_depend_on_the_other_times(orbits):
    states, force = mixed_batch(orbits), orbits.force()
    times = np.arange(0, 6000, 1.0)
    whole = propagate(states, times, force, 0.01)
    for some in ([0], [1234], slice(17, 5000, 613), slice(4000, 4003), slice(0, 6000, 3)):
        assert np.array_equal(propagate(states, times[some], force, 0.01), whole[:, some])


def test_chunks_are_the_whole_and_going_back_gives_the_same_bits(orbits):
    states, force, times = mixed_batch(orbits), orbits.force(), np.arange(0, 20_000, 10.0)
    whole = propagate(states, times, force, 0.01)
    trajectory = DenseTrajectory(states, force, 0.01)
    parts = [trajectory.at(times[k : k + 300]) for k in range(0, len(times), 300)]
    assert np.array_equal(np.concatenate(parts, axis=1), whole)
    assert np.array_equal(trajectory.at(times[100:200]), whole[:, 100:200])


def test_kept_steps_are_bounded_and_forgotten_ones_come_back(orbits, monkeypatch):
    monkeypatch.setattr(propagation, "KEPT_STEPS", 100)
    states, force, times = mixed_batch(orbits), orbits.force(), np.arange(0, 40_000, 50.0)
    trajectory = DenseTrajectory(states, force, 0.01)
    whole = trajectory.at(times)
    assert trajectory._batch._flights.terms.shape[:2] == (16, 6)
    for some in (slice(-9, None), slice(-30, -20), slice(50), slice(200, 260)):
        assert np.array_equal(trajectory.at(times[some]), whole[:, some])


def test_time_zero_is_the_given_state_and_times_may_repeat(orbits):
    states = orbits.dispersed(2)
    result = propagate(states, [0.0, 0.0, 5.0, 5.0], orbits.force())
    assert np.array_equal(result[:, 0], states)
    assert np.array_equal(result[:, 0], result[:, 1]) and np.array_equal(result[:, 2], result[:, 3])


@pytest.mark.parametrize(("rows", "times"), [(0, 5), (3, 0)])
def test_nothing_asked_nothing_given(orbits, rows, times):
    result = propagate(orbits.dispersed(3)[:rows], np.arange(float(times)), orbits.force())
    assert result.shape == (rows, times, 6)


def test_units_are_free(orbits):
    """A year of 2 pi about a unit mass: nothing in the integrator is tied to the Earth."""
    force = ForceModel(1.0, 1e-3, ())
    state = np.array([[1.0, 0.0, 0.0, 0.0, 1.1, 0.2]])
    times = np.linspace(0, 60, 50)
    assert np.abs(propagate(state, times, force)[0] - two_body(state[0], times, 1.0)).max() < 1e-11


def test_an_escape_conserves_energy_with_growing_steps(orbits):
    state = orbits.orbit(a=-2e7, e=1.4, nu=0.1)
    states = propagate(state[None], np.array([0.0, 1e4, 1e6, 1e8]), orbits.force(0, drag=False))[0]
    energy = (states[:, 3:] ** 2).sum(1) / 2 - orbits.mu / np.linalg.norm(states[:, :3], axis=1)
    assert np.abs(energy / energy[0] - 1).max() < 1e-13


def test_a_fall_to_the_centre_ends_in_nan_and_leaves_the_others_alone(orbits):
    states, times = orbits.dispersed(3), np.arange(0, 3000, 10.0)
    states[1, 3:] = 0.0
    force = orbits.force(0, drag=False)
    with pytest.warns(RuntimeWarning, match=r"orbit 1 ends at t = \d+\.\d+ s: it falls into the centre"):
        result = propagate(states, times, force)
    ended = np.isnan(result[1]).any(axis=1)
    # A fall from rest at r takes pi/2 sqrt(r^3 / 2 mu).
    fall = np.pi / 2 * np.sqrt(np.linalg.norm(states[1, :3]) ** 3 / (2 * orbits.mu))
    assert np.array_equal(ended, times > fall)
    assert np.array_equal(result[[0, 2]], propagate(states[[0, 2]], times, force))


def test_a_state_beyond_all_scales_is_nan_from_the_start(orbits):
    states = orbits.dispersed(2)
    states[1] *= 1e200
    with pytest.warns(RuntimeWarning, match="orbit 1"):
        result = propagate(states, [0.0, 1.0], orbits.force())
    assert np.isnan(result[1]).all() and np.isfinite(result[0]).all()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"state0": np.zeros(6)}, "state0 has shape (6,); it must be (B, 6)"),
        ({"state0": np.full((1, 6), np.nan)}, "state0 must hold finite numbers"),
        ({"state0": np.array([[0, 0, 0, 1.0, 0, 0]])}, "a position in state0 is at the centre"),
        ({"times_s": [[0.0]]}, "times_s has shape (1, 1); it must be (T,)"),
        ({"times_s": [0.0, np.inf]}, "times_s must hold finite numbers"),
        ({"times_s": [-1.0, 0.0]}, "times_s starts at -1.0; times count from state0 and cannot be negative"),
        ({"times_s": [1.0, 0.5]}, "times_s must increase"),
        ({"ballistic_m2_kg": [0.1, 0.2]}, "ballistic_m2_kg has shape (2,); it must be a number or (1,)"),
        ({"ballistic_m2_kg": -0.1}, "ballistic_m2_kg must hold finite numbers of at least 0"),
        ({"rtol": 1e-16}, "rtol is 1e-16; it must be between"),
        ({"rtol": 0.1}, "rtol is 0.1; it must be between"),
    ],
)
def test_bad_arguments_are_named(orbits, changes, sentence):
    arguments = {"state0": orbits.dispersed(1), "times_s": [0.0, 1.0], "force": orbits.force()} | changes
    with pytest.raises(ValueError, match=re.escape(sentence)):
        propagate(**arguments)
